// Provides the light of the live pictures, estimated from the light camera on threads of its own or
// given by the set.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "daemon/core/live/look.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/light_feed.hpp"
#include "daemon/core/pipeline/light_stage.hpp"
#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/pipeline/stage_keeper.hpp"
#include "daemon/core/report/reports.hpp"

namespace previz::live {

class LiveLight {
 public:
  struct Parts {  // outlive the light
    const set::Set& set;
    const scene::Scene& scene;
    const pipeline::Newest<Look>& look;
    pipeline::StageKeeper::Parts kept;
    bool has_camera = true;  // the set has a light camera
  };

  // Throws previz::Error as pipeline::LightStage does, and without the light camera that it needs.
  LiveLight(Parts parts, const std::optional<LightCameraCalibration>& calibration,
            const ObserverCalibration& observer);

  // True if the light is made from the light camera's frames.
  bool needs_frames() const { return needs_frames_; }

  // Holds the first light back until a whole bracket was seen, also after a failure; see
  // LightStage::await_bracket(). Call it before start().
  void await_bracket(std::size_t exposures) {
    bracket_ = exposures;
    stage_->await_bracket(exposures);
  }

  // Adds the stages of the light camera. `next_frame` waits for the next frame; null ends the
  // stream. Frames are taken even if lighting does not need them, because they may be recorded, and
  // never wait for an estimate. An estimate that fails leaves the light as it was.
  void start(pipeline::StageThreads& stages, std::function<FramePtr()> next_frame);

  // Returns the newest light for a tracked shot, without waiting. The tracking stage calls it.
  // Where the set gives the light, it may throw what the light stage does.
  pipeline::LightPtr light_for(const pipeline::Shot& shot, set::LightMode mode);
  // Lets the film camera's picture fill in what the light camera cannot see, if the set asks for
  // that.
  void see_observer(pipeline::Shot& shot);

 private:
  pipeline::LightPtr estimate(std::vector<pipeline::LightFrame> frames,
                              const std::optional<pipeline::ObserverView>& view);

  void update(std::vector<pipeline::LightFrame>& frames,
              const std::optional<pipeline::ObserverView>& view);

  const Parts parts_;
  std::size_t bracket_ = 1;  // exposures
  const std::function<void()> make_stage_;
  // One thread alone uses it: lighting if it needs frames, and tracking if it does not.
  std::optional<pipeline::LightStage> stage_;
  const bool needs_frames_, needs_observer_;
  const int observer_width_, observer_height_;
  pipeline::StageKeeper keeper_;
  pipeline::LightFeed feed_;
  pipeline::LightPtr last_;  // the last estimate
};

}  // namespace previz::live
