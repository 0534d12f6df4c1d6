// Measures the tracker on real photographs and video (PREVIZ_SHARED/real, which is never part of
// this repository): ids found, false ids, and how well a known map explains them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/set/set.hpp"
#include "daemon/tracking/apriltag_tracker.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::truth {

struct RoomResult {
  int photographs = 0, listed = 0, found = 0, false_ids = 0;
  std::vector<std::string> missed;  // "IMG_1368.JPG: 13"
  double least_margin = 0;          // of all true detections
  int refined = 0, refused = 0;     // corners measured; ids whose corners may not be used
  int tracked = 0, ambiguous = 0, lost = 0;
  std::vector<std::string> not_tracked;  // file and reason
  std::vector<std::string> left_out;     // file and reason, of tracked ones
  double rms_px = 0, worst_px = 0;       // corners of the used tags, in the given map
  double library_rms_px = 0;             // libapriltag's own corners under these poses
  int poses_of_several = 0;
  double several_rms_px = 0;  // the same, of photographs with two tags or more
};

// `apriltag/room` against the authors' list and the given map, without tag 13, which moved.
RoomResult measure_room(const std::filesystem::path& apriltag, double decimate,
                        const ResponseCurve& response = {});

struct CountResult {
  int tags = 0, refined = 0;
  double least_margin = 0, most_margin = 0;  // 0 where there are none
};

// Every tag of one family in one picture, whatever its margin is (hamming <= 1).
CountResult count_tags(const std::filesystem::path& picture, const std::string& family,
                       double min_margin);

struct VideoResult {
  int frames = 0, with_both = 0, tracked = 0, ambiguous = 0;
  double rms_px = 0;
  double jitter_m = 0;        // second difference of the camera's place over sqrt(6), rms
  double shown_jitter_m = 0;  // the same, of what a live picture shows
  double shown_off_px = 0, shown_worst_px = 0;  // shown against found, of the tags' middles
  double milliseconds = 0;
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
