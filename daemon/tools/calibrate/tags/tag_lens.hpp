// Refines the film camera's lens by the tags, which the camera saw up to the edges of the picture.
#pragma once

#include <string>

#include "daemon/tools/calibrate/tags/tag_survey.hpp"

namespace previz::calibrate {

// Pictures of tags below which the lens stays: as many as calibrate observer wants of boards.
inline constexpr std::size_t least_lens_pictures = 5;

struct RefinedLens {
  TagSurvey survey;  // by the lens that is to be used
  bool is_refined = false;
  std::string why_not;       // where the lens stays
  double rms_before_px = 0;  // with the lens as it was; 0: no map fits it
  // The boards' covariance was taken as this many times as large, at least 1.
  double boards_factor = 1;
  double sigma_before_px = 0, sigma_px = 0;  // of the projection, where the boards leave it worst
  // How far a far point moves in the picture's corner where it moves most, without what a rotation
  // of the camera absorbs (uncertainty.hpp); px.
  double corner_moved_px = 0;
};

// Surveys the tags by the lens as it is, and with the lens as a further unknown whose prior is the
// boards' statistics (survey_tags). The lens stays, and the map with it, unless
//   pictures  at least least_lens_pictures show tags;
//   certain   the variance of the projection is halved, at least, where the boards leave it
//   largest:
//             the tags know the lens there as well as the boards do. What less could change is
//             mostly what tags that are not flat or not of their size do to it.
// Real boards and tags contradict each other by more than the noise of their corners says: paper is
// not flat. Where the lens is off from that of the boards by more than three standard deviations of
// chi-square, the boards' covariance is multiplied by what brings it to its expectation, the
// prior's redundancy (variance components: Foerstner 1979), so that
// a prior that is too sure of itself does not bend the map.
// Throws previz::Error as survey_tags does, if neither survey succeeds.
RefinedLens survey_tags_and_lens(const TagWalk& walk, const PinholeIntrinsics& lens,
                                 const TagSurveyOptions& options, const LensPrior& prior);

// Returns the standard deviation (px) of where a lens of this covariance projects to, the largest
// over its picture.
double worst_projection_px(const PinholeIntrinsics& lens, const LensMatrix& covariance);

// Returns how far two lenses lie apart (px): the largest distance of their projections of a far
// point in the corners of the picture, after the rotation that fits the whole picture best.
double corner_difference_px(const PinholeIntrinsics& lens, const PinholeIntrinsics& other);

}  // namespace previz::calibrate
