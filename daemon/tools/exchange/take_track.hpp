// Finds the poses of a take's frames without rendering, as `previz track` does.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/tracking/pose_judgement.hpp"
#include "daemon/core/tracking/tracker.hpp"

namespace previz::exchange {

// A frame as `previz render` would track it.
struct TrackedFrame {
  session::TrackRecord record;
  tracking::TrackStatus status = tracking::TrackStatus::lost;
  double reprojection_rms_px = 0;  // if tracked
  std::string reason;              // as tracking::Track::reason
  std::vector<int> seen_tags;
};

// Tracks the frames of the take for which `wanted` returns true, in order, by the take's set; a
// frame that cannot be read is left out and named to `note`. `judgement` is given every frame,
// unless it is null. A stop ends it early. Throws previz::Error as pipeline::TrackStage does.
std::vector<TrackedFrame> track_frames(const pipeline::Take& take,
                                       const std::function<bool(std::uint64_t)>& wanted,
                                       const std::function<void(const std::string&)>& note,
                                       const std::stop_token& stop,
                                       tracking::PoseJudgement* judgement = nullptr);

// Returns the frame as a line of JSON: frame, timestamp_ns, tracked, tags_seen; if tracked also
// world_from_camera (4 rows of 4, as FRAMES.json has it), covariance, tags and
// reprojection_rms_px, otherwise reason; and carriers that were found, by name, each with
// world_from_carrier, covariance and tags.
std::string to_json(const TrackedFrame& frame);

struct TrackOptions {
  std::filesystem::path session;
  std::optional<std::filesystem::path> set_file;  // instead of the session's own
  std::optional<std::filesystem::path> out;       // gets a line a frame, to_json()
  bool any_paths = false;                         // as post::RenderOptions has it
  std::stop_token stop;
};
// Tracks every frame and prints how many were found, how well, by which tags, why the others were
// not, and what of it does not hold (tracking/pose_judgement.hpp). Returns 0; 1 if no frame was
// tracked.
int track_take(const TrackOptions& options, std::ostream& out);

}  // namespace previz::exchange
