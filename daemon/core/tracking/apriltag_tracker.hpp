// Finds the camera's pose from AprilTags of a known map: all of them in one joint PnP (P12).
#pragma once

#include <memory>

#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "drivers/calibration.hpp"

namespace previz::tracking {

// Frames must have the lens's size; `response` is the camera's; it is inverted before corners are
// measured. Throws previz::Error naming the key where the family is unknown, a tag's size is not
// positive, an id is used twice, or the lens has no size or focal length.
//
// If two poses explain a picture about equally well (one tag seen face on, a small flat map), the
// pose is ambiguous unless only one of them lies within reach (3 rad/s) of a pose tracked at most
// 0.5 s before. A frame that follows a tracked one is searched at `settings.decimate`, and again at
// full resolution if no pose is found or a carrier of the previous frame is missing; every other
// frame is searched at full resolution. Carriers are found by the same rules, each by its own
// tags.
//
// `search` says where frames are searched that follow a tracked one. With Search::parts these are
// the parts where tags are expected, at full resolution, and a strip more (see search_plan.hpp), in
// several threads: a tag of the stage is found in the first frame that shows it whole, unless the
// camera's velocity changes by more than a 64th of the picture's width a frame; any other tag
// within sweep_pictures frames. The frame is searched whole, as described above, if that shows no
// pose or lacks most of the tags of the previous frame, and also if it lacks one of them or a
// carrier, this at most every eighth frame. What is found depends on the frames before, so that
// offline work searches all of each frame.
enum class Search { whole, parts };
std::unique_ptr<Tracker> make_apriltag_tracker(const set::Tracking& settings,
                                               const PinholeIntrinsics& intrinsics,
                                               const ResponseCurve& response = {},
                                               Search search = Search::whole);

}  // namespace previz::tracking
