#include "tests/support/lighting.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "daemon/lighting/luminance.hpp"
#include "daemon/lighting/response.hpp"
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
  for (int j = 0; j < map.size; ++j) {
    for (int i = 0; i < map.size; ++i) {
      const glm::dvec3 direction(texel_direction(map.size, i, j));
      const double cosine = glm::dot(direction, normal);
      if (cosine > 0)
        sum += cosine * glm::dvec3(map.radiance[static_cast<std::size_t>(j * map.size + i)]);
    }
  }
  return sum * texel_sr(map.size);
}

void write_exr_picture(const std::filesystem::path& path, const LinearPicture& picture) {
  try {
    Imf::Header header(picture.width, picture.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::FrameBuffer buffer;
    const std::array<const char*, 3> names{"R", "G", "B"};
    for (std::size_t c = 0; c < 3; ++c) {
      header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
      buffer.insert(names[c],
                    Imf::Slice::Make(Imf::FLOAT, &picture.radiance[0][static_cast<int>(c)],
                                     header.dataWindow(), sizeof(glm::vec3),
                                     sizeof(glm::vec3) * static_cast<std::size_t>(picture.width)));
    }
    Imf::OutputFile file(path.c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(picture.height);
  } catch (const std::exception& error) {
    throw Error(path.string() + ": cannot be written: " + error.what());
  }
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
