#include "tests/truth/comparison_sheet.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "drivers/plate.hpp"

namespace previz::truth {
namespace {

constexpr int caption_px = 22;

// A picture of 8 bits with its name above it.
cv::Mat panel(const char* caption, const Plate& plate) {
  cv::Mat mat(caption_px + plate.height, plate.width, CV_8UC3, cv::Scalar(24, 24, 24));
  std::ranges::copy(plate.samples, mat.ptr(caption_px));
  cv::putText(mat, caption, {6, caption_px - 7}, cv::FONT_HERSHEY_SIMPLEX, 0.45,
              cv::Scalar(230, 230, 230), 1, cv::LINE_AA);
  return mat;
}

}  // namespace

Plate comparison_sheet(const TruthFrame& truth, const EstimatedFrame& estimate) {
  const auto shown = [&](std::span<const glm::vec3> radiance) {
    return displayed(radiance, truth.width, truth.height, truth.exposure, truth.response);
  };
  const Plate ideal = shown(ideal_composite(truth));
  Plate difference = ideal;
  for (std::size_t i = 0; i < ideal.samples.size(); ++i) {
    const int d = static_cast<int>(estimate.picture.samples[i]) - ideal.samples[i];
    difference.samples[i] = static_cast<std::uint16_t>(std::clamp(128 + 5 * d, 0, 255));
  }
  cv::Mat row;
  cv::hconcat(
      std::vector<cv::Mat>{panel("plate", shown(truth.plate)), panel("composite", estimate.picture),
                           panel("truth", ideal), panel("5 x (composite - truth)", difference)},
      row);
  return {row.cols, row.rows, 8, {row.datastart, row.dataend}};
}

}  // namespace previz::truth
