// Locates the camera among tags that are fixed relative to each other: the tags of the stage, or of
// a carrier, whose frame then stands for the world.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/joint_pose.hpp"
#include "daemon/core/tracking/search_plan.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "drivers/calibration.hpp"

namespace previz::tracking {

// Returns words like "tags 3, 5 and 8".
std::string tags_in_words(const std::vector<int>& ids);

// Returns what to say of tags that are more than once in so many pictures each, by their id: what a
// picture is called ("frame"), and what is done with those tags. Empty if there are none.
std::string doubles_in_words(const std::map<int, std::size_t>& pictures, const std::string& picture,
                             const std::string& what_is_done);

// Remembers the last pose, which resolves what one picture leaves ambiguous.
class TagMap {
 public:
  // Throws previz::Error naming the key where a tag's size is not positive or an id is used twice.
  TagMap(const std::vector<set::Tag>& tags, const PinholeIntrinsics& lens, double ambiguity_ratio);

  bool has(int id) const { return tags_.contains(id); }

  // Returns the camera's pose from the detections that belong to this map. Fills neither seen_tags
  // nor carriers.
  Track locate(const std::vector<TagDetection>& detections, std::int64_t time_ns) const;
  // Uses these tags for no pose from now on (Tracker::leave_out()).
  void leave_out(std::set<int> ids) { left_out_ = std::move(ids); }
  void remember(const Pose& pose, std::int64_t time_ns);
  void forget_if_old(std::int64_t now_ns);
  void reset();

  // Adds where the tags of this map are likely to be in the picture at this time, if the camera
  // keeps its velocity: those that face the camera and lie in the picture, or nearly. A tag as
  // printed is `printed_width` times as wide as its border.
  void expect(std::int64_t time_ns, double printed_width, std::vector<ExpectedTag>& tags) const;

 private:
  bool within_reach(const FittedPose& fit, std::int64_t time_ns) const;
  CameraFromWorld expected_pose(std::int64_t time_ns) const;
  std::optional<ExpectedTag> expect(const set::Tag& tag, const CameraFromWorld& pose,
                                    double printed_width) const;
  void choose(const std::vector<FittedPose>& poses, const std::vector<TagObservation>& tags,
              std::int64_t time_ns, Track* track) const;

  PinholeIntrinsics lens_;
  double ambiguity_ratio_;
  double farthest_ray_;  // that may be in the picture, from the axis on the plane z = 1
  std::map<int, set::Tag> tags_;
  std::set<int> left_out_;
  std::optional<CameraFromWorld> last_, before_last_;
  std::int64_t last_time_ns_ = 0, before_last_time_ns_ = 0;
};

}  // namespace previz::tracking
