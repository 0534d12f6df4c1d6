#include "daemon/core/tracking/apriltag_tracker.hpp"

#include <algorithm>
#include <cassert>
#include <set>
#include <thread>

#include "daemon/core/tracking/carrier_pose.hpp"
#include "daemon/core/tracking/search_plan.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "daemon/core/tracking/tag_map.hpp"
#include "drivers/error.hpp"

namespace previz::tracking {
namespace {

using Detections = std::vector<TagDetection>;

class AprilTagTracker final : public Tracker {
 public:
  AprilTagTracker(const set::Tracking& settings, const PinholeIntrinsics& lens,
                  const ResponseCurve& response, Search search)
      : settings_(settings),
        lens_(lens),
        search_(search),
        detector_({settings.family, settings.min_margin, settings.max_hamming, threads(search),
                   search == Search::whole ? Fit::exact : Fit::quick},
                  lens, response),
        stage_(settings.tags, lens, settings.ambiguity_ratio),
        plan_(lens.width, lens.height) {
    assert(lens.width > 0 && lens.height > 0 && lens.fx > 0 && lens.fy > 0);
    std::set<int> taken;
    for (const set::Tag& tag : settings.tags) taken.insert(tag.id);
    for (const set::Carrier& carrier : settings.carriers) {
      for (const set::Tag& tag : carrier.tags)
        if (!taken.insert(tag.id).second)
          throw Error("tracking.carriers: tag " + std::to_string(tag.id) + " of \"" + carrier.name +
                      "\" is in the set file twice");
      carriers_.push_back(
          {carrier.name, TagMap(carrier.tags, lens, settings.ambiguity_ratio), false, {}});
    }
  }

  Track track(const Frame& frame) override {
    if (const std::string mismatch = mismatch_of(frame); !mismatch.empty()) {
      reset_following();
      Track track;
      track.reason = mismatch;
      for (const Carrier& carrier : carriers_) track.carriers.push_back({carrier.name, {}, {}});
      return track;
    }
    stage_.forget_if_old(frame.timestamp_ns);
    for (Carrier& carrier : carriers_) carrier.map.forget_if_old(frame.timestamp_ns);

    std::optional<Track> in_parts;
    if (search_ == Search::parts && following_) in_parts = track_in_parts(frame);
    Track track = in_parts ? *std::move(in_parts) : track_in_whole(frame);
    following_ = track.pose.has_value();
    seen_ = track.seen_tags;
    if (track.pose) stage_.remember(*track.pose, frame.timestamp_ns);
    for (std::size_t i = 0; i < carriers_.size(); ++i) {
      carriers_[i].following = carriers_[i].found.has_value();
      if (carriers_[i].found) carriers_[i].map.remember(*carriers_[i].found, frame.timestamp_ns);
    }
    return track;
  }

  void leave_out(const std::set<int>& ids) override { stage_.leave_out(ids); }

  void reset() override {
    stage_.reset();
    for (Carrier& carrier : carriers_) carrier.map.reset();
    reset_following();
  }

 private:
  struct Carrier {
    std::string name;
    TagMap map;
    bool following;             // the previous frame showed the carrier
    std::optional<Pose> found;  // this picture's camera pose, in the carrier's frame
  };

  static int threads(Search search) {
    constexpr int most_threads = 4;
    return search == Search::whole
               ? 1
               : std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, most_threads);
  }

  Track track_in_whole(const Frame& frame) {
    plan_.searched_whole();
    const double decimate = following_ ? std::max(1.0, settings_.decimate) : 1.0;
    Track track = locate(detector_.detect(frame, decimate), frame.timestamp_ns);
    if (decimate > 1 && lacks_what_was_followed(track))
      track = locate(detector_.detect(frame, 1), frame.timestamp_ns);
    return track;
  }

  // Returns nothing if the whole frame is to be searched.
  std::optional<Track> track_in_parts(const Frame& frame) {
    std::vector<ExpectedTag> expected;
    stage_.expect(frame.timestamp_ns, detector_.printed_width(), expected);
    for (const Carrier& carrier : carriers_)
      carrier.map.expect(frame.timestamp_ns, detector_.printed_width(), expected);
    Track track = locate(detector_.detect(frame, plan_.next(expected)), frame.timestamp_ns);
    if (!track.pose) return std::nullopt;
    int wanted = 0, missing = 0;  // tags that the previous frame showed, and this one should
    for (const ExpectedTag& tag : expected) {
      if (!tag.is_inside || std::ranges::find(seen_, tag.id) == seen_.end()) continue;
      ++wanted;
      missing += std::ranges::find(track.seen_tags, tag.id) == track.seen_tags.end();
    }
    const bool lacks_some = missing > 0 || lacks_what_was_followed(track);
    if (2 * missing > wanted || (lacks_some && plan_.may_search_whole())) return std::nullopt;
    return track;
  }

  void reset_following() {
    following_ = false;
    for (Carrier& carrier : carriers_) carrier.following = false;
  }

  std::string mismatch_of(const Frame& frame) const {
    if (frame.width == lens_.width && frame.height == lens_.height &&
        frame.bytes.size() == frame_bytes(frame.format, frame.width, frame.height))
      return {};
    const auto size = [](int width, int height) {
      return std::to_string(width) + "x" + std::to_string(height);
    };
    if (frame.width == lens_.width && frame.height == lens_.height)
      return "the frame of " + size(frame.width, frame.height) + " has " +
             std::to_string(frame.bytes.size()) + " bytes, which are too few or too many";
    const bool is_turned = frame.width == lens_.height && frame.height == lens_.width;
    return "the frame is " + size(frame.width, frame.height) + ", the lens is calibrated for " +
           size(lens_.width, lens_.height) +
           (is_turned ? ": one of the two is turned by 90 degrees; turn the pictures as they were "
                        "when the lens "
                        "was calibrated, or calibrate it with pictures like these"
                      : ": calibrate it with pictures of this size");
  }

  bool lacks_what_was_followed(const Track& track) const {
    return !track.pose || std::ranges::any_of(carriers_, [](const Carrier& carrier) {
      return carrier.following && !carrier.found;
    });
  }

  Track locate(const Detections& detections, std::int64_t time_ns) {
    Track track = stage_.locate(detections, time_ns);
    std::vector<int> strangers;
    bool any_of_stage = false;
    for (const TagDetection& d : detections) {
      track.seen_tags.push_back(d.id);
      any_of_stage = any_of_stage || (stage_.has(d.id) && d.trouble.empty());
      if (!stage_.has(d.id) && !is_carried(d.id)) strangers.push_back(d.id);
    }
    if (!any_of_stage) {
      const auto add = [&](const std::string& text) { add_to_list(track.reason, text, "; "); };
      if (detections.empty()) add("no tag in the picture");
      if (!strangers.empty()) add("not in the set file: " + tags_in_words(strangers));
      if (track.reason.empty()) add("no tag of this set in the picture");
    }
    for (Carrier& carrier : carriers_)
      track.carriers.push_back(locate(carrier, detections, time_ns, track.pose));
    return track;
  }

  static CarrierTrack locate(Carrier& carrier, const Detections& detections, std::int64_t time_ns,
                             const std::optional<Pose>& camera) {
    Track among = carrier.map.locate(detections, time_ns);
    carrier.found = among.pose;
    CarrierTrack track{carrier.name, {}, std::move(among.reason)};
    if (camera && carrier.found) track.pose = carrier_pose(*camera, *carrier.found);
    if (!carrier.found && track.reason.empty()) track.reason = "none of its tags in the picture";
    return track;
  }

  bool is_carried(int id) const {
    return std::ranges::any_of(carriers_, [id](const Carrier& c) { return c.map.has(id); });
  }

  set::Tracking settings_;
  PinholeIntrinsics lens_;
  Search search_;
  TagDetector detector_;
  TagMap stage_;
  SearchPlan plan_;
  std::vector<int> seen_;  // tags of the previous frame
  std::vector<Carrier> carriers_;
  bool following_ = false;  // the previous frame was tracked
};

}  // namespace

std::unique_ptr<Tracker> make_apriltag_tracker(const set::Tracking& settings,
                                               const PinholeIntrinsics& intrinsics,
                                               const ResponseCurve& response, Search search) {
  return std::make_unique<AprilTagTracker>(settings, intrinsics, response, search);
}

}  // namespace previz::tracking
