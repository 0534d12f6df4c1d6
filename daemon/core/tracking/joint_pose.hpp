// Solves for one camera pose from the corners of many tags: robustly, with every pose that explains
// them.
#pragma once

#include <array>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "daemon/core/tracking/camera_pose.hpp"
#include "daemon/core/tracking/tag_observation.hpp"
#include "drivers/calibration.hpp"

namespace previz::tracking {

// Errors beside the picture's noise (lens model, response, print, map) are a further deviation of
// every corner coordinate: at least this, more where the residuals require it.
inline constexpr double kCornerFloorPx = 0.03;

struct FittedPose {
  CameraFromWorld pose;
  // Row-major 6x6, rotation (rad) then translation (m): the true world_from_camera is the
  // estimate times the small motion (rotation, translation), both along the camera's axes.
  std::array<double, 36> covariance{};
  double rms_px = 0;      // of the used corners, per coordinate pair
  double chi_square = 0;  // of the used corners against the covariance they were given
  int degrees_of_freedom = 0;
  std::vector<std::size_t> used;  // indices of the observations that the pose explains
};

// Returns how far off a tag's corners may be (rms, px) and still count as explained: 2 px, more on
// wide pictures.
double consistency_gate_px(const PinholeIntrinsics& lens);

// Returns every local minimum that explains the largest number of tags, best (by chi-square) first.
// Minima with different `used` mean that equally many tags contradict each other. `seed` is a
// further start beside those of pose_starts(). From each start, Levenberg-Marquardt runs twice. The
// first run is over all tags, with a loss that drops those at odds with the rest (a moved tag). The
// second is over the remaining ones, weighed by their covariance; to that it adds an error of the
// model itself, at least 0.03 px, and as much as the residuals show. Returns an empty list if no
// pose explains a tag.
std::vector<FittedPose> solve_joint_pose(const std::vector<TagObservation>& tags,
                                         const PinholeIntrinsics& lens,
                                         const std::optional<CameraFromWorld>& seed);

// Moves the pose to the minimum over all of these tags, weighed by the corners' covariances and the
// least error of the model (0.03 px), whatever the residuals are: chi_square says whether they are
// as large as they should be. Returns nothing if a tag is behind the camera.
std::optional<FittedPose> refitted_pose(const std::vector<TagObservation>& tags,
                                        const PinholeIntrinsics& lens,
                                        const CameraFromWorld& start);

// As a rolling shutter exposes a picture: a camera that turns, and moves if `also_moves`, at a
// constant velocity while rows are read, its pose that of the middle row. In a single plane of tags
// both together are hardly determined.
struct RowsFit {
  double chi_square = 0;  // as of refitted_pose()
  int degrees_of_freedom = 0;
  double rms_px = 0;    // as of FittedPose
  double moved_px = 0;  // by which the tags move while the picture's height is read, mean
};
std::optional<RowsFit> fit_of_rows(const std::vector<TagObservation>& tags,
                                   const PinholeIntrinsics& lens, const CameraFromWorld& start,
                                   bool also_moves);

// Returns the rms distance that noise alone would leave between the corners of most tags and their
// projections: by the median of the tags' variances.
double expected_rms_px(const std::vector<TagObservation>& tags, int degrees_of_freedom);

// Returns the rms distance in px between a tag's corners and their projection; infinite if the tag
// cannot be seen (it is behind the camera, or seen from behind).
double tag_error_px(const TagObservation& tag, const CameraFromWorld& pose,
                    const PinholeIntrinsics& lens);

}  // namespace previz::tracking
