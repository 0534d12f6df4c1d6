#include "tests/support/lighting.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <half.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "daemon/core/lighting/luminance.hpp"
#include "daemon/core/lighting/response.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::lighting {

using std::numbers::pi;

HdrPicture merge_exposures(std::span<const FramePtr> frames, const ResponseCurve& response,
                           const glm::dvec3& dark_level, const SensorNoise& noise) {
  return merge(Bracket(frames, response, dark_level), noise);
}

glm::dvec3 irradiance(const EnvironmentMap& map, const glm::dvec3& normal) {
  glm::dvec3 sum(0);
  for_each_texel(map, [&](const glm::dvec3& direction, const glm::dvec3& radiance) {
    sum += std::max(0.0, glm::dot(direction, normal)) * radiance;
  });
  return sum * texel_sr(map.size);
}

void write_exr_channels(const std::filesystem::path& path, int width, int height,
                        const std::vector<ExrChannel>& channels) {
  try {
    Imf::Header header(width, height);
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::FrameBuffer buffer;
    std::vector<std::vector<half>> halves;
    for (const auto& [name, values, is_half] : channels) {
      const Imf::PixelType type = is_half ? Imf::HALF : Imf::FLOAT;
      halves.emplace_back(values.begin(), values.end());
      const void* first = is_half ? static_cast<const void*>(halves.back().data()) : values.data();
      const std::size_t bytes = is_half ? sizeof(half) : sizeof(float);
      header.channels().insert(name, Imf::Channel(type));
      buffer.insert(name, Imf::Slice::Make(type, first, header.dataWindow(), bytes,
                                           bytes * static_cast<std::size_t>(width)));
    }
    Imf::OutputFile file(path.c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(height);
  } catch (const std::exception& error) {
    throw Error(path.string() + ": cannot be written: " + error.what());
  }
}

void write_exr_picture(const std::filesystem::path& path, const LinearPicture& picture,
                       bool is_half) {
  std::vector<ExrChannel> channels{{"R", {}, is_half}, {"G", {}, is_half}, {"B", {}, is_half}};
  for (const glm::vec3& radiance : picture.radiance)
    for (int c = 0; c < 3; ++c) channels[static_cast<std::size_t>(c)].values.push_back(radiance[c]);
  write_exr_channels(path, picture.width, picture.height, channels);
}

LinearPicture to_latitude_longitude(const EnvironmentMap& map, int width) {
  constexpr int samples = 4;
  LinearPicture picture{width, width / 2, {}};
  picture.radiance.reserve(static_cast<std::size_t>(width) *
                           static_cast<std::size_t>(picture.height));
  for (int row = 0; row < picture.height; ++row) {
    for (int column = 0; column < width; ++column) {
      glm::vec3 sum(0);
      for (int s = 0; s < samples * samples; ++s) {
        const int across = s % samples, down = s / samples;
        const double x = column + (across + 0.5) / samples;
        const double y = row + (down + 0.5) / samples;
        const double azimuth = 2 * pi * (0.5 - x / width);
        const double elevation = pi * (0.5 - y / picture.height);
        sum += map.radiance[texel_index(
            map.size, {std::cos(elevation) * std::cos(azimuth),
                       std::cos(elevation) * std::sin(azimuth), std::sin(elevation)})];
      }
      picture.radiance.push_back(sum / static_cast<float>(samples * samples));
    }
  }
  return picture;
}

Plate tone_map(const LinearPicture& picture) {
  double logs = 0;
  std::size_t lit = 0;
  for (const glm::vec3& radiance : picture.radiance) {
    if (const double l = luminance(radiance); l > 0) {
      logs += std::log(l);
      ++lit;
    }
  }
  const double scale = lit > 0 ? 0.18 / std::exp(logs / static_cast<double>(lit)) : 1;

  const Response display(ResponseCurve{}, 8);
  Plate plate{picture.width, picture.height, 8, {}};
  plate.samples.reserve(3 * picture.radiance.size());
  for (const glm::vec3& radiance : picture.radiance) {
    const double compressed = scale / (1 + scale * luminance(radiance));
    for (int c = 0; c < 3; ++c)
      plate.samples.push_back(display.forward(compressed * static_cast<double>(radiance[c])));
  }
  return plate;
}

}  // namespace previz::lighting
