// What the overlay says: from the rig's state to a crew's words. No clock: the caller decides when.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/output/osd_page.hpp"
#include "daemon/pipeline/shot.hpp"
#include "daemon/report/report.hpp"
#include "daemon/rig/controls.hpp"

namespace previz::rig {

// What the overlay says of the picture on the screen.
struct PictureFacts {
  int samples = 0;        // per pixel; 0: the camera's picture as it is
  double error = 0;       // over the picture's mean radiance; 0: not estimated
  std::string untouched;  // why it is the camera's own; empty: it was rendered
  tracking::TrackStatus tracking = tracking::TrackStatus::lost;
  int tags = 0;             // that the pose is made of
  double deviation_mm = 0;  // of the camera's place, a standard deviation; 0: not known
  std::string tracking_trouble;
};
PictureFacts facts_of(const pipeline::Shot& shot);

// How the pictures shown lately came.
struct Pace {
  double fps = 0;        // 0: none
  double latency_s = 0;  // capture to display
};

// What the overlay says of everything else.
struct RigFacts {
  Look look;
  std::string take;       // of the running recording
  double recorded_s = 0;  // of it
  std::uint64_t frames_lost = 0;
  std::string recorder_fault;
  std::optional<std::uint64_t> free_bytes;  // for takes, before the reserve; none: not known
  std::vector<report::Notice> news;         // what buttons and the rig itself did, oldest first
  std::vector<report::Notice> troubles;     // of devices
};

// `picture` is null before the first one.
output::OsdPage osd_page(const RigFacts& rig, const PictureFacts* picture, const Pace& pace);

}  // namespace previz::rig
