#include "tests/truth/comparison_sheet.hpp"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>
namespace previz::truth {
namespace {

constexpr int caption_px = 22;

cv::Mat to_mat(const Plate& plate) {
  cv::Mat mat(plate.height, plate.width, CV_8UC3);
  std::transform(plate.samples.begin(), plate.samples.end(), mat.ptr<std::uint8_t>(),
                 [](std::uint16_t sample) { return static_cast<std::uint8_t>(sample); });
  return mat;
}

}  // namespace

Plate comparison_sheet(const TruthFrame& truth, const EstimatedFrame& estimate) {
  const auto shown = [&](const std::vector<glm::vec3>& radiance) {
    return displayed(radiance, truth.width, truth.height, truth.exposure, truth.response);
  };
  const Plate ideal = shown(ideal_composite(truth));
  Plate difference = ideal;
  for (std::size_t i = 0; i < ideal.samples.size(); ++i) {
    const int d = static_cast<int>(estimate.picture.samples[i]) - ideal.samples[i];
    difference.samples[i] = static_cast<std::uint16_t>(std::clamp(128 + 5 * d, 0, 255));
  }
  const std::array<std::pair<const char*, Plate>, 4> panels = {
      std::pair{"plate", shown(truth.plate)},
      {"composite", estimate.picture},
      {"truth", ideal},
      {"5 x (composite - truth)", difference}};
  cv::Mat sheet(truth.height + caption_px, truth.width * 4, CV_8UC3, cv::Scalar(24, 24, 24));
  for (int i = 0; i < 4; ++i) {
    const auto& [name, plate] = panels[static_cast<std::size_t>(i)];
    to_mat(plate).copyTo(sheet(cv::Rect(i * truth.width, caption_px, truth.width, truth.height)));
    cv::putText(sheet, name, {i * truth.width + 6, caption_px - 7}, cv::FONT_HERSHEY_SIMPLEX, 0.45,
                cv::Scalar(230, 230, 230), 1, cv::LINE_AA);
  }
  Plate out;
  out.width = sheet.cols;
  out.height = sheet.rows;
  out.bits = 8;
  out.samples.assign(sheet.datastart, sheet.dataend);
  return out;
}

}  // namespace previz::truth
