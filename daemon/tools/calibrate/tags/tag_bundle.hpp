// Joint adjustment of the places of tags, their sizes and the poses of the camera that saw them.
#pragma once

#include <array>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/tracking/joint_pose.hpp"
#include "daemon/tools/calibrate/lens/lens_prior.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

// One tag in one picture.
struct TagSighting {
  std::size_t picture = 0, tag = 0;  // indices into the walk's lists
  tracking::CornerPixels corners{};
  double variance_px2 = 0;  // of a corner's coordinate, from the picture's noise
};

// What a camera saw of tags on a walk.
struct TagWalk {
  std::vector<std::string> pictures;  // names, in the order of the walk
  std::vector<int> ids;               // of the tags, rising
  std::vector<double> sizes_m;        // as stated, a tag each
  std::vector<TagSighting> sightings;
};

// The unknowns. A place is world_from_tag, rigid.
struct TagPlaces {
  std::vector<tracking::CameraFromWorld> cameras;  // a picture each
  std::vector<glm::dmat4> world_from_tag;          // a tag each
  std::vector<double> sizes_m;
};

struct TagAdjustment {
  // The tag whose pose is held: it defines the world.
  std::size_t origin = 0;
  // Sizes are unknown, too, but for the origin's: a priori they are as stated to 20 %.
  bool sizes_free = false;
  // Cauchy's loss of the root mean square of a tag's coordinates in one picture, in standard
  // deviations; 0: least squares.
  double loss_scale = 0;
  // What the lens model and the paper add to the noise of a corner's coordinate.
  double model_error_px = 0.3;
  // Which sightings count; empty: all.
  std::vector<bool> used;
  // The lens is unknown, too, and this is what is known of it. adjust_tags holds it.
  std::optional<LensPrior> lens_prior = std::nullopt;
};

struct TagsAndLens {
  TagPlaces places;
  PinholeIntrinsics lens;
};

// Moves the unknowns to the nearest minimum (Levenberg-Marquardt; the cameras are eliminated by a
// Schur complement: Triggs et al. 2000, "Bundle Adjustment - A Modern Synthesis").
// Tags and cameras without a used sighting stay where they are.
TagPlaces adjust_tags(const TagWalk& walk, const PinholeIntrinsics& lens, TagPlaces start,
                      const TagAdjustment& how);

// The same with the free parameters of how.lens_prior, which must be there, as further unknowns
// (self-calibration with the lens as observed parameters: Triggs et al. 2000; Luhmann
// et al., "Close-Range Photogrammetry and 3D Imaging").
TagsAndLens adjust_tags_and_lens(const TagWalk& walk, TagsAndLens start, const TagAdjustment& how);

// The covariance of each tag: rotation (rad) and shift (m) along the tag's own axes against the
// origin, and the logarithm of its size; row-major 7x7, from the Jacobian at the minimum. It is
// zero for what is held, and for tags that nothing was seen of. With a prior of the lens it
// includes what the lens may be off by.
using TagCovariance = std::array<double, 49>;
std::vector<TagCovariance> tag_covariances(const TagWalk& walk, const PinholeIntrinsics& lens,
                                           const TagPlaces& places, const TagAdjustment& how);

// Returns the covariance of the lens after an adjustment with how.lens_prior; 0 of parameters that
// are held.
LensMatrix lens_covariance(const TagWalk& walk, const TagsAndLens& at, const TagAdjustment& how);

// Returns the sum of all squares that the adjustment makes small, in standard deviations: those of
// the sightings and of the priors.
double chi_square(const TagWalk& walk, const TagsAndLens& at, const TagAdjustment& how);

// Returns how far off a tag's corners may be (rms, px) and still count as explained: 1 px, or 4.5
// standard deviations.
double sighting_gate_px(const TagSighting& sighting, double model_error_px);

// Returns the sum of squared distances of the four corners, px^2.
double tag_squares_px2(const TagSighting& sighting, const PinholeIntrinsics& lens,
                       const TagPlaces& places);

}  // namespace previz::calibrate
