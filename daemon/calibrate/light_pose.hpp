// Where the light camera stands, from the set's tags in its pictures.
#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <vector>

#include "daemon/calibrate/source.hpp"
#include "daemon/set/set.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

struct LightPose {
  glm::dmat4 world_from_camera{1.0};
  double rms_px = 0;
  double position_sigma_m = 0;  // standard deviations, along the longest axis
  double rotation_sigma_rad = 0;
  std::vector<int> tags;      // that it stands on
  std::vector<int> left_out;  // seen, and not where the others say
  int pictures = 0;           // that show a tag of the set
};

// One pose for all pictures (the light camera stands still), of at least two tags: one alone is
// explained by two poses. Poses are tried of all tags and of all but one; the one that explains the
// most tags (to 2 px) is fitted to those. Looks at up to 20 pictures. Throws previz::Error saying
// which tags were seen if they are not enough.
LightPose find_light_pose(PictureSource& source, const FisheyeIntrinsics& intrinsics,
                          const ResponseCurve& response, const set::Tracking& tracking);

}  // namespace previz::calibrate
