#include "tests/support/lighting_pictures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "drivers/calibration/fisheye.hpp"

namespace previz::test {

using std::numbers::pi;

FramePtr make_frame(int width, int height, double exposure,
                    const std::vector<glm::dvec3>& signals) {
  Frame frame;
  frame.source = "light";
  frame.exposure = exposure;
  frame.format = PixelFormat::rgb16;
  frame.width = width;
  frame.height = height;
  frame.bytes.reserve(6 * signals.size());
  for (const glm::dvec3& signal : signals) {
    for (int c = 0; c < 3; ++c) {
      const auto code =
          static_cast<std::uint16_t>(std::floor(65535 * std::clamp(signal[c], 0.0, 1.0) + 0.5));
      frame.bytes.push_back(static_cast<std::uint8_t>(code & 0xff));
      frame.bytes.push_back(static_cast<std::uint8_t>(code >> 8));
    }
  }
  return std::make_shared<Frame>(std::move(frame));
}

FramePtr make_frame(int width, int height, double exposure,
                    const std::function<glm::dvec3(int x, int y)>& signal_at) {
  std::vector<glm::dvec3> signals;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) signals.push_back(signal_at(x, y));
  return make_frame(width, height, exposure, signals);
}

FramePtr rgb8_frame(int width, double exposure, std::vector<std::uint8_t> codes,
                    std::uint64_t sequence) {
  Frame frame;
  frame.source = "light";
  frame.sequence = sequence;
  frame.exposure = exposure;
  frame.width = width;
  frame.height = static_cast<int>(codes.size()) / 3 / width;
  frame.bytes = std::move(codes);
  return std::make_shared<Frame>(std::move(frame));
}

LightCameraCalibration fisheye_camera(int size, const glm::dmat4& world_from_camera) {
  LightCameraCalibration camera;
  const double focal_px = 153.3 * size / 512, centre_px = (size - 1) / 2.0;
  const std::array k{-0.02, 0.002, -0.0003, 0.0};
  camera.intrinsics = {size, size, focal_px, focal_px, centre_px, centre_px, k, 100 * degree};
  camera.response.kind = ResponseCurve::Kind::linear;
  camera.world_from_camera = world_from_camera;
  return camera;
}

glm::dvec3 towards(double azimuth_deg, double elevation_deg) {
  const double a = azimuth_deg * degree, e = elevation_deg * degree;
  return {std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e)};
}

glm::dmat4 looking(double azimuth_deg, double elevation_deg, double roll_deg) {
  const glm::dvec3 z = towards(azimuth_deg, elevation_deg);
  const glm::dvec3 right =
      glm::dvec3(std::sin(azimuth_deg * degree), -std::cos(azimuth_deg * degree), 0);
  const glm::dvec3 down = glm::cross(z, right);
  const double c = std::cos(roll_deg * degree), s = std::sin(roll_deg * degree);
  return glm::dmat4(glm::dvec4(c * right + s * down, 0), glm::dvec4(c * down - s * right, 0),
                    glm::dvec4(z, 0), glm::dvec4(0.1, 0.2, 0.3, 1));
}

FramePtr photograph(const LightCameraCalibration& camera, const Sky& sky, double exposure,
                    Detail detail) {
  const Fisheye lens(camera.intrinsics);
  const glm::dmat3 world_from_camera(camera.world_from_camera);
  struct Mean {
    glm::dvec3 radiance{0};
    bool varies = false;
  };
  const auto mean_of = [&](int x, int y, int samples) {
    Mean mean;
    glm::dvec3 sum(0), first(0);
    for (int s = 0; s < samples * samples; ++s) {
      const int across = s % samples, down = s / samples;
      const auto ray =
          lens.unproject({x - 0.5 + (across + 0.5) / samples, y - 0.5 + (down + 0.5) / samples});
      const glm::dvec3 radiance = ray ? sky(world_from_camera * *ray) : glm::dvec3(0);
      if (s == 0) first = radiance;
      mean.varies = mean.varies || radiance != first;
      sum += radiance;
    }
    mean.radiance = sum / static_cast<double>(samples * samples);
    return mean;
  };
  const FisheyeIntrinsics& size = camera.intrinsics;
  return make_frame(size.width, size.height, exposure, [&](int x, int y) {
    Mean mean = mean_of(x, y, 2);
    if (mean.varies && detail == Detail::fine) mean = mean_of(x, y, 8);
    return exposure * mean.radiance;
  });
}

set::Lighting unseen_as(set::UnseenRule rule, double radiance) {
  set::Lighting settings;
  settings.unseen = rule;
  settings.unseen_radiance = glm::dvec3(radiance);
  return settings;
}

std::vector<glm::dvec3> upper_normals() {
  std::vector<glm::dvec3> normals;
  for (int i = 0; i < 64; ++i) {
    const double z = (i + 0.5) / 64, r = std::sqrt(1 - z * z);
    const double azimuth = 2 * pi * i / std::numbers::phi;
    normals.emplace_back(r * std::cos(azimuth), r * std::sin(azimuth), z);
  }
  return normals;
}

}  // namespace previz::test
