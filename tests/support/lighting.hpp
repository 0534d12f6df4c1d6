// Helpers for light that only tests need: maps and pictures to look at, files to read.
#pragma once

#include <filesystem>
#include <glm/vec3.hpp>
#include <optional>
#include <span>

#include "daemon/lighting/environment.hpp"
#include "daemon/lighting/exr_picture.hpp"
#include "daemon/lighting/hdr.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::lighting {

// merge() of the frames' bracket; throws as Bracket does.
HdrPicture merge_exposures(std::span<const FramePtr> frames, const ResponseCurve& response,
                           const glm::dvec3& dark_level = glm::dvec3(0),
                           const SensorNoise& noise = {});

// Irradiance on a plane of this unit normal, per channel.
glm::dvec3 irradiance(const EnvironmentMap& map, const glm::dvec3& normal);

// A SourceDistance for lamps_of(): every source is at infinity.
inline std::optional<double> at_infinity(const glm::dvec3&) {
  return std::nullopt;
}

// 32-bit float RGB. Throws previz::Error naming the file.
void write_exr_picture(const std::filesystem::path& path, const LinearPicture& picture);

// Latitude-longitude picture, twice as wide as high, laid out as load_environment reads it: means
// over 4x4 directions a pixel.
LinearPicture to_latitude_longitude(const EnvironmentMap& map, int width);

// 8-bit sRGB for the eye: scaled so that the mean of log luminance becomes 0.18, then L / (1 + L)
// on luminance.
Plate tone_map(const LinearPicture& picture);

}  // namespace previz::lighting
