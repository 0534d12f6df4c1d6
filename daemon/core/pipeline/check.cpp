#include "daemon/core/pipeline/check.hpp"

#include "daemon/core/pipeline/room_model.hpp"
#include "daemon/core/pipeline/take.hpp"

namespace previz::pipeline {
namespace {

void check_room(const set::Set& set, set::Findings& findings) {
  if (!set.lighting.room) return;
  const auto& calibration = set.light_camera.calibration;
  const glm::dvec3 camera =
      calibration ? glm::dvec3(calibration->world_from_camera[3]) : set.lighting.room->seen_from;
  findings.attempt([&] { open_room(set, camera); });
}

}  // namespace

void check(const set::CheckedSet& checked, set::Findings& findings) {
  check_room(checked.set, findings);
  const set::Lighting& lighting = checked.set.lighting;
  const bool from_camera = lighting.from == set::LightFrom::camera && !lighting.environment;
  if (checked.is_take && from_camera && checked.set.light_camera.driver == set::no_driver)
    findings.problems.push_back(checked.set.file.string() + ": " + no_light_words());
}

}  // namespace previz::pipeline
