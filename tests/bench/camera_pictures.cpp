#include "tests/bench/camera_pictures.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "daemon/core/session/session.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::bench {
namespace {

// Returns the pictures in levels of 0 to 255, three floats a pixel.
std::vector<cv::Mat> enlarged(const std::filesystem::path& directory, int width, int height) {
  session::Session session = session::open_session(directory);
  const auto stream = session::open_stream(session, "observer");
  if (!stream || stream->records().empty())
    throw Error(directory.string() + ": holds no frame of the film camera");
  std::vector<cv::Mat> pictures;
  for (std::size_t i = 0; i < stream->records().size(); ++i) {
    const Plate plate = to_plate(*stream->read(i));
    cv::Mat samples(plate.height, plate.width, CV_16UC3), levels, large;
    std::ranges::copy(plate.samples, samples.ptr<std::uint16_t>());
    samples.convertTo(levels, CV_32FC3, 255.0 / ((1 << plate.bits) - 1));
    cv::resize(levels, large, cv::Size(width, height), 0, 0, cv::INTER_CUBIC);
    pictures.push_back(large);
  }
  return pictures;
}

class Sensor {
 public:
  // Adds noise to a level of 0 to 255.
  double read(double level) {
    const double light = std::clamp(level, 0.0, 255.0);
    return std::clamp(light + std::sqrt(1 + 0.01 * light) * noise_(random_), 0.0, 255.0);
  }
  std::uint8_t read_8(double level) { return static_cast<std::uint8_t>(std::lround(read(level))); }

 private:
  std::minstd_rand random_{1};
  std::normal_distribution<double> noise_;
};

double luma(const cv::Vec3f& rgb) {
  return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];  // ITU-R BT.709-6
}

std::vector<std::uint8_t> yuv422(const cv::Mat_<cv::Vec3f>& picture, Sensor& sensor) {
  std::vector<std::uint8_t> bytes, cb, cr;
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const cv::Vec3f& rgb = picture(y, x);
      const double y709 = luma(rgb);
      bytes.push_back(sensor.read_8(16 + 219.0 / 255 * y709));
      if (x % 2 != 0) continue;
      cb.push_back(sensor.read_8(128 + 224.0 / 255 * (rgb[2] - y709) / 1.8556));
      cr.push_back(sensor.read_8(128 + 224.0 / 255 * (rgb[0] - y709) / 1.5748));
    }
  }
  bytes.insert(bytes.end(), cb.begin(), cb.end());
  bytes.insert(bytes.end(), cr.begin(), cr.end());
  return bytes;
}

std::vector<std::uint8_t> gray(const cv::Mat_<cv::Vec3f>& picture, Sensor& sensor) {
  std::vector<std::uint8_t> bytes;
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const cv::Vec3f& rgb = picture(y, x);
      // RGGB, as the sensor counts: green, or red and blue on the diagonal.
      const float mosaic = rgb[(y + x) % 2 == 1 ? 1 : (y % 2 == 0 ? 0 : 2)];
      bytes.push_back(sensor.read_8(mosaic));
    }
  }
  return bytes;
}

}  // namespace

std::vector<FramePtr> camera_pictures(const std::filesystem::path& session, PixelFormat format,
                                      int width, int height, int count) {
  const std::vector<cv::Mat> pictures = enlarged(session, width, height);
  Sensor sensor;
  std::vector<FramePtr> frames;
  for (int i = 0; i < count; ++i) {
    auto frame = std::make_shared<Frame>();
    frame->source = "observer";
    frame->format = format;
    frame->width = width;
    frame->height = height;
    const cv::Mat& picture = pictures[static_cast<std::size_t>(i) % pictures.size()];
    if (format == PixelFormat::gray8) {
      frame->bayer = BayerPattern::rggb;
      frame->bytes = gray(picture, sensor);
    } else {
      frame->bytes = yuv422(picture, sensor);
    }
    frames.push_back(std::move(frame));
  }
  return frames;
}

}  // namespace previz::bench
