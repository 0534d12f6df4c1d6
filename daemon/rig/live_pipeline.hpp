// Runs the rig's stages for one set: cameras, tracking, lighting, rendering and display, each on a
// thread of its own, with mailboxes between them and the recorder beside them.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <stop_token>
#include <string>

#include "daemon/output/recorder.hpp"
#include "daemon/pipeline/channel.hpp"
#include "daemon/pipeline/metrics.hpp"
#include "daemon/pipeline/shot.hpp"
#include "daemon/render/renderer.hpp"
#include "daemon/report/reports.hpp"
#include "daemon/rig/cameras.hpp"
#include "daemon/rig/controls.hpp"
#include "daemon/rig/inbox.hpp"
#include "daemon/scene/scene.hpp"

namespace previz::rig {

// Counts and reports anything odd about a picture that is to be shown.
void count_picture(const pipeline::Shot& shot, pipeline::Metrics& metrics,
                   report::Reports& reports);

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
    report::Reports& reports;
    pipeline::Metrics& metrics;
    std::function<void(pipeline::Shot)> show;  // on the display's thread
  };

  // Throws previz::Error on anything that keeps the set from running; then no thread is left
  // running.
  LivePipeline(Parts parts, std::stop_token stop);
  ~LivePipeline();  // stops it
  LivePipeline(const LivePipeline&) = delete;
  LivePipeline& operator=(const LivePipeline&) = delete;

  // Waits for every stage to end, after Inbox::finish, then rethrows the exception of the first
  // stage that failed.
  void wait();

  pipeline::Mailbox<pipeline::Shot>& reviewed();  // a review pushes its frames here
  // Returns the lamps that were found in the light of the last picture.
  std::vector<pipeline::FoundLamp> found_lamps() const;
  // Returns the variants, by object, that the last picture of a take in review was recorded with.
  std::map<std::string, std::string> recorded_variants() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::rig
