// Measures captured light on a ground truth set: the map made from the fisheye frames against the
// set's true environment.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/lighting/sources.hpp"
#include "tests/truth/truth_set.hpp"

namespace previz::truth {

// Relative errors of irradiance on 64 planes with upward normals, over planes and channels.
struct IrradianceError {
  double mean = 0;
  double worst = 0;
};

// A disc that the set's makers painted into the environment, as set.json states it.
struct Lamp {
  std::string name;
  glm::dvec3 direction{0, 0, 1};  // unit
  double radius_rad = 0;
};

struct LampError {
  Lamp lamp;
  double direction_rad = 0;  // between the measured centre of gravity and the stated direction
  glm::dvec3 flux_ratio{0};  // measured / true, each above the ring around the lamp
};

// The source that is nearest to a lamp.
struct SourceError {
  Lamp lamp;
  double direction_rad = 0;  // to the stated direction
  double radius_ratio = 0;   // angular, found / stated
  glm::dvec3 flux_ratio{0};  // found / true, the true above the ring around the lamp
};

struct LightingMeasure {
  lighting::Lighting captured;
  lighting::EnvironmentMap truth;  // of the same size
  double compared_sr = 0;
  IrradianceError irradiance;  // both sides over the directions that can be compared only
  IrradianceError sphere;      // over all directions: what the table and the unseen part cost
  // The error of resampling alone, from fisheye_true.exr if the set has it.
  std::optional<IrradianceError> resampling;
  std::vector<LampError> lamps;
  lighting::Extraction extraction;   // of the captured map
  std::vector<SourceError> sources;  // one a lamp, where any was found
};

// The fisheye frames of the set, automatic exposure and brackets. Throws
// previz::Error naming the file.
std::vector<FramePtr> load_light_frames(const TruthSet& set);

// Directions can be compared if they are within 100 degrees of the camera's axis and the phantom
// does not block them from where the camera stands.
LightingMeasure measure_lighting(const TruthSet& set, const std::vector<FramePtr>& frames,
                                 const set::Lighting& settings);

}  // namespace previz::truth
