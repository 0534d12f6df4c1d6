// Finds where the light camera stands, from the set's tags in its pictures.
#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

struct LightPose {
  glm::dmat4 world_from_camera{1.0};
  double rms_px = 0;
  double position_sigma_m = 0;  // standard deviations, along the longest axis
  double rotation_sigma_rad = 0;
  std::vector<int> tags;      // that the pose is based on
  std::vector<int> left_out;  // seen, but contradicted by the others
  int pictures = 0;           // that show a tag of the set
};

// Finds one pose for all pictures (the light camera stands still), from at least two tags, because
// one alone is explained by two poses. Candidates are the poses from all tags and from all but one;
// the pose that explains the most tags (to 2 px) is fitted to those. Looks at up to 20 pictures.
// Throws previz::Error saying which tags were seen if they are not enough.
LightPose find_light_pose(PictureSource& source, const FisheyeIntrinsics& intrinsics,
                          const ResponseCurve& response, const set::Tracking& tracking);

}  // namespace previz::calibrate
