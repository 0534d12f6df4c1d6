#include "daemon/tools/exchange/orientation.hpp"

#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

namespace previz::exchange {
namespace {

int type_of(PixelFormat format) {
  switch (format) {
    case PixelFormat::gray8:
      return CV_8UC1;
    case PixelFormat::gray16:
      return CV_16UC1;
    case PixelFormat::rgb8:
      return CV_8UC3;
    case PixelFormat::rgb16:
      return CV_16UC3;
    default:
      throw Error(std::string(to_string(format)) + ": only grey and RGB pictures can be turned");
  }
}

cv::Mat samples_of(Picture& picture) {
  return {picture.height, picture.width, type_of(picture.format), picture.bytes.data()};
}

void replace(Picture& picture, const cv::Mat& samples) {
  picture.width = samples.cols;
  picture.height = samples.rows;
  picture.bytes.assign(samples.datastart, samples.dataend);
}

}  // namespace

std::string Orientation::words() const {
  if (is_upright()) return "upright";
  if (*this == Orientation{-1, 0, 0, -1}) return "turned by 180 degrees";
  if (*this == Orientation{0, -1, 1, 0}) return "turned by 90 degrees clockwise";
  if (*this == Orientation{0, 1, -1, 0}) return "turned by 90 degrees anticlockwise";
  if (*this == Orientation{-1, 0, 0, 1}) return "mirrored left to right";
  if (*this == Orientation{1, 0, 0, -1}) return "mirrored top to bottom";
  if (*this == Orientation{0, 1, 1, 0}) return "mirrored along the diagonal from the top left";
  return "mirrored along the diagonal from the top right";
}

std::optional<Orientation> exif_orientation(int number) {
  // Exif 2.32, 4.6.4 A: where the first row and the first column of the samples are to be seen.
  switch (number) {
    case 1:
      return Orientation{};
    case 2:
      return Orientation{-1, 0, 0, 1};
    case 3:
      return Orientation{-1, 0, 0, -1};
    case 4:
      return Orientation{1, 0, 0, -1};
    case 5:
      return Orientation{0, 1, 1, 0};
    case 6:
      return Orientation{0, -1, 1, 0};
    case 7:
      return Orientation{0, -1, -1, 0};
    case 8:
      return Orientation{0, 1, -1, 0};
    default:
      return std::nullopt;
  }
}

std::optional<Orientation> display_orientation(const std::array<std::int32_t, 9>& matrix) {
  // x' = a x + c y, y' = b x + d y, with the rows (a, b), (c, d) of libavutil/display.h.
  const std::array<std::int64_t, 4> m = {matrix[0], matrix[3], matrix[1], matrix[4]};
  std::int64_t most = 0;
  for (const std::int64_t value : m) most = std::max(most, std::abs(value));
  std::array<int, 4> signs{};
  for (std::size_t i = 0; i < m.size(); ++i) {
    const double share = most == 0 ? 0 : static_cast<double>(m[i]) / static_cast<double>(most);
    signs[i] = static_cast<int>(std::lround(share));
    if (std::abs(share - signs[i]) > 0.01) return std::nullopt;
  }
  const auto [xx, xy, yx, yy] = signs;
  if (std::abs(xx * yy - xy * yx) != 1) return std::nullopt;
  return Orientation{xx, xy, yx, yy};
}

void turn(Picture& picture, const Orientation& orientation) {
  if (orientation.is_upright()) return;
  cv::Mat turned = samples_of(picture).clone();
  if (orientation.xx == 0) turned = cv::Mat(turned.t());
  const bool from_right = orientation.xx + orientation.xy < 0;
  const bool from_below = orientation.yx + orientation.yy < 0;
  if (from_right || from_below)
    cv::flip(turned, turned, from_right && from_below ? -1 : from_right ? 1 : 0);
  replace(picture, turned);
}

void make_square(Picture& picture, int wide, int high) {
  if (wide == high) return;
  const double ratio = static_cast<double>(wide) / high;
  const int width =
      ratio > 1 ? static_cast<int>(std::lround(picture.width * ratio)) : picture.width;
  const int height =
      ratio < 1 ? static_cast<int>(std::lround(picture.height / ratio)) : picture.height;
  if (static_cast<double>(width) * height > static_cast<double>(most_pixels))
    throw Error(picture.name + ": would be " + std::to_string(width) + "x" +
                std::to_string(height) + " with square pixels, which is too large");
  cv::Mat square;
  cv::resize(samples_of(picture), square, {width, height}, 0, 0, cv::INTER_CUBIC);
  replace(picture, square);
}

}  // namespace previz::exchange
