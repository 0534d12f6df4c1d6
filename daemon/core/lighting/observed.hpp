// Keeps the light that the film camera has seen from each direction, for directions in which the
// light camera is blind.
#pragma once

#include <cstddef>
#include <glm/mat4x4.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/core/lighting/resampling.hpp"
#include "daemon/core/lighting/room.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::lighting {

// The radiance is on the film camera's scale, by its response and exposures; lighting.balance
// scales the light camera's to the same. Each direction keeps what was last seen in it.
class ObservedLight {
 public:
  static constexpr int max_size = 256;  // texels a side; enough to fill gaps

  // `size` is the side of the light map in texels, a power of two. `room` may be null, as in
  // Viewpoint. Throws previz::Error if the lens cannot be inverted.
  ObservedLight(const ObserverCalibration& calibration, int size, std::shared_ptr<const Room> room);

  // Adds what a plate shows. Throws previz::Error if the plate does not have the calibration's
  // size.
  void see(const Plate& plate, double exposure, const glm::dmat4& world_from_camera);

  const Resampled& map() const { return map_; }  // `seen` is 0 or 1

 private:
  struct Texel {
    glm::dvec3 direction{0};
    double distance_m = 0;  // from Room::seen_from to the room's surface; infinite: far away
  };

  bool hidden(const Texel& texel, const glm::dvec3& position) const;
  // Returns the pixel in which the film camera sees a direction; nothing if it lies outside the
  // picture.
  std::optional<std::size_t> pixel_of(const glm::dvec3& direction, double distance_m,
                                      const glm::dmat4& world_from_camera) const;

  const ObserverCalibration calibration_;
  const std::shared_ptr<const Room> room_;
  double max_radius_ = 0;  // on the normalised image plane, of the picture's farthest corner
  std::vector<Texel> texels_;
  Resampled map_;
};

}  // namespace previz::lighting
