// Judges the tracking of a take by what its pictures show: residuals, tags that are not used, and
// pictures without tags.
#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/joint_pose.hpp"
#include "daemon/core/tracking/tag_trust.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::tracking {

// A frame whose tags are looked at again.
struct JudgedFrame {
  std::vector<TagObservation> tags;
  CameraFromWorld pose;  // if it was tracked
  FittedPose fit;        // of all tags, by the picture's noise alone; if it was tracked
};

// Is given every frame of a take, or some of them, and keeps at most a few dozen. The frames of a
// tracker that looks at no pictures have no tags, and are not judged.
class PoseJudgement {
 public:
  PoseJudgement(const set::Tracking& tracking, const ObserverCalibration& camera);

  void add(const FramePtr& frame, const Track& track);

  // Returns what does not hold, in sentences of their own, with the likely cause of each and what
  // to do; empty if all is well, or once `stop` is requested. Of tags on frames it takes up to 2 s
  // (8 frames of 60 tags), of pictures without tags up to 5 s (other_tags()).
  //   residuals  The corners of at least one in twenty tracked frames are farther off than the
  //              noise of their picture leaves them in one picture of a million (chi-square of 8 n
  //              - 6 degrees of freedom), and by more than kWorthAWordPx. The cause is the factor
  //              of all sizes, the factor of the focal length, or the motion while rows are read
  //              that takes most of it away.
  //   tags       One that is in a picture twice; one that disagrees with the others, and why
  //              (TagTrust); all that disagree, if a factor of all sizes or of the focal length
  //              makes them agree.
  //   none       No picture shows a tag of the family: what they hold instead (other_tags()).
  std::vector<std::string> doubts(const std::stop_token& stop = {}) const;

  // Two of doubts(), each empty if there is none: what residuals say, and what a factor says of
  // tags that disagree. Once `stop` is requested they are of no use.
  std::string doubt_about_residuals(const std::stop_token& stop) const;
  std::string doubt_about_lost(const std::stop_token& stop) const;

  // Returns why the corners of a tag could be used in no tracked frame ("cut by the picture's
  // border in 3 frames"); empty: they could be.
  std::string why_unusable(int id) const;

 private:
  std::string doubt_about_none(const std::stop_token& stop) const;

  set::Tracking tracking_;
  ObserverCalibration camera_;
  std::size_t frames_ = 0, tracked_ = 0, judged_ = 0, doubtful_ = 0, at_odds_ = 0;
  std::vector<JudgedFrame> worst_;            // of the doubtful ones
  std::vector<JudgedFrame> lost_;             // whose tags disagree
  std::vector<double> rms_px_, expected_px_;  // of the doubtful ones
  std::map<int, std::size_t> doubles_;        // frames in which a tag is more than once
  TagTrust trust_;
  std::set<int> measured_;                                      // in tracked frames
  std::map<int, std::map<std::string, std::size_t>> unusable_;  // frames, by the reason
  bool has_seen_a_tag_ = false;
  std::vector<FramePtr> without_tags_;
};

}  // namespace previz::tracking
