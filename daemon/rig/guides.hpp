// Computes the lines that show on a picture how well the set fits what the camera sees.
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/fit/real_model.hpp"
#include "daemon/core/output/guide_page.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"

namespace previz::rig {

// Everything of a set that lines are drawn of; it needs neither the set nor the scene any more.
class GuideModel {
 public:
  // `scene` is load_scene(set). This may take a second for a large scene.
  GuideModel(const scene::Scene& scene, const set::Set& set, const ObserverCalibration& camera);

  // Where things are in one picture.
  struct View {
    glm::dmat4 world_from_camera{1};
    session::SceneState scene;  // what is not as the set has it
    session::Carriers carriers;
  };

  // Returns the lines in pixels of the calibrated picture: the model's edges that it does not hide
  // itself; the tags that face the camera, those of carriers where these were found; the horizon;
  // the world's axes at its origin, 0.1 m long; the box around each virtual object as its file has
  // it; and a cross with the focus distance in the middle of the picture, if the lens has one.
  output::GuidePage guides_of(const View& view) const;

  const fit::RealModel& real() const { return real_; }
  const ObserverCalibration& camera() const { return camera_; }

 private:
  struct Box {
    std::string object;
    std::optional<glm::dmat4> world_from_file;  // absent: a carrier has it
    glm::dvec3 low{0}, high{0};                 // in the file's frame
  };

  std::optional<glm::dmat4> place_of(const Box& box, const session::SceneState& state) const;

  const fit::RealModel real_;
  const ObserverCalibration camera_;
  const std::vector<set::Tag> tags_;
  const std::vector<set::Carrier> carriers_;
  std::vector<Box> boxes_;  // of the virtual objects
};

}  // namespace previz::rig
