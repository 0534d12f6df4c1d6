// Helpers for light that only tests need: maps and pictures to look at, files to read.
#pragma once

#include <filesystem>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/lighting/exr_picture.hpp"
#include "daemon/core/lighting/hdr.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::lighting {

// merge() of the frames' bracket; throws as Bracket does.
HdrPicture merge_exposures(std::span<const FramePtr> frames, const ResponseCurve& response,
                           const glm::dvec3& dark_level = glm::dvec3(0),
                           const SensorNoise& noise = {});

// Calls body(direction, radiance) for each texel.
template <typename Body>
void for_each_texel(const EnvironmentMap& map, const Body& body) {
  for (int t = 0; t < map.size * map.size; ++t)
    body(glm::dvec3(texel_direction(map.size, t % map.size, t / map.size)),
         glm::dvec3(map.radiance[static_cast<std::size_t>(t)]));
}

// Irradiance on a plane of this unit normal, per channel.
glm::dvec3 irradiance(const EnvironmentMap& map, const glm::dvec3& normal);

// A SourceDistance for lamps_of(): every source is at infinity.
inline std::optional<double> at_infinity(const glm::dvec3&) {
  return std::nullopt;
}

struct ExrChannel {
  std::string name;
  std::vector<float> values;  // a pixel each
  bool is_half = false;
};

// Throws previz::Error naming the file.
void write_exr_channels(const std::filesystem::path& path, int width, int height,
                        const std::vector<ExrChannel>& channels);
// RGB, 32-bit float unless halves are asked for. Throws as write_exr_channels().
void write_exr_picture(const std::filesystem::path& path, const LinearPicture& picture,
                       bool is_half = false);

// Latitude-longitude picture, twice as wide as high, laid out as load_environment reads it: means
// over 4x4 directions a pixel.
LinearPicture to_latitude_longitude(const EnvironmentMap& map, int width);

// 8-bit sRGB for the eye: scaled so that the mean of log luminance becomes 0.18, then L / (1 + L)
// on luminance.
Plate tone_map(const LinearPicture& picture);

}  // namespace previz::lighting
