#include "daemon/core/output/guide_painter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <map>
#include <utility>

#include "drivers/gles/placement.hpp"

namespace previz::output {
namespace {

constexpr int tile_px = 64;
constexpr double words_share = 1.0 / 45;  // height of the em over the screen's

using Rgb = std::array<std::uint8_t, 3>;

constexpr Rgb dark{0, 0, 0};

// Colours as the screen shows them. Red, green and blue are the axes', as in every other program.
Rgb colour_of(GuideKind kind) {
  static constexpr std::array<Rgb, 9> colours = {{{90, 255, 120},
                                                  {255, 225, 70},
                                                  {120, 215, 255},
                                                  {255, 60, 50},
                                                  {0, 200, 40},
                                                  {70, 110, 255},
                                                  {255, 140, 230},
                                                  {255, 255, 255},
                                                  {255, 150, 30}}};
  return colours[static_cast<std::size_t>(kind)];
}

// The part of the screen on which something may be drawn, in tiles that are made when they are
// drawn on.
class Canvas {
 public:
  // The picture's place may reach beyond the screen.
  Canvas(int width, int height, const gles::Rectangle& picture)
      : width_(width),
        height_(height),
        left_(std::max(picture.x, 0)),
        top_(std::max(picture.y, 0)),
        right_(std::min(picture.x + picture.width, width)),
        bottom_(std::min(picture.y + picture.height, height)) {}

  // Lays a colour over a pixel; `share` is its opacity, 0 to 1.
  void blend(int x, int y, const Rgb& colour, double share) {
    if (share <= 0 || x < left_ || x >= right_ || y < top_ || y >= bottom_) return;
    std::uint8_t* rgba = pixel(x, y);
    const double kept = 1 - share;
    for (std::size_t c = 0; c < 3; ++c)
      rgba[c] = static_cast<std::uint8_t>(std::lround(kept * rgba[c] + share * colour[c]));
    rgba[3] = static_cast<std::uint8_t>(std::lround(kept * rgba[3] + share * 255));
  }

  // Makes a pixel at least so dark and opaque, where no colour is.
  void shade(int x, int y, double share) {
    if (share <= 0 || x < left_ || x >= right_ || y < top_ || y >= bottom_) return;
    std::uint8_t& alpha = pixel(x, y)[3];
    alpha = std::max(alpha, static_cast<std::uint8_t>(std::lround(255 * share)));
  }

  std::vector<Overlay> tiles() && {
    std::vector<Overlay> all;
    for (auto& [at, tile] : tiles_) all.push_back(std::move(tile));
    return all;
  }

 private:
  std::uint8_t* pixel(int x, int y) {
    const std::pair<int, int> at{y / tile_px, x / tile_px};
    if (!last_ || at != last_at_) {
      last_ = &tiles_[at];
      last_at_ = at;
    }
    Overlay& tile = *last_;
    if (tile.rgba.empty()) {
      tile.x = at.second * tile_px;
      tile.y = at.first * tile_px;
      tile.width = std::min(tile_px, width_ - tile.x);
      tile.height = std::min(tile_px, height_ - tile.y);
      tile.rgba.resize(4 * static_cast<std::size_t>(tile.width * tile.height));
    }
    return &tile.rgba[4 * static_cast<std::size_t>((y - tile.y) * tile.width + x - tile.x)];
  }

  const int width_, height_, left_, top_, right_, bottom_;
  std::map<std::pair<int, int>, Overlay> tiles_;  // by row and column
  Overlay* last_ = nullptr;
  std::pair<int, int> last_at_;
};

// Calls `visit(x, y, distance)` for the pixels around a line: the distance of the pixel's centre to
// the line, in pixels, is at most about `reach`.
template <typename Visit>
void for_each_near(const glm::dvec2& a, const glm::dvec2& b, double reach, Visit visit) {
  const glm::dvec2 along = b - a;
  const std::size_t major = std::abs(along.x) >= std::abs(along.y) ? 0 : 1, minor = 1 - major;
  const auto m = static_cast<glm::length_t>(major), n = static_cast<glm::length_t>(minor);
  const double length2 = std::max(glm::dot(along, along), 1e-12);
  const double slope = std::abs(along[m]) > 1e-9 ? along[n] / along[m] : 0;
  const double across = reach * std::sqrt(1 + slope * slope);
  const double from = std::min(a[m], b[m]), to = std::max(a[m], b[m]);
  for (int i = int(std::floor(from - reach)); i <= int(std::ceil(to + reach)); ++i) {
    const double middle = a[n] + slope * (std::clamp(double(i), from, to) - a[m]);
    for (int j = int(std::ceil(middle - across)); j <= int(std::floor(middle + across)); ++j) {
      glm::dvec2 p;
      p[m] = i, p[n] = j;
      const double share = std::clamp(glm::dot(p - a, along) / length2, 0.0, 1.0);
      visit(int(p.x), int(p.y), glm::distance(p, a + share * along));
    }
  }
}

// Returns how much of a pixel lies within a line, from its centre's distance to the line's middle.
double covered(double distance, double half_width) {
  return std::clamp(half_width + 0.5 - distance, 0.0, 1.0);
}

void draw_words(Canvas& canvas, const Font& font, const GuideWord& word, const glm::dvec2& at) {
  const Coverage text = font.draw(word.text);
  const int x0 = int(std::lround(at.x - 0.5 * text.width)),
            y0 = int(std::lround(at.y - 0.5 * text.height)), border = font.cap_height() / 4;
  for (int y = -border; y < text.height + border; ++y)
    for (int x = -border; x < text.width + border; ++x) {
      const bool inside = x >= 0 && x < text.width && y >= 0 && y < text.height;
      canvas.blend(x0 + x, y0 + y, dark, 0.62);
      if (inside)
        canvas.blend(x0 + x, y0 + y, colour_of(word.kind),
                     text.values[static_cast<std::size_t>(y * text.width + x)] / 255.0);
    }
}

}  // namespace

GuidePainter::GuidePainter(int screen_width, int screen_height, DisplayScale scale,
                           const std::filesystem::path& font)
    : width_(screen_width),
      height_(screen_height),
      scale_(scale),
      font_(font, std::max(8, int(std::lround(words_share * screen_height)))) {}

std::vector<Overlay> GuidePainter::paint(const GuidePage& page, int picture_width,
                                         int picture_height) const {
  const gles::Rectangle place = gles::place(picture_width, picture_height, width_, height_, scale_);
  Canvas canvas(width_, height_, place);
  const auto on_screen = [&](const glm::dvec2& px) {
    return glm::dvec2(place.x + (px.x + 0.5) * place.width / page.width - 0.5,
                      place.y + (px.y + 0.5) * place.height / page.height - 0.5);
  };
  const double half_width = std::max(0.75, height_ / 1080.0), border = half_width + 1;
  // All borders come first, so that none of them cuts another line.
  for (const GuideLine& line : page.lines)
    for_each_near(on_screen(line.a), on_screen(line.b), border + 0.5,
                  [&](int x, int y, double d) { canvas.shade(x, y, 0.5 * covered(d, border)); });
  for (const GuideLine& line : page.lines)
    for_each_near(on_screen(line.a), on_screen(line.b), half_width + 0.5,
                  [&](int x, int y, double d) {
                    canvas.blend(x, y, colour_of(line.kind), covered(d, half_width));
                  });
  for (const GuideWord& word : page.words) draw_words(canvas, font_, word, on_screen(word.at));
  return std::move(canvas).tiles();
}

}  // namespace previz::output
