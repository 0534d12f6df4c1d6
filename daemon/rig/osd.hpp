// Turns the state of the rig into the words of the overlay. The functions are pure; the caller
// decides when to show the words.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/fit/figure.hpp"
#include "daemon/core/live/pass_meter.hpp"
#include "daemon/core/output/osd_page.hpp"
#include "daemon/core/output/record_queue.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/report/report.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/rig/controls.hpp"

namespace previz::rig {

// Facts about the picture on the screen.
struct PictureFacts {
  int samples = 0;            // per pixel; 0: the plate alone is shown
  int history = 0;            // earlier frames that the picture shares samples with
  int width = 0, height = 0;  // of the rendered picture; 0: not shown
  double error = 0;           // over the picture's mean radiance; 0: not estimated
  std::string untouched;      // why the plate alone is shown; empty: it was rendered
  tracking::TrackStatus tracking = tracking::TrackStatus::lost;
  int tags = 0;             // used for the pose
  double held_s = 0;        // time since a pose was found, if an expected one is shown; 0: none is
  double deviation_mm = 0;  // standard deviation of the camera's position; 0: not known
  std::string tracking_trouble;
};
PictureFacts facts_of(const pipeline::Shot& shot);

// Frame rate and delay of the last pictures.
struct Pace {
  double fps = 0;        // 0: none
  double latency_s = 0;  // capture to display
};

// Facts about the rig apart from the picture.
struct RigFacts {
  live::Look look;
  std::string take;          // name of the take that is being recorded
  double recorded_s = 0;     // its length so far
  session::Losses lost;      // since the take began
  output::Backlog backlog;   // of the recording
  double disk_silent_s = 0;  // for how long the disk has not answered a write
  std::string recorder_fault;
  std::string device;                       // that draws; empty: none, or not known
  std::optional<std::uint64_t> free_bytes;  // for takes, without the reserve; none: not known
  std::vector<report::Notice> news;         // actions of buttons and of the rig, oldest first
  std::vector<report::Notice> troubles;     // troubles of devices
  std::optional<live::PassTimes>
      pass_times;                  // none: nothing was rendered since they were asked for
  std::optional<fit::Figure> fit;  // of the model; none: the guides are off
};

// Returns "model 0.3 px (90 % 0.8)", or what is wrong: that a thing of the model or all of it is
// off, or why there is no figure.
std::string words_of(const fit::Figure& figure);

// Returns the overlay's words. `picture` is null before the first picture.
output::OsdPage osd_page(const RigFacts& rig, const PictureFacts* picture, const Pace& pace);

}  // namespace previz::rig
