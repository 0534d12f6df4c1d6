// What the film camera has seen of the directions that light comes from, for where the light camera
// is blind.
#pragma once

#include <cstddef>
#include <glm/mat4x4.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/lighting/resampling.hpp"
#include "daemon/lighting/room.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::lighting {

// Radiance is what the film camera's response and exposure say, on the light camera's scale where
// the two cameras are balanced. Each direction keeps what was seen in it last.
class ObservedLight {
 public:
  static constexpr int max_size = 256;  // texels a side; the film camera fills in, no more

  // `size`: of the light map; a power of two. `room` may be null, as in Viewpoint. Throws
  // previz::Error where the lens cannot be inverted.
  ObservedLight(const ObserverCalibration& calibration, int size, std::shared_ptr<const Room> room);

  // Plates of the calibration's size; throws previz::Error otherwise.
  void see(const Plate& plate, double exposure, const glm::dmat4& world_from_camera);

  const Resampled& map() const { return map_; }  // `seen` is 0 or 1

 private:
  struct Texel {
    glm::dvec3 direction{0};
    double distance_m = 0;  // of the room's surface from Room::seen_from; infinite: far away
  };

  bool hidden(const Texel& texel, const glm::dvec3& position) const;
  // Where the film camera sees a direction; nothing outside its picture.
  std::optional<std::size_t> pixel_of(const glm::dvec3& direction, double distance_m,
                                      const glm::dmat4& world_from_camera) const;

  const ObserverCalibration calibration_;
  const std::shared_ptr<const Room> room_;
  double max_radius_ = 0;  // of the normalised image plane, at the picture's farthest corner
  std::vector<Texel> texels_;
  Resampled map_;
};

}  // namespace previz::lighting
