#include "daemon/core/lighting/observed.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <optional>
#include <string>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/lighting/response.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/octahedral.h"

namespace previz::lighting {
namespace {

constexpr int samples_a_side = 4;  // per texel
constexpr double infinity = std::numeric_limits<double>::infinity();

double corner_radius(const PinholeIntrinsics& lens) {
  double radius = 0;
  for (const double x : {-0.5, lens.width - 0.5}) {
    for (const double y : {-0.5, lens.height - 0.5}) {
      const auto corner = undistort(lens, {x, y});
      if (!corner)
        throw Error(
            "observer.intrinsics: the distortion cannot be inverted at the picture's corners");
      radius = std::max(radius, glm::length(*corner));
    }
  }
  return radius;
}

// Returns the unit direction at a position in the texel; s and t run from 0 to 1.
glm::dvec3 direction_in_texel(int size, int i, int j, double s, double t) {
  return glm::dvec3(octahedral_direction(glm::vec2(static_cast<float>(2 * (i + s) / size - 1),
                                                   static_cast<float>(2 * (j + t) / size - 1))));
}

}  // namespace

ObservedLight::ObservedLight(const ObserverCalibration& calibration, int size,
                             std::shared_ptr<const Room> room)
    : calibration_(calibration),
      room_(std::move(room)),
      max_radius_(corner_radius(calibration.intrinsics)) {
  map_.size = std::min(size, max_size);
  for (int j = 0; j < map_.size; ++j) {
    for (int i = 0; i < map_.size; ++i) {
      const glm::dvec3 direction(texel_direction(map_.size, i, j));
      const auto distance = room_ ? room_->distance(room_->seen_from(), direction) : std::nullopt;
      texels_.push_back({direction, distance.value_or(infinity)});
    }
  }
  map_.radiance.resize(texels_.size());
  map_.seen.resize(texels_.size());
}

bool ObservedLight::hidden(const Texel& texel, const glm::dvec3& position) const {
  return texel.distance_m < infinity &&
         !room_->sees(position, room_->seen_from() + texel.distance_m * texel.direction);
}

std::optional<std::size_t> ObservedLight::pixel_of(const glm::dvec3& direction, double distance_m,
                                                   const glm::dmat4& world_from_camera) const {
  glm::dvec3 towards = direction;
  if (distance_m < infinity)
    towards = room_->seen_from() + distance_m * direction - glm::dvec3(world_from_camera[3]);
  const glm::dvec3 in_camera = glm::transpose(glm::dmat3(world_from_camera)) * towards;
  if (!(in_camera.z > 0)) return std::nullopt;
  const glm::dvec2 normalised = glm::dvec2(in_camera) / in_camera.z;
  if (glm::length(normalised) > max_radius_) return std::nullopt;  // the polynomial may fold back
  const PinholeIntrinsics& lens = calibration_.intrinsics;
  const glm::dvec2 place = glm::floor(distort(lens, normalised) + 0.5);
  if (place.x < 0 || place.y < 0 || place.x >= lens.width || place.y >= lens.height)
    return std::nullopt;
  return static_cast<std::size_t>(place.y) * static_cast<std::size_t>(lens.width) +
         static_cast<std::size_t>(place.x);
}

void ObservedLight::see(const Plate& plate, double exposure, const glm::dmat4& world_from_camera) {
  const PinholeIntrinsics& lens = calibration_.intrinsics;
  if (plate.width != lens.width || plate.height != lens.height)
    throw Error("observer: a frame of " + std::to_string(plate.width) + "x" +
                std::to_string(plate.height) + " does not fit the calibration's " +
                std::to_string(lens.width) + "x" + std::to_string(lens.height));
  const Response response(calibration_.response, plate.bits);
  const auto radiance = [&](std::size_t sample) {
    return response.inverse()[plate.samples[sample]] / exposure;
  };
  const glm::dvec3 position(world_from_camera[3]);
  for (std::size_t t = 0; t < texels_.size(); ++t) {
    const Texel& texel = texels_[t];
    if (!pixel_of(texel.direction, texel.distance_m, world_from_camera)) continue;
    if (hidden(texel, position)) continue;
    const int i = static_cast<int>(t) % map_.size, j = static_cast<int>(t) / map_.size;
    glm::dvec3 sum(0);
    int landed = 0;
    for (int k = 0; k < samples_a_side * samples_a_side; ++k) {
      const int across = k % samples_a_side, down = k / samples_a_side;
      const auto pixel =
          pixel_of(direction_in_texel(map_.size, i, j, (across + 0.5) / samples_a_side,
                                      (down + 0.5) / samples_a_side),
                   texel.distance_m, world_from_camera);
      if (!pixel) continue;
      sum += glm::dvec3(radiance(3 * *pixel), radiance(3 * *pixel + 1), radiance(3 * *pixel + 2));
      ++landed;
    }
    if (landed == 0) continue;
    map_.radiance[t] = glm::vec3(sum / static_cast<double>(landed));
    map_.seen[t] = 1;
  }
}

}  // namespace previz::lighting
