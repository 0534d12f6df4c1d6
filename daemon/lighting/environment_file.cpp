// Implements load_environment: resamples a latitude-longitude picture to an octahedral map.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "daemon/lighting/exr_picture.hpp"
#include "daemon/lighting/lighting.hpp"
#include "daemon/lighting/parallel.hpp"
#include "drivers/error.hpp"

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

// Sets values that are no radiance to 0; returns the number of such pixels.
std::size_t drop_impossible(LinearPicture& picture) {
  std::size_t dropped = 0;
  for (glm::vec3& radiance : picture.radiance) {
    bool impossible = false;
    for (int c = 0; c < 3; ++c) {
      if (std::isfinite(radiance[c]) && radiance[c] >= 0) continue;
      radiance[c] = 0;
      impossible = true;
    }
    dropped += impossible;
  }
  return dropped;
}

}  // namespace

Lighting load_environment(const set::Lighting& settings) {
  if (!settings.environment) throw Error("lighting.environment: no file is given");
  const std::filesystem::path& path = *settings.environment;
  Lighting lighting;
  LinearPicture picture = read_exr_picture(path, lighting.report.notes);
  if (picture.width != 2 * picture.height)
    throw Error(
        fmt::format("{}: the picture has {}x{} pixels; a latitude-longitude environment is "
                    "twice as wide as high",
                    path.string(), picture.width, picture.height));
  if (const std::size_t dropped = drop_impossible(picture); dropped > 0)
    lighting.report.notes.push_back(
        fmt::format("{}: {} of {} pixels hold negative or non-finite values, taken as 0",
                    path.string(), dropped, picture.radiance.size()));

  const double pixel_rad = 2 * pi / picture.width;
  const int size = chosen_resolution(settings.resolution, pixel_rad * pixel_rad);
  const int samples_a_side =
      std::max(4, static_cast<int>(std::ceil(4 * std::sqrt(texel_sr(size)) / pixel_rad)));
  const Panorama source(picture);
  const TexelMeans means(source, size, samples_a_side, settings.environment_rotation_rad);
  const auto gain = static_cast<float>(settings.environment_gain);
  EnvironmentMap& map = lighting.environment;
  map.size = size;
  map.radiance.resize(static_cast<std::size_t>(size) * static_cast<std::size_t>(size));
  parallel_blocks(size, [&](int begin, int end) {
    for (int j = begin; j < end; ++j)
      for (int i = 0; i < size; ++i)
        map.radiance[static_cast<std::size_t>(j) * static_cast<std::size_t>(size) +
                     static_cast<std::size_t>(i)] = gain * means.mean(i, j);
  });
  lighting.report.seen_sr = 4 * pi;
  return lighting;
}

}  // namespace previz::lighting
