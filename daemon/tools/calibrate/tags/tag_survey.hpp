// Finds the map of tags from what a camera saw of them on a walk.
#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/tools/calibrate/tags/moved_tags.hpp"
#include "daemon/tools/calibrate/tags/tag_bundle.hpp"

namespace previz::calibrate {

// The distance between the middles of two tags, measured with a tape.
struct StatedDistance {
  int a = 0, b = 0;
  double metres = 0;
};

struct TagSurveyOptions {
  int origin = 0;                        // the tag that defines the world
  glm::dmat4 world_from_origin{1.0};     // where the set has it
  std::optional<StatedDistance> stated;  // gives all lengths; else the tags' stated sizes do
  // What is known of the lens, which is then unknown, too. Absent: it is held.
  std::optional<LensPrior> lens_prior = std::nullopt;
};

struct SurveyedTag {
  int id = 0;
  // Stated: what was given. Measured where the others contradict that.
  double stated_size_m = 0, size_m = 0;
  double size_sigma = 0;  // standard deviation of the size, as a share of it, were it unknown
  glm::dmat4 world_from_tag{1.0};
  // Row-major 6x6, rotation (rad) then shift (m) along the tag's own axes, against the origin.
  std::array<double, 36> covariance{};
  double position_sigma_m = 0, rotation_sigma_rad = 0;  // along the longest axes
  int pictures = 0;                                     // that its place is based on
  double views_rad = 0;  // largest angle between two directions from which it was seen
  double rms_px = 0;     // of its corners' distances
};

struct TagSurvey {
  std::vector<SurveyedTag> tags;
  std::vector<MovedTag> moved;          // left out of the map
  std::vector<std::vector<int>> apart;  // groups of tags that no picture links to the origin
  double size_factor = 1;  // all lengths were multiplied by it, to have the stated distance
  std::size_t pictures = 0, sightings = 0, sightings_used = 0;
  std::size_t pictures_of_pairs = 0;  // that link two tags and no more
  double rms_px = 0;                  // of the used corners' distances
  double model_error_px = 0;          // of a coordinate, beside the noise of the picture
  PinholeIntrinsics lens;             // as given, or as it was adjusted
  // Of the lens's parameters, from boards and tags, were all of them free; 0 of a lens that is
  // held.
  LensMatrix lens_covariance = LensMatrix::zeros();
  double prior_chi_square = 0;  // of the adjusted lens against its prior, of 9 degrees of freedom
};

// Adjusts the tags' places and the camera's poses together (start_of_tags, adjust_tags):
//   sizes   are left free first: one that the others contradict by 1.5 % and by 4 standard
//           deviations is taken as it is measured. Then all are held.
//   moved   the walk is cut in two where two places of a tag explain it better than one; it has
//           moved if its corners move by more than 1 px and 4.5 standard deviations. A tag a third
//           of whose sightings disagree without that does not stay in one place. The worst is left
//           out, and everything is adjusted and looked at again.
//           (In a map that hangs together by a chain of pairs alone, what bending the chain
//           explains as well is not found; the covariances are large there.)
//   the rest is adjusted by least squares, without sightings that are off by more than 1 px and 4.5
//           standard deviations.
//   lens    with a prior, it is adjusted with everything from the second step on. Last, the model
//   is
//           chosen among those of the observer's calibration, by the Bayesian information criterion
//           (Schwarz 1978) of boards and tags together; none that folds within the picture.
// Throws previz::Error if the origin is not there, or moved; if the tags of the stated distance are
// not there; and if most tags seem to have moved or the rms is what the tracker refuses, as with
// the calibration of another lens.
TagSurvey survey_tags(const TagWalk& walk, const PinholeIntrinsics& lens,
                      const TagSurveyOptions& options);

// Says what the walk lacks, in the words of the person who holds the camera; empty if the map is
// good enough. `wanted` are the tags that the map should have.
//   seen      every wanted tag is in a picture, and linked to the origin by pictures of two tags.
//   pictures  at least 4 of each tag: one alone is not checked by any other.
//   sides     they differ by 20 degrees: from one side, depth is taken from the size alone; not
//             where a tag is certain to a third of what follows.
//   certain   to 2 mm and a thousandth of the distance from the origin, and to half a degree (one
//             standard deviation); checked where the others hold. Where three tags or more are
//             not, and most pictures link two tags only, that is named instead: each link of a
//             chain of pairs adds its error to the next.
std::vector<std::string> missing_of_tags(const TagSurvey& survey, const std::vector<int>& wanted,
                                         int origin);

}  // namespace previz::calibrate
