// The light of the live pictures: estimated from the light camera on threads of its own, or as the
// set gives it.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "daemon/pipeline/channel.hpp"
#include "daemon/pipeline/light_feed.hpp"
#include "daemon/pipeline/light_stage.hpp"
#include "daemon/pipeline/metrics.hpp"
#include "daemon/report/reports.hpp"
#include "daemon/rig/controls.hpp"

namespace previz::rig {

class LiveLight {
 public:
  struct Parts {  // outlive the light
    const set::Set& set;
    const pipeline::Newest<Look>& look;
    report::Reports& reports;
    pipeline::Metrics& metrics;
  };

  // Throws previz::Error as pipeline::LightStage does.
  LiveLight(Parts parts, const std::optional<LightCameraCalibration>& calibration,
            const ObserverCalibration& observer);

  // True where the light is made of the light camera's frames.
  bool needs_frames() const { return stage_.needs_frames(); }

  // Holds the first light back until a whole bracket was seen; see LightStage::await_bracket().
  void await_bracket(std::size_t exposures) { stage_.await_bracket(exposures); }

  // Adds the stages of the light camera. `next_frame` waits for its frames, in order; null ends
  // them. They are taken off the camera also where nobody needs them: they may be recorded.
  void start(pipeline::StageThreads& stages, std::function<FramePtr()> next_frame);

  // From the tracking stage, for a tracked shot: the newest light there is, without waiting.
  pipeline::LightPtr light_for(const pipeline::Shot& shot, set::LightMode mode);
  // The film camera's picture fills in what the light camera cannot see, if the set wants that.
  void see_observer(pipeline::Shot& shot);

 private:
  pipeline::LightPtr estimate(std::vector<pipeline::LightFrame> frames,
                              const std::optional<pipeline::ObserverView>& view);

  const Parts parts_;
  pipeline::LightStage stage_;
  pipeline::LightFeed feed_;
  pipeline::LightPtr last_;  // the last estimate
};

}  // namespace previz::rig
