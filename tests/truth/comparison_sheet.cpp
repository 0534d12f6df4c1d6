#include "tests/truth/comparison_sheet.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "drivers/plate.hpp"

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

Plate sheet(const std::vector<std::vector<Panel>>& rows) {
  const int width = rows.front().front().picture.width;
  const int height = rows.front().front().picture.height;
  const int row_height = height + caption_px;
  cv::Mat mat(row_height * static_cast<int>(rows.size()),
              width * static_cast<int>(rows.front().size()), CV_8UC3, cv::Scalar(24, 24, 24));
  for (std::size_t row = 0; row < rows.size(); ++row) {
    const int y = row_height * static_cast<int>(row);
    for (std::size_t column = 0; column < rows[row].size(); ++column) {
      const int x = width * static_cast<int>(column);
      const Panel& panel = rows[row][column];
      to_mat(panel.picture).copyTo(mat(cv::Rect(x, y + caption_px, width, height)));
      cv::putText(mat, panel.caption, {x + 6, y + caption_px - 7}, cv::FONT_HERSHEY_SIMPLEX, 0.45,
                  cv::Scalar(230, 230, 230), 1, cv::LINE_AA);
    }
  }
  Plate out;
  out.width = mat.cols;
  out.height = mat.rows;
  out.bits = 8;
  out.samples.assign(mat.datastart, mat.dataend);
  return out;
}

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
  return sheet({{{"plate", shown(truth.plate)},
                 {"composite", estimate.picture},
                 {"truth", ideal},
                 {"5 x (composite - truth)", difference}}});
}

}  // namespace previz::truth
