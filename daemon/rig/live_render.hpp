// The render thread of the rig: a picture of each new frame, or rounds of refining the last good
// one, as the desk says.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>

#include "daemon/pipeline/channel.hpp"
#include "daemon/pipeline/governor.hpp"
#include "daemon/pipeline/metrics.hpp"
#include "daemon/pipeline/render_stage.hpp"
#include "daemon/pipeline/shot.hpp"
#include "daemon/rig/controls.hpp"
#include "daemon/rig/inbox.hpp"

namespace previz::rig {

class LiveRender {
 public:
  struct Channels {
    pipeline::Mailbox<pipeline::Shot>& tracked;         // of the camera
    pipeline::Mailbox<pipeline::Shot>& reviewed;        // of a take, with their light
    pipeline::BoundedQueue<pipeline::Shot>& snapshots;  // out: with layers
  };

  // The stage must ask interrupted().
  LiveRender(const set::Set& set, const pipeline::Newest<Look>& look, Inbox& inbox,
             pipeline::Metrics& metrics, Channels channels, std::stop_token stop);

  void use(pipeline::RenderStage& stage) { stage_ = &stage; }

  // Returns the next picture to show; nothing once the camera's frames have ended. If the device is
  // lost meanwhile, `renew` is called; it returns true once there is another stage to use(), and
  // false if a stop came first. A refinement's rounds grow: first the preview's samples, then as
  // many again as there are, at most 64 and what takes about a second.
  std::optional<pipeline::Shot> next(const std::function<bool(const render::DeviceLost&)>& renew);

  // Counts the frames that a newer one took the place of since the last call; next() does it too.
  void count_dropped() { drops_.update(); }

  // True if what is being rendered is no longer wanted; from the render thread.
  bool interrupted() const;

 private:
  std::optional<pipeline::Shot> next_picture();
  void save_refined(const Look& look);
  void save(const pipeline::Shot& shot);
  std::optional<pipeline::Shot> refine_round(const Look& look);
  int next_round(const Look& look) const;
  bool begin_refinement(const Look& look);
  std::optional<pipeline::Shot> wait_for_frame(const Look& look);
  pipeline::Shot render(const Look& look, pipeline::Shot shot);
  void keep_as_good(const pipeline::Shot& shot, bool reviewed);

  const set::Set& set_;
  const pipeline::Newest<Look>& look_;
  Inbox& inbox_;
  pipeline::Metrics& metrics_;
  Channels channels_;
  const std::stop_token stop_;
  pipeline::RenderStage* stage_ = nullptr;
  std::optional<pipeline::Governor> governor_;
  std::optional<pipeline::Shot> good_;     // the last one with pose and light: its frame only
  bool good_is_reviewed_ = false;          // and so its scene is the take's, not the rig's
  std::optional<pipeline::Shot> refined_;  // the last round's, with layers, until the next begins
  bool refining_ = false;
  pipeline::Edits refined_edits_;
  double sample_s_ = 0;  // that a sample of a refinement took last; 0: not known
  pipeline::DropCount<pipeline::Shot> drops_;
  std::uint64_t snapshots_ = 0, refined_snapshots_ = 0, refinements_ = 0;  // of the look's, done
};

}  // namespace previz::rig
