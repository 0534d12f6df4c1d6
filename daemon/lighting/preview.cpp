#include "daemon/lighting/preview.hpp"

#include <cmath>
#include <numbers>

#include "daemon/lighting/luminance.hpp"
#include "daemon/lighting/response.hpp"

namespace previz::lighting {

using std::numbers::pi;

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
