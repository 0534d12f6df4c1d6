// A set's sequence played as live would show it: every frame in turn, with what is accumulated over
// them, and how much the pictures flicker.
#pragma once

#include <filesystem>
#include <functional>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "daemon/core/scene/scene.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"
#include "tests/truth/compare.hpp"
#include "tests/truth/cpu_geometry.hpp"

namespace previz::truth {

struct LiveSettings {
  int samples = 1;
  bool accumulates = true;
  bool denoise = true;
  double scale = 1;        // quality.scale
  std::uint64_t last = 0;  // of the frames to play
  int still = 0;  // above 0: the last frame so many times, with the camera at rest, and no other
  std::string device = {};
};

// A frame as it was shown.
struct LiveFrame {
  std::uint64_t index = 0;  // in the session's stream
  bool is_last = true;      // of those with the same index
  Plate picture, plate;
  glm::dmat4 world_from_camera{1.0};
  double exposure = 1;
  double seconds = 0;
};

// What pictures flicker by: the rms, over frames and over points of real surfaces that three frames
// in a row show, of f - (f_before + f_after) / 2, f being what the picture shows less the plate, in
// radiance.
class Flicker {
 public:
  // `scene` must outlive this.
  Flicker(const scene::Scene& scene, const ObserverCalibration& calibration);
  void add(const LiveFrame& frame);
  // Returns 0 before three frames were added.
  double rms() const;

 private:
  struct Seen {
    glm::dmat4 world_from_camera;
    std::vector<glm::dvec3> added;  // of the pixels
  };
  bool find(const Seen& frame, const glm::dvec3& point, glm::dvec3& added) const;
  void add_middle();

  const scene::Scene& scene_;
  const ObserverCalibration calibration_;
  Geometry geometry_;
  std::vector<Seen> last_;  // up to three frames
  double squares_ = 0;
  std::size_t values_ = 0;
};

// Plays the session in directory/session (write_take). `scene` is called once, before the first
// frame. Throws previz::Error if a frame cannot be shown.
void play_live(const std::filesystem::path& directory, const LiveSettings& settings,
               const std::function<void(const scene::Scene&, const ObserverCalibration&)>& begin,
               const std::function<void(const LiveFrame&)>& shown);

// Returns the estimate that the shown picture is: everything is judged by what it shows. Its mask
// is the truth's, because a picture has none.
EstimatedFrame as_shown(const TruthFrame& truth, const Plate& picture);

// Returns the rms of the true difference over the pixels that nothing virtual covers.
double rms_of_difference(const TruthFrame& truth);

}  // namespace previz::truth
