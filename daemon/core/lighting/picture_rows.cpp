#include "daemon/core/lighting/picture_rows.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numeric>
#include <utility>

#include "daemon/core/lighting/picture_repair.hpp"
#include "drivers/error.hpp"

namespace previz::lighting {
namespace {

// Returns how many times the greatest common measure of the sides fits into the smaller picture.
int measures(std::int64_t width, std::int64_t height, std::int64_t most) {
  const std::int64_t measure = std::gcd(width, height);
  const std::int64_t across = width / measure, down = height / measure;
  const double of_one = static_cast<double>(across * down);
  const auto fitting =
      static_cast<std::int64_t>(std::sqrt(static_cast<double>(most) / of_one) * (1 + 1e-12));
  if (fitting < 1) return 0;
  const std::int64_t pixels_for_one = (measure + fitting - 1) / fitting;
  return static_cast<int>(measure / pixels_for_one);
}

}  // namespace

PictureRows::PictureRows(const std::filesystem::path& path, int width, int height,
                         std::int64_t most_kept)
    : path_(path), width_(width), height_(height), picture_{width, height, {}} {
  if (std::int64_t{width} * height > most_kept) {
    const int count = measures(width, height, most_kept);
    const int measure = std::gcd(width, height);
    if (count == 0)
      throw Error(fmt::format(
          "{}: has {}x{} pixels; allowed: at most {}, or sides that both have a smaller one of the "
          "same shape; make it smaller: oiiotool IN --resize 16384x8192 -o OUT.exr",
          path.string(), width, height, most_kept));
    picture_.width = width / measure * count;
    picture_.height = height / measure * count;
    picture_.pixels_of_file = static_cast<double>(measure) / count;
    average_.emplace(width, height, picture_.width, picture_.height);
  }
  reserve_pixels(picture_, std::filesystem::file_size(path));
}

void PictureRows::append(std::span<const glm::vec3> row) {
  const auto keep = [this](auto pixels) {
    picture_.radiance.insert(picture_.radiance.end(), pixels.begin(), pixels.end());
  };
  if (!average_) return keep(row);
  const auto finite = [&](int x) {
    glm::dvec3 light(row[static_cast<std::size_t>(x)]);
    for (int c = 0; c < 3; ++c)
      if (std::isinf(light[c]) && light[c] > 0) {
        light[c] = largest_half;
        ++overflowed_;
      }
    return light;
  };
  average_->add(finite, keep);
}

LinearPicture PictureRows::picture(std::vector<std::string>& notes) && {
  if (average_)
    notes.push_back(fmt::format(
        "{}: has {}x{} pixels, which are read as {}x{} by their means{}; light needs no more",
        path_.string(), width_, height_, picture_.width, picture_.height,
        overflowed_ == 0
            ? std::string()
            : fmt::format(" ({} values of +Inf count as {})", overflowed_, largest_half)));
  return std::move(picture_);
}

}  // namespace previz::lighting
