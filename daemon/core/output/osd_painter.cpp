#include "daemon/core/output/osd_painter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace previz::output {
namespace {

// Colour values are 0..1 as the screen shows them (not linear).
struct Colour {
  double red, green, blue;
};
struct Style {
  Colour ground;
  double opacity;  // opacity of the box behind the text
  Colour text;
};

// Permanent texts have dark grounds, so that they do not draw the eye from the picture; texts that
// must not be missed have loud ones. Every pair has a contrast of at least 4.5 on any picture.
const Style& style_of(OsdTone tone) {
  constexpr Colour white{1, 1, 1}, black{0, 0, 0};
  static constexpr std::array<Style, 5> styles = {{
      {black, 0.62, {0.96, 0.96, 0.96}},
      {{0.05, 0.26, 0.55}, 0.94, white},
      {{0.76, 0.03, 0.05}, 1, white},
      {{0.98, 0.75, 0.10}, 0.96, black},
      {{0.62, 0.02, 0.16}, 0.96, white},
  }};
  return styles[static_cast<std::size_t>(tone)];
}

// Returns how much of a pixel lies within a rectangle with rounded corners, from the distance of
// the pixel's centre.
double rounded(int x, int y, int width, int height, double radius) {
  const double dx = std::max({radius - (x + 0.5), (x + 0.5) - (width - radius), 0.0});
  const double dy = std::max({radius - (y + 0.5), (y + 0.5) - (height - radius), 0.0});
  return std::clamp(radius + 0.5 - std::hypot(dx, dy), 0.0, 1.0);
}

std::uint8_t to_byte(double share) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(share, 0.0, 1.0)));
}

std::vector<std::string> words_in(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(' ', begin), text.size());
    if (end > begin) words.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return words;
}

bool continues_a_character(char byte) {
  return (static_cast<unsigned char>(byte) & 0xc0) == 0x80;  // continuation byte in UTF-8
}

}  // namespace

OsdPainter::OsdPainter(int screen_width, int screen_height, double text_height,
                       const std::filesystem::path& font)
    : width_(screen_width),
      height_(screen_height),
      font_(font, static_cast<int>(std::lround(text_height * screen_height))),
      padding_(font_.cap_height() * 2 / 3),
      gap_(font_.cap_height() / 3),
      margin_(font_.cap_height()),
      box_height_(font_.ascent() + font_.descent() + gap_),
      row_width_(width_ - 2 * margin_),
      side_width_(std::min(row_width_, std::max(row_width_ / 3, 5 * box_height_))) {}

std::vector<Overlay> OsdPainter::paint(const OsdPage& page) const {
  const Rows top = rows_of(page.top_left, page.top_right);
  const Rows bottom = rows_of(page.bottom_left, page.bottom_right);
  const auto most =
      static_cast<std::size_t>(std::max((height_ - 2 * margin_ + gap_) / (box_height_ + gap_), 0));
  const std::size_t room = most - std::min(most, top.size() + bottom.size());
  std::vector<Overlay> overlays;
  int y = margin_;
  const auto put = [&](const std::vector<Box>& row) {
    for (Box box : row) {
      box.y = y;
      if (box.x >= 0 && box.x + box.width <= width_ && y >= 0 && y + box_height_ <= height_)
        overlays.push_back(draw(box));
    }
    y += box_height_ + gap_;
  };
  for (const auto& row : top) put(row);
  const int below_top = y;
  for (const auto& row : notices(page.notices, room)) put(row);
  y = below_top;
  for (const auto& row : column(page.column, page.notices.empty(), room)) put(row);
  y = height_ - margin_ + gap_ - static_cast<int>(bottom.size()) * (box_height_ + gap_);
  for (const auto& row : bottom) put(row);
  return overlays;
}

int OsdPainter::width_of(const OsdText& words) const {
  return font_.width(words.text) + 2 * padding_;
}

// Breaks text into lines of at most that width, between words, and within a word that is wider.
std::vector<OsdText> OsdPainter::broken(const OsdText& words, int most_width) const {
  const auto fits = [&](const std::string& text) {
    return font_.width(text) + 2 * padding_ <= most_width;
  };
  std::vector<std::string> lines;
  for (std::string word : words_in(words.text)) {
    if (!lines.empty() && fits(lines.back() + " " + word)) {
      lines.back() += " " + word;
      continue;
    }
    while (!fits(word)) {
      std::size_t end = word.size();
      do --end;
      while (end > 1 && (continues_a_character(word[end]) || !fits(word.substr(0, end))));
      if (end <= 1) break;
      lines.push_back(word.substr(0, end));
      word.erase(0, end);
    }
    lines.push_back(std::move(word));
  }
  std::vector<OsdText> boxes;
  for (std::string& line : lines) boxes.push_back({std::move(line), words.tone});
  return boxes;
}

// Places the left boxes in order from the left, and the right ones against the right edge of the
// first row in which all of them fit. Rows are filled from the top.
OsdPainter::Rows OsdPainter::rows_of(const std::vector<OsdText>& left,
                                     const std::vector<OsdText>& right) const {
  Rows rows;
  int x = margin_;
  for (const OsdText& words : left)
    for (const OsdText& line : broken(words, row_width_)) {
      const int width = width_of(line);
      if (rows.empty() || (x > margin_ && x + width > width_ - margin_)) {
        rows.emplace_back();
        x = margin_;
      }
      rows.back().push_back({x, 0, line, width});
      x += width + gap_;
    }
  std::vector<Box> against;
  int total = 0;
  for (const OsdText& words : right) {
    against.push_back({0, 0, words, width_of(words)});
    total += against.back().width + gap_;
  }
  if (against.empty()) return rows;
  if (total + margin_ > width_ - margin_) {  // too wide for one row: they follow the left ones
    std::vector<OsdText> all = left;
    all.insert(all.end(), right.begin(), right.end());
    return rows_of(all, {});
  }
  if (rows.empty() || x + total > width_ - margin_) rows.emplace_back();
  x = width_ - margin_ + gap_ - total;
  for (Box& box : against) {
    box.x = x;
    x += box.width + gap_;
    rows.back().push_back(std::move(box));
  }
  return rows;
}

// Breaks texts into at most so many lines of at most that width. The last of them says how many
// more there are, with these words after the number.
std::vector<OsdText> OsdPainter::stacked(const std::vector<OsdText>& texts, int most_width,
                                         std::size_t most, const OsdText& hidden) const {
  std::vector<OsdText> lines;
  for (const OsdText& text : texts)
    for (OsdText& line : broken(text, most_width)) lines.push_back(std::move(line));
  if (lines.size() <= most) return lines;
  const std::size_t number = lines.size() - most + 1;
  lines.resize(most);
  if (most > 0) lines.back() = {std::to_string(number) + hidden.text, hidden.tone};
  return lines;
}

OsdPainter::Rows OsdPainter::notices(const std::vector<OsdText>& notices, std::size_t most) const {
  const OsdText hidden{" more in the log", OsdTone::warning};
  Rows rows;
  for (const OsdText& line : stacked(notices, side_width_, most, hidden)) {
    const int width = width_of(line);
    rows.push_back({{width_ - margin_ - width, 0, line, width}});
  }
  return rows;
}

OsdPainter::Rows OsdPainter::column(const std::vector<OsdText>& texts, bool is_alone,
                                    std::size_t most) const {
  const int most_width = is_alone ? row_width_ : row_width_ - side_width_ - gap_;
  Rows rows;
  if (most_width < side_width_) return rows;
  for (const OsdText& line : stacked(texts, most_width, most, {" more lines"}))
    rows.push_back({{margin_, 0, line, width_of(line)}});
  return rows;
}

Overlay OsdPainter::draw(const Box& box) const {
  const Style& style = style_of(box.words.tone);
  const Coverage text = font_.draw(box.words.text);
  Overlay overlay{box.x, box.y, box.width, box_height_, {}};
  overlay.rgba.reserve(4 * static_cast<std::size_t>(box.width * box_height_));
  const int above = (box_height_ - text.height) / 2;
  for (int y = 0; y < box_height_; ++y)
    for (int x = 0; x < box.width; ++x) {
      const int tx = x - padding_;
      const int ty = y - above;
      const bool inside = tx >= 0 && ty >= 0 && tx < text.width && ty < text.height;
      const double ink =
          inside ? text.values[static_cast<std::size_t>(ty * text.width + tx)] / 255.0 : 0;
      const double ground = style.opacity * rounded(x, y, box.width, box_height_, gap_) * (1 - ink);
      for (const auto& [of_ground, of_text] : {std::pair{style.ground.red, style.text.red},
                                               {style.ground.green, style.text.green},
                                               {style.ground.blue, style.text.blue},
                                               {1.0, 1.0}})
        overlay.rgba.push_back(to_byte(of_ground * ground + of_text * ink));
    }
  return overlay;
}

}  // namespace previz::output
