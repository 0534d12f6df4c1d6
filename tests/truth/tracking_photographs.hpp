// Measures the tracker on real photographs and video (PREVIZ_SHARED/real, which is never part of
// this repository): ids found, false ids, and how well a known map explains them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/apriltag_tracker.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::truth {

struct RoomResult {
  int photographs = 0, listed = 0, found = 0, false_ids = 0;
  std::vector<std::string> missed;  // "IMG_1368.JPG: 13"
  int tracked = 0;
  std::vector<std::string> not_tracked;  // file and reason
  double rms_px = 0;                     // corners of the used tags, in the given map
};

// `apriltag/room` against the authors' list and the given map, without tag 13, which moved.
RoomResult measure_room(const std::filesystem::path& apriltag, double decimate,
                        const ResponseCurve& response = {});

// Returns the number of tags of one family in a picture (hamming <= 1).
int count_tags(const std::filesystem::path& picture, const std::string& family, double min_margin);

struct VideoResult {
  int frames = 0, with_both = 0, tracked = 0;
  double rms_px = 0;
  double jitter_m = 0;        // second difference of the camera's place over sqrt(6), rms
  double shown_jitter_m = 0;  // the same, of what a live picture shows
  double shown_off_px = 0, shown_worst_px = 0;  // shown against found, of the tags' middles
};

// `video/wall_tags3and4_1080p.mp4`: tag 3 is the map, tag 4 is put where the first frames see it.
struct WallVideo {
  PinholeIntrinsics lens;
  std::vector<Frame> frames;
  std::vector<set::Tag> tags;
};
WallVideo read_wall_video(const std::filesystem::path& video);

VideoResult measure_video(const WallVideo& wall, double decimate,
                          tracking::Search search = tracking::Search::whole);

}  // namespace previz::truth
