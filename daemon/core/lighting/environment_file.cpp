// Implements load_environment: resamples a latitude-longitude picture or a cube to an octahedral
// map.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "daemon/core/lighting/cube_cross.hpp"
#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/lighting/linear_picture.hpp"
#include "daemon/core/lighting/parallel.hpp"
#include "daemon/core/lighting/picture_file.hpp"
#include "daemon/core/lighting/picture_reduction.hpp"
#include "daemon/core/lighting/picture_repair.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/octahedral.h"

namespace previz::lighting {
namespace {

using std::numbers::pi;

// The picture with a margin of one pixel: wrapped in azimuth, repeated over the poles, so that
// bilinear lookups need no branch.
class Panorama {
 public:
  explicit Panorama(const LinearPicture& picture) : width_(picture.width), height_(picture.height) {
    texels_.resize(static_cast<std::size_t>(width_ + 2) * static_cast<std::size_t>(height_ + 2));
    for (int y = -1; y <= height_; ++y) {
      const int row = std::clamp(y, 0, height_ - 1);
      for (int x = -1; x <= width_; ++x) {
        const int column = (x + width_) % width_;
        texels_[index(x, y)] =
            picture.radiance[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
                             static_cast<std::size_t>(column)];
      }
    }
  }

  int width() const { return width_; }
  int height() const { return height_; }

  // Pixel centres are at whole numbers; x is in [-1, width], y in [-1, height].
  glm::vec3 bilinear(float x, float y) const {
    const int column = static_cast<int>(x + 1) - 1, row = static_cast<int>(y + 1) - 1;
    const float s = x - static_cast<float>(column), t = y - static_cast<float>(row);
    const glm::vec3* above = &texels_[index(column, row)];
    const glm::vec3* below = above + width_ + 2;
    return (1 - t) * ((1 - s) * above[0] + s * above[1]) + t * ((1 - s) * below[0] + s * below[1]);
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y + 1) * static_cast<std::size_t>(width_ + 2) +
           static_cast<std::size_t>(x + 1);
  }

  int width_, height_;
  std::vector<glm::vec3> texels_;
};

// Averages the source over texels. The directions inside a texel lie on a regular grid of the
// octahedral square, where azimuth and elevation have closed forms (Clarberg 2008): with a = |u|, b
// = |v|, d = 1 - a - b and r = 1 - |d|, sin(elevation) = sign(d) (1 - r^2) depends on a + b alone
// and is tabulated, and the azimuth within its quadrant is ((b - a) / r + 1) pi / 4.
class TexelMeans {
 public:
  TexelMeans(const Panorama& source, int size, int samples_a_side, double rotation_rad)
      : source_(source), size_(size), samples_a_side_(samples_a_side) {
    const int grid = size * samples_a_side;
    const double height = source.height();
    rows_.resize(static_cast<std::size_t>(grid) + 1);
    radii_.resize(rows_.size());
    for (int m = 0; m <= grid; ++m) {
      const double d = 1 - 2.0 * m / grid;
      const double r = 1 - std::abs(d);
      const double from_pole = 2 * std::asin(r * std::numbers::sqrt2 / 2);
      const double polar = d < 0 ? pi - from_pole : from_pole;
      rows_[static_cast<std::size_t>(m)] =
          static_cast<float>(std::clamp(height * polar / pi - 0.5, -0.5, height - 0.5));
      radii_[static_cast<std::size_t>(m)] = static_cast<float>(r);
    }
    quadrant_ = static_cast<float>(source.width()) / 4;
    const double turns = 0.5 + rotation_rad / (2 * pi);
    start_ = static_cast<float>((turns - std::floor(turns)) * source.width());
  }

  glm::vec3 mean(int i, int j) const {
    glm::vec3 sum(0);
    for (int l = 0; l < samples_a_side_; ++l)
      for (int k = 0; k < samples_a_side_; ++k)
        sum += sample(i * samples_a_side_ + k, j * samples_a_side_ + l);
    return sum / static_cast<float>(samples_a_side_ * samples_a_side_);
  }

 private:
  glm::vec3 sample(int k, int l) const {
    const int grid = size_ * samples_a_side_;
    const int u = 2 * k + 1 - grid, v = 2 * l + 1 - grid;  // in [-grid, grid]
    const int a = std::abs(u), b = std::abs(v);
    const auto m = static_cast<std::size_t>((a + b) / 2);
    const float inside =  // the quadrant, from the x axis to the y axis
        0.5f * (static_cast<float>(b - a) / (radii_[m] * static_cast<float>(grid)) + 1);
    float quadrants = u < 0 ? 2 - inside : inside;
    if (v < 0) quadrants = -quadrants;
    float x = start_ - quadrants * quadrant_;
    const float width = static_cast<float>(source_.width());
    if (x < 0) x += width;
    if (x >= width) x -= width;
    return source_.bilinear(x - 0.5f, rows_[m]);
  }

  const Panorama& source_;
  int size_, samples_a_side_;
  std::vector<float> rows_, radii_;  // indexed by (a + b) / 2
  float quadrant_ = 0, start_ = 0;   // pixels: width of a quadrant; position of world azimuth 0
};

// Averages a cube over texels, by directions on the grid of TexelMeans.
class CubeTexelMeans {
 public:
  CubeTexelMeans(const Cube& source, int size, int samples_a_side, double rotation_rad)
      : source_(source),
        samples_a_side_(samples_a_side),
        step_(2.0f / static_cast<float>(size * samples_a_side)),
        cosine_(static_cast<float>(std::cos(rotation_rad))),
        sine_(static_cast<float>(std::sin(rotation_rad))) {}

  glm::vec3 mean(int i, int j) const {
    glm::vec3 sum(0);
    for (int l = 0; l < samples_a_side_; ++l)
      for (int k = 0; k < samples_a_side_; ++k) {
        const glm::vec3 d = octahedral_direction(
            {(static_cast<float>(i * samples_a_side_ + k) + 0.5f) * step_ - 1,
             (static_cast<float>(j * samples_a_side_ + l) + 0.5f) * step_ - 1});
        sum += source_.towards({cosine_ * d.x + sine_ * d.y, cosine_ * d.y - sine_ * d.x, d.z});
      }
    return sum / static_cast<float>(samples_a_side_ * samples_a_side_);
  }

 private:
  const Cube& source_;
  int samples_a_side_;
  float step_, cosine_, sine_;
};

// Returns whether the picture's left half shows nearly what its right one does, or its upper half
// what the lower one does, as the two views of a stereo picture do: by the means of 16x8 blocks.
bool has_like_halves(const LinearPicture& picture, bool beside) {
  const int width = beside ? picture.width / 2 : picture.width;
  const int height = beside ? picture.height : picture.height / 2;
  const auto blocks_at = [&](int left, int top) {
    LinearPicture half{width, height, {}};
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) half.radiance.push_back(picture.at(left + x, top + y));
    std::vector<float> blocks;
    for (const glm::vec3& mean :
         reduced(half, std::min(width, 16), std::min(height, 8), [](int, int) {
           return 1.0;
         }).radiance) {
      const float light = mean.r + mean.g + mean.b;
      blocks.push_back(std::isfinite(light) ? light : 0);
    }
    return blocks;
  };
  const std::vector<float> one = blocks_at(0, 0);
  const std::vector<float> other = blocks_at(beside ? width : 0, beside ? 0 : height);
  std::vector<float> sorted = one;
  std::ranges::sort(sorted);
  const float median = std::max(sorted[sorted.size() / 2], 1e-20f);
  // A lamp in one block does not outweigh the others.
  const auto seen = [&](float value) { return value / (std::abs(value) + median); };
  // The other eye sees near things elsewhere, by a block at most.
  float difference = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    float least = std::abs(seen(one[i]) - seen(other[i]));
    for (const std::size_t j : {i - 1, i + 1})
      if (j < other.size()) least = std::min(least, std::abs(seen(one[i]) - seen(other[j])));
    difference += least;
  }
  constexpr float most_difference = 0.06f;
  return difference < most_difference * static_cast<float>(one.size());
}

// Returns whether the picture is as its pixels' aspect makes it twice as wide as high.
bool is_latitude_longitude(const LinearPicture& picture) {
  const double width = static_cast<double>(picture.width) * picture.pixel_aspect;
  return picture.width == 2 * std::int64_t{picture.height} ||
         std::abs(width - 2.0 * picture.height) < 0.6 * std::max(1.0f, picture.pixel_aspect);
}

std::string shape_words(const LinearPicture& picture) {
  const std::int64_t width = picture.width, height = picture.height;
  const auto of_file = [&](double side) { return std::lround(side * picture.pixels_of_file); };
  const bool is_beside = width == 4 * height, is_above = width == height;
  if ((is_beside || (is_above && height > 1)) && has_like_halves(picture, is_beside))
    return fmt::format(
        ". It looks like a stereo picture, two views {} each other; use one of them: oiiotool IN "
        "--cut {}x{}+0+0 -o OUT.exr",
        is_beside ? "beside" : "above", of_file(is_beside ? 0.5 * picture.width : picture.width),
        of_file(is_beside ? picture.height : 0.5 * picture.height));
  if (is_above)
    return ". A square may be a mirror ball, an angular map or a fisheye; convert it to "
           "latitude-longitude: HDRShop converts mirror balls and angular maps (light probes), and "
           "Hugin a fisheye (projection: equirectangular)";
  if (width == 6 * height || height == 6 * width)
    return ". This looks like a strip of six cube faces, whose order differs from program to "
           "program; convert it to latitude-longitude or to a cube cross, by cmft for example";
  return ", and a cube cross has 3:4 or 4:3; export the whole picture in one of these shapes";
}

// Returns the cross that the picture is, or null for a latitude-longitude picture. Throws
// previz::Error for what is neither.
const CubeCross* known_cross(const std::filesystem::path& path, const LinearPicture& picture) {
  if (is_latitude_longitude(picture)) return nullptr;
  const CubeCross* cross = cross_of(picture);
  if (cross != nullptr && is_bare_beside(*cross, picture)) return cross;
  throw Error(fmt::format(
      "{}: the picture has {}x{} pixels; a latitude-longitude environment is twice as wide as "
      "high{}",
      path.string(), std::lround(picture.width * picture.pixels_of_file),
      std::lround(picture.height * picture.pixels_of_file),
      cross != nullptr ? ", and a cube cross, which has this shape, has nothing but one colour in "
                         "its corners: this is neither"
                       : shape_words(picture)));
}

// An environment covers the sphere whatever its pixels' aspect is.
void note_aspect(const std::filesystem::path& path, const LinearPicture& picture, bool is_cross,
                 std::vector<std::string>& notes) {
  const bool is_square = is_cross || picture.width == 2 * std::int64_t{picture.height};
  if (std::abs(picture.pixel_aspect - 1) > 1e-3f)
    notes.push_back(fmt::format(
        "{}: has {}x{} pixels that are {:.4g} times as wide as high; it is {}", path.string(),
        picture.width, picture.height, picture.pixel_aspect,
        is_square ? "used as if they were square" : "stretched to be twice as wide as high"));
}

// A map that is this many times as coarse as the picture is made of a coarser picture, which has
// coarse_pixels a texel: the samples would be too many otherwise. A map whose size is chosen by the
// picture never is.
constexpr double most_pixels_a_texel = 16, coarse_pixels = 8;

// Returns whether the picture was reduced.
bool reduce_for(LinearPicture& picture, const CubeCross* cross, double pixels_a_texel) {
  if (pixels_a_texel < most_pixels_a_texel) return false;
  const int rows = cross ? cross->rows : 1, columns = cross ? cross->columns : 2;
  const int fine = picture.height / rows;
  const int coarse = static_cast<int>(std::ceil(fine * coarse_pixels / pixels_a_texel));
  std::vector<double> row_weights;
  for (int y = 0; y < picture.height; ++y)
    row_weights.push_back(std::cos(pi * (0.5 - (y + 0.5) / picture.height)));
  const auto on_sphere = [&](int, int y) { return row_weights[static_cast<std::size_t>(y)]; };
  const auto on_cube = [&](int x, int y) {
    const double s = (2 * (x % fine) + 1.0) / fine - 1, t = (2 * (y % fine) + 1.0) / fine - 1;
    const double square = 1 + s * s + t * t;
    return 1 / (square * std::sqrt(square));
  };
  picture = cross ? reduced(picture, columns * coarse, rows * coarse, on_cube)
                  : reduced(picture, columns * coarse, rows * coarse, on_sphere);
  return true;
}

// Throws previz::Error where the gain makes light that the renderer cannot sum.
void check_brightness(const set::Lighting& settings, const EnvironmentMap& map) {
  for (const glm::vec3& radiance : map.radiance)
    for (int c = 0; c < 3; ++c)
      if (!(radiance[c] <= most_radiance))
        throw Error(
            fmt::format("lighting.environment_gain: with {:g}, {} is brighter than {:g} somewhere, "
                        "beyond which "
                        "light cannot be summed; make the gain smaller",
                        settings.environment_gain, settings.environment->string(), most_radiance));
}

template <typename Means>
EnvironmentMap map_of(const Means& means, int size, const glm::vec3& gain) {
  EnvironmentMap map{size, {}};
  map.radiance.resize(static_cast<std::size_t>(size) * static_cast<std::size_t>(size));
  parallel_blocks(size, [&](int begin, int end) {
    for (int j = begin; j < end; ++j)
      for (int i = 0; i < size; ++i)
        map.radiance[static_cast<std::size_t>(j) * static_cast<std::size_t>(size) +
                     static_cast<std::size_t>(i)] = gain * means.mean(i, j);
  });
  return map;
}

}  // namespace

Lighting load_environment(const set::Lighting& settings) {
  if (!settings.environment) throw Error("lighting.environment: no file is given");
  const std::filesystem::path& path = *settings.environment;
  Lighting lighting;
  std::vector<std::string>& notes = lighting.report.notes;
  LinearPicture picture = read_linear_picture(path, notes);
  const CubeCross* cross = known_cross(path, picture);
  note_aspect(path, picture, cross != nullptr, notes);
  const int face_pixels = cross ? picture.height / cross->rows : 0;
  repair(picture,
         {.wraps = cross == nullptr,
          .uses =
              [&](int x, int y) {
                return cross == nullptr ||
                       cross->face_at(x / face_pixels, y / face_pixels) != nullptr;
              }},
         path, notes);
  if (cross)
    notes.push_back(fmt::format("{}: read as a {} cube cross, with +X in the middle face",
                                path.string(), cross->rows == 4 ? "vertical" : "horizontal"));

  // Radians a pixel: on the equator, or the mean of the cube's.
  const auto radians_a_pixel = [&] {
    return cross ? std::sqrt(4 * pi / 6) * cross->rows / picture.height
                 : std::min(2 * pi / picture.width, pi / picture.height);
  };
  double pixel_rad = radians_a_pixel();
  const int size = chosen_resolution(settings.resolution, pixel_rad * pixel_rad);
  if (reduce_for(picture, cross, std::sqrt(texel_sr(size)) / pixel_rad))
    pixel_rad = radians_a_pixel();
  const int samples_a_side =
      std::max(4, static_cast<int>(std::ceil(4 * std::sqrt(texel_sr(size)) / pixel_rad)));
  const glm::vec3 gain(settings.environment_gain * settings.balance);
  const double turn_rad = settings.environment_rotation_rad;
  if (cross) {
    const Cube source(*cross, picture);
    lighting.environment =
        map_of(CubeTexelMeans(source, size, samples_a_side, turn_rad), size, gain);
  } else {
    const Panorama source(picture);
    lighting.environment = map_of(TexelMeans(source, size, samples_a_side, turn_rad), size, gain);
  }
  check_brightness(settings, lighting.environment);
  lighting.report.seen_sr = 4 * pi;
  return lighting;
}

}  // namespace previz::lighting
