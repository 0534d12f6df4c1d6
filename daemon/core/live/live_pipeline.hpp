// Runs the rig's stages for one set: cameras, tracking, lighting, rendering and display, each on a
// thread of its own, with mailboxes between them and the recorder beside them.
//
// What the cameras deliver goes to the recorder first, on the camera's own thread, before any stage
// sees it. Every other stage works under a StageKeeper: what it throws is reported, the stage rests
// and begins anew, and frames meanwhile pass it by (a picture without a pose, the light as it was,
// the plate alone). None of it ends the rig or a take. The stages stay in one process with the
// recorder: a process of the recorder's own would also outlive a crash of a graphics driver, but
// every frame would have to be handed over through shared memory, at up to a gigabyte a second, and
// the two would need a protocol, an order to start in and one to die in. What cannot be caught
// here, a crash or a hang, costs a take the frame in hand (the file system has the others), and the
// next process records on at once.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "daemon/core/live/cameras.hpp"
#include "daemon/core/live/inbox.hpp"
#include "daemon/core/live/live_render.hpp"
#include "daemon/core/live/look.hpp"
#include "daemon/core/live/pass_meter.hpp"
#include "daemon/core/output/recorder.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/pipeline/stage_keeper.hpp"
#include "daemon/core/render/renderer.hpp"
#include "daemon/core/report/reports.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::live {

class LivePipeline {
 public:
  struct Parts {  // all of them outlive the pipeline
    const set::Set& set;
    Cameras& cameras;
    const scene::Scene& scene;
    std::shared_ptr<render::Device> device;
    std::shared_ptr<render::Renderer>& renderer;  // the set's before, then this one's; may be null
    output::Recorder& recorder;
    const pipeline::Newest<Look>& look;
    Inbox& inbox;
    pipeline::StageKeeper::Parts kept;
    LiveRender::Wants wants = {};              // on the render thread
    std::function<void(pipeline::Shot)> show;  // on the display's thread
  };

  // Throws previz::Error on anything that keeps the set from running; then no thread is left
  // running.
  LivePipeline(Parts parts, std::stop_token stop);
  ~LivePipeline();  // stops it
  LivePipeline(const LivePipeline&) = delete;
  LivePipeline& operator=(const LivePipeline&) = delete;

  // Waits for every stage to end, after Inbox::finish, then rethrows the first exception that no
  // keeper has caught.
  void wait();

  pipeline::Mailbox<pipeline::Shot>& reviewed();  // a review pushes its frames here
  // Returns the lamps that were found in the light of the last picture.
  std::vector<pipeline::FoundLamp> found_lamps() const;
  // Returns the step that holds quality.fps, with the samples per pixel; 0 samples if no picture
  // was held to it yet.
  set::PreviewStep governed() const;
  // Returns what the last picture of a take in review was recorded with.
  pipeline::RecordedLook recorded_look() const;
  // Returns what each pass takes, while Look::pass_times asks for it and pictures are rendered.
  std::optional<PassTimes> pass_times() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::live
