// Finds the tags of the stage that are not where the set has them, by what the others say.
#pragma once

#include <cmath>
#include <deque>
#include <map>
#include <set>
#include <string>

#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/tag_place.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "drivers/calibration.hpp"

namespace previz::tracking {

// Lenses and paper are off their models by as much in a good set (calibrate::TagAdjustment).
inline constexpr double kWorthAWordPx = 0.3;

// Returns what a chi-square exceeds once in a million times.
double rare_chi_square(int degrees);

// Judges a tag in every frame whose pose at least two others agree on, and most of all in the
// frame. A tag disagrees that the pose leaves out and that is farther off than the covariances of
// its corners and of the pose allow, and than kWorthAWordPx. Two tags that disagree with each other
// say nothing of either. Takes microseconds a tag; keeps eight views of each that disagrees.
class TagTrust {
 public:
  // A frame counts less the more of `memory_frames` judgements of a tag came after it.
  TagTrust(const set::Tracking& tracking, const PinholeIntrinsics& lens,
           double memory_frames = HUGE_VAL);

  void add(const Track& track);

  // Returns the tags that disagree in most frames that judge them, in about this many at least.
  std::set<int> moved(int frames = 1) const;

  // Returns "is 10.0 mm off ..." of a moved tag (why_elsewhere()), within milliseconds.
  std::string words(int id) const;

 private:
  struct Judged {
    double agrees = 0, disagrees = 0;  // frames
    std::deque<TagView> views;         // of the newest that disagree
  };
  bool disagrees(const TagObservation& tag, const Pose& pose) const;

  set::Tracking tracking_;
  PinholeIntrinsics lens_;
  double kept_;  // share of a count that is left after another judgement
  std::map<int, Judged> judged_;
};

}  // namespace previz::tracking
