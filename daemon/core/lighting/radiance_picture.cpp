#include "daemon/core/lighting/radiance_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <optional>
#include <sstream>
#include <utility>

#include "daemon/core/lighting/picture_rows.hpp"
#include "daemon/core/lighting/primaries.hpp"
#include "drivers/error.hpp"

namespace previz::lighting {
namespace {

using Pixel = std::array<std::uint8_t, 4>;  // mantissas of red, green and blue; exponent

struct Axis {
  bool is_x = false;
  bool descends = false;  // X to the left, Y downwards
  std::int64_t size = 0;
};

struct Header {
  glm::dvec3 exposure{1};  // EXPOSURE and COLORCORR, which the file's values are already scaled by
  std::optional<Chromaticities> primaries;  // where they are not those of Rec. 709
  bool is_xyz = false;
  double pixel_aspect = 1;
  Axis lines, pixels;  // from scan line to scan line; from pixel to pixel in one
};

// Reads one file from its beginning; the scan lines follow the header.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& path) : path_(path), file_(path, std::ios::binary) {}

  Header header() {
    Header header;
    line();  // the magic word, which the caller has seen
    for (std::string text = line(); !text.empty(); text = line()) read_variable(text, header);
    const std::string resolution = line();
    std::istringstream words(resolution);
    if (!read_axis(words, header.lines) || !read_axis(words, header.pixels) ||
        header.lines.is_x == header.pixels.is_x)
      fail(fmt::format("its size is \"{}\"; expected something like \"-Y 512 +X 1024\"",
                       resolution.substr(0, 40)));
    return header;
  }

  // Reads the next scan line.
  void scan_line(std::vector<Pixel>& pixels, std::int64_t number) {
    line_ = number;
    const Pixel first = pixel();
    const std::size_t size = pixels.size();
    // Lines of other lengths have no runs by component.
    if (size < 8 || size > 0x7fff || first[0] != 2 || first[1] != 2 || first[2] > 127)
      return older_line(pixels, first);
    if (static_cast<std::size_t>(first[2] << 8 | first[3]) != size)
      damaged("is not as long as the picture is wide");
    for (std::size_t component = 0; component < 4; ++component) runs(pixels, component);
  }

 private:
  [[noreturn]] void fail(const std::string& why) const {
    throw Error(path_.string() + ": cannot be read as Radiance .hdr: " + why);
  }
  [[noreturn]] void damaged(const char* why) const {
    fail(fmt::format("scan line {} {}; the file is damaged: copy or export it again", line_ + 1,
                     why));
  }

  std::string line() {
    constexpr std::size_t most = 4096;
    std::string text;
    for (int c = file_.get(); c != '\n'; c = file_.get()) {
      if (c == std::char_traits<char>::eof()) fail("the file ends in its header");
      if (text.size() == most) fail("its header has a line of more than 4096 characters");
      text += static_cast<char>(c);
    }
    if (text.ends_with('\r')) text.pop_back();
    return text;
  }

  void read_variable(const std::string& text, Header& header) const {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || text.starts_with('#')) return;
    const std::string name = text.substr(0, equals);
    std::istringstream value(text.substr(equals + 1));
    if (name == "FORMAT") {
      std::string format;
      value >> format;
      header.is_xyz = format == "32-bit_rle_xyze";
      if (!header.is_xyz && format != "32-bit_rle_rgbe")
        fail(fmt::format("FORMAT is \"{}\"; expected 32-bit_rle_rgbe or 32-bit_rle_xyze",
                         format.substr(0, 40)));
    } else if (name == "EXPOSURE" || name == "COLORCORR") {
      glm::dvec3 factor(0);
      value >> factor.r;
      factor.g = factor.b = factor.r;
      if (name == "COLORCORR") value >> factor.g >> factor.b;
      header.exposure *= factor;  // each program that scaled the picture has added its own line
      for (int c = 0; c < 3; ++c)
        if (!value || !(header.exposure[c] > 1e-30 && header.exposure[c] < 1e30))
          fail(fmt::format("\"{}\" is not a brightness factor", text.substr(0, 60)));
    } else if (name == "PRIMARIES") {
      // Photoshop writes zeros, which say nothing; Radiance's own are none of Rec. 709.
      Chromaticities found{};
      for (auto& xy : found) value >> xy[0] >> xy[1];
      if (found != Chromaticities{} && !is_rec709(found)) header.primaries = found;
    } else if (name == "PIXASPECT") {
      double height = 0;  // of a pixel, by its width
      value >> height;
      header.pixel_aspect /= height;
      if (!(header.pixel_aspect > 0.01 && header.pixel_aspect < 100))
        fail(fmt::format("\"{}\" is not a pixel's aspect", text.substr(0, 60)));
    }
  }

  static bool read_axis(std::istringstream& words, Axis& axis) {
    std::string name;
    if (!(words >> name >> axis.size) || name.size() != 2) return false;
    axis.is_x = name[1] == 'X';
    axis.descends = name[0] == '-';
    return (name[0] == '-' || name[0] == '+') && (name[1] == 'X' || name[1] == 'Y');
  }

  std::uint8_t byte() {
    const int c = file_.get();
    if (c == std::char_traits<char>::eof()) damaged("is cut off");
    return static_cast<std::uint8_t>(c);
  }
  Pixel pixel() { return {byte(), byte(), byte(), byte()}; }

  // Runs of one component: a length of more than 128 repeats the next byte.
  void runs(std::vector<Pixel>& pixels, std::size_t component) {
    for (std::size_t x = 0; x < pixels.size();) {
      std::size_t count = byte();
      const bool repeats = count > 128;
      if (repeats) count -= 128;
      if (count == 0 || count > pixels.size() - x) damaged("has a run that does not fit");
      std::uint8_t value = repeats ? byte() : std::uint8_t{0};
      for (const std::size_t end = x + count; x < end; ++x)
        pixels[x][component] = repeats ? value : byte();
    }
  }

  // Flat pixels, of which (1, 1, 1, n) repeats the one before n times; each such pixel that follows
  // another counts 256 times as much.
  void older_line(std::vector<Pixel>& pixels, Pixel next) {
    int shift = 0;
    for (std::size_t x = 0;;) {
      if (next[0] == 1 && next[1] == 1 && next[2] == 1) {
        const std::size_t count = std::size_t{next[3]} << shift;
        if (x == 0 || shift > 16 || count > pixels.size() - x)
          damaged("has a run that does not fit");
        std::fill_n(pixels.begin() + static_cast<std::ptrdiff_t>(x), count, pixels[x - 1]);
        x += count;
        shift += 8;
      } else {
        pixels[x++] = next;
        shift = 0;
      }
      if (x == pixels.size()) return;
      next = pixel();
    }
  }

  const std::filesystem::path& path_;
  std::ifstream file_;
  std::int64_t line_ = 0;
};

// Turns scan lines into rows from the top, each from the left.
LinearPicture upright(LinearPicture&& stored, const Header& header) {
  const bool is_turned = header.lines.is_x;
  const Axis& across = is_turned ? header.lines : header.pixels;
  const Axis& down = is_turned ? header.pixels : header.lines;
  const bool from_left = !across.descends, from_top = down.descends;
  if (!is_turned && from_left && from_top) return std::move(stored);
  LinearPicture picture{
      is_turned ? stored.height : stored.width, is_turned ? stored.width : stored.height, {}};
  picture.radiance.resize(stored.radiance.size());
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const int column = from_left ? x : picture.width - 1 - x;
      const int row = from_top ? y : picture.height - 1 - y;
      picture.at(x, y) = is_turned ? stored.at(row, column) : stored.at(column, row);
    }
  return picture;
}

// Radiance's XYZ has equal energy for white (its ra_xyze and "filefmts").
void to_rec709(LinearPicture& picture, const Header& header, const std::filesystem::path& path,
               std::vector<std::string>& notes) {
  if (!header.is_xyz && !header.primaries) return;
  const auto matrix =
      header.is_xyz ? rec709_from_xyz(equal_energy) : rec709_from(*header.primaries);
  notes.push_back(path.string() +
                  (!matrix         ? ": its PRIMARIES span no colours; its values are used "
                                     "as linear Rec. 709"
                   : header.is_xyz ? ": is CIE XYZ; it is converted to linear Rec. 709, white to "
                                     "white"
                                   : ": has other PRIMARIES than those of Rec. 709; it is "
                                     "converted, white to white"));
  if (matrix) convert_light(picture.radiance, *matrix, path, notes);
}

}  // namespace

LinearPicture read_radiance_picture(const std::filesystem::path& path,
                                    std::vector<std::string>& notes, std::int64_t most_kept) {
  Reader reader(path);
  const Header header = reader.header();
  check_size(path, header.pixels.size, header.lines.size);
  PictureRows rows(path, static_cast<int>(header.pixels.size), static_cast<int>(header.lines.size),
                   most_kept);
  std::vector<Pixel> pixels(static_cast<std::size_t>(header.pixels.size));
  std::vector<glm::vec3> row(pixels.size());
  const glm::dvec3 scale = 1.0 / header.exposure;
  for (std::int64_t line = 0; line < header.lines.size; ++line) {
    reader.scan_line(pixels, line);
    std::ranges::transform(pixels, row.begin(), [&](const Pixel& p) {
      const double unit = p[3] == 0 ? 0 : std::ldexp(1.0, p[3] - 136);
      return glm::vec3(scale * unit * glm::dvec3(p[0], p[1], p[2]));
    });
    rows.append(row);
  }
  LinearPicture stored = std::move(rows).picture(notes);
  if (header.exposure != glm::dvec3(1))
    notes.push_back(fmt::format(
        "{}: its header says that it was made {:.4g}, {:.4g} and {:.4g} times as bright (red, "
        "green, blue; EXPOSURE, COLORCORR); this is divided out",
        path.string(), header.exposure.r, header.exposure.g, header.exposure.b));
  to_rec709(stored, header, path, notes);
  const double scale_of_file = stored.pixels_of_file;
  LinearPicture picture = upright(std::move(stored), header);
  picture.pixels_of_file = scale_of_file;
  picture.pixel_aspect = static_cast<float>(header.pixel_aspect);
  return picture;
}

}  // namespace previz::lighting
