// The merge on real exposures: sixteen film scans of Memorial Church, a stop apart, against the
// radiance map that Debevec published of them (SIGGRAPH 97).
#include <opencv2/imgcodecs.hpp>
#include <opencv2/photo.hpp>

#include "tests/support/lighting.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/shared_data.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::memorial_test {

struct Memorial {
  std::vector<cv::Mat> pictures;  // 8-bit BGR
  std::vector<float> times_s;
  cv::Mat reference;  // float BGR
};

Memorial load_memorial(const std::filesystem::path& directory) {
  Memorial memorial;
  std::ifstream list(directory / "exposures.txt");
  for (std::string line; std::getline(list, line);) {
    std::istringstream words(line);
    std::string name;
    float time_s = 0;
    if (line.starts_with('#') || !(words >> name >> time_s)) continue;
    memorial.pictures.push_back(cv::imread((directory / name).string()));
    memorial.times_s.push_back(time_s);
  }
  memorial.reference =
      cv::imread((directory / "memorial_reference.hdr").string(), cv::IMREAD_UNCHANGED);
  return memorial;
}

// Robertson's curve of one channel as a table; the ends, which no picture shows well, made to rise.
ResponseCurve channel_response(const cv::Mat& robertson, int bgr) {
  ResponseCurve response{.kind = ResponseCurve::Kind::table, .inverse_table = {}, .clip_share = 1};
  double last = 0;
  for (int code = 0; code < 256; ++code) {
    const double signal = robertson.at<cv::Vec3f>(code)[bgr];
    const double least = last * (1 + 1e-3) + 1e-6;
    last = code == 0 ? 0 : std::isfinite(signal) ? std::max(signal, least) : least;
    response.inverse_table.push_back(last);
  }
  for (double& signal : response.inverse_table) signal /= last;
  return response;
}

std::vector<FramePtr> frames_of(const Memorial& memorial) {
  std::vector<FramePtr> frames;
  for (std::size_t i = 0; i < memorial.pictures.size(); ++i) {
    std::vector<std::uint8_t> codes;
    for (const cv::Vec3b& bgr : cv::Mat3b(memorial.pictures[i]))
      codes.insert(codes.end(), {bgr[2], bgr[1], bgr[0]});
    frames.push_back(test::rgb8_frame(memorial.pictures[i].cols, memorial.times_s[i], codes, i));
  }
  return frames;
}

// |log2 ratio| to the reference after one factor, the median of the ratios; invalid pixels (pure
// blue in the scans: the frame around the film) left out.
std::vector<double> stops_off(const Memorial& memorial, const HdrPicture& merged, int rgb) {
  std::vector<double> ratios;
  for (int y = 0; y < merged.height; ++y)
    for (int x = 0; x < merged.width; ++x) {
      const auto p = static_cast<std::size_t>(y * merged.width + x);
      if (memorial.pictures.front().at<cv::Vec3b>(y, x) == cv::Vec3b(255, 0, 0)) continue;
      const double truth = memorial.reference.at<cv::Vec3f>(y, x)[2 - rgb];
      if (truth > 0 && merged.radiance[p][rgb] > 0)
        ratios.push_back(std::log2(merged.radiance[p][rgb] / truth));
    }
  std::vector<double> sorted = ratios;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                   sorted.end());
  const double factor = sorted[sorted.size() / 2];
  for (double& ratio : ratios) ratio = std::abs(ratio - factor);
  return ratios;
}

double quantile_of(std::vector<double>& values, double q) {
  const auto place = static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, values.begin() + place);
  return values[static_cast<std::size_t>(place)];
}

TEST(MergeExposures, MatchesThePublishedMapOfRealExposures) {
  const std::filesystem::path directory = test::shared_data("real/hdr/memorial");
  PREVIZ_NEEDS(directory);
  const Memorial memorial = load_memorial(directory);
  ASSERT_EQ(memorial.pictures.size(), 16u);
  cv::Mat robertson;
  cv::createCalibrateRobertson()->process(memorial.pictures, robertson, memorial.times_s);

  const std::vector<FramePtr> frames = frames_of(memorial);
  std::vector<double> all;
  for (int rgb = 0; rgb < 3; ++rgb) {
    // A film has a curve a channel.
    const HdrPicture merged = merge_exposures(frames, channel_response(robertson, 2 - rgb));
    const std::vector<double> off = stops_off(memorial, merged, rgb);
    all.insert(all.end(), off.begin(), off.end());
  }
  const double median = quantile_of(all, 0.5), p90 = quantile_of(all, 0.9);
  std::printf("memorial: median %.3f, 90th percentile %.3f stops\n", median, p90);
  EXPECT_LT(median, 0.08);
  EXPECT_LT(p90, 0.25);
}

}  // namespace previz::lighting::memorial_test
