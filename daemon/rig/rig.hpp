// The running rig: opens a set's cameras, buttons and display, starts the live pipeline and the
// recorder, and carries out what buttons and bus ask for. It runs on the main thread's event loop.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/output/recorder.hpp"
#include "daemon/pipeline/channel.hpp"
#include "daemon/pipeline/metrics.hpp"
#include "daemon/report/reports.hpp"
#include "daemon/rig/button_desk.hpp"
#include "daemon/rig/cameras.hpp"
#include "daemon/rig/controls.hpp"
#include "daemon/rig/event_loop.hpp"
#include "daemon/rig/inbox.hpp"
#include "daemon/rig/live_pipeline.hpp"
#include "daemon/rig/osd.hpp"
#include "daemon/rig/review.hpp"
#include "daemon/rig/service.hpp"
#include "daemon/rig/set_keeper.hpp"

namespace previz::rig {

class Rig {
 public:
  struct Parts {  // outlive the rig
    EventLoop& loop;
    SetKeeper& sets;  // the rig runs its running set
    report::Reports& reports;
    pipeline::Metrics& metrics;
    std::shared_ptr<render::Device> device;
    std::shared_ptr<render::Renderer>& renderer;            // as LivePipeline's
    std::function<void(pipeline::Shot, const Look&)> show;  // on the pipeline's last thread
    std::function<void(RigFacts)> show_facts;               // facts for the overlay
    std::function<std::vector<std::unique_ptr<Buttons>>()> more_buttons;  // may be empty
    bool loop_cameras = false;
    std::stop_token stop;
  };

  // Opens the devices and starts; throws previz::Error on anything that keeps the set from running.
  explicit Rig(Parts parts);
  ~Rig();
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  // Runs until the observer's stream ends, a stop is requested, or SetKeeper::has_next(). Throws
  // what a stage threw.
  void run();

  // Call both on the loop's thread. `by` names who asks, for the log and the take: "button red".
  Outcome perform(const set::Action& action, const std::string& by);
  Outcome wish(Event event, const std::string& by);

  const Controls& controls() const { return controls_; }
  output::RecorderStatus recorder_status() const { return recorder_.status(); }
  // Called after controls, recorder or Reports::announced() have changed.
  void on_change(std::function<void()> changed) { changed_ = std::move(changed); }

 private:
  ButtonDesk::Asks asks_of_buttons();
  void know_picture();
  void take_inbox();
  void tick();
  void look_at_recorder();
  void resume(const std::string& take);
  void feed_watchdog();
  void show_facts();
  // Carries out the outcome's request, announces the result and returns it.
  Outcome apply(Outcome outcome, const std::string& by,
                report::Severity severity = report::Severity::info);
  // Returns why the request was not carried out, or nothing if it was.
  std::optional<std::string> carry_out(Request request);
  std::optional<std::string> change_set(int next);
  void publish_look();
  std::int64_t now_ns() const;  // the cameras' clock

  Parts parts_;
  const LoadedSet& loaded_;
  Cameras cameras_;
  Controls controls_;
  pipeline::Newest<Look> look_;
  Inbox inbox_;
  output::Recorder recorder_;
  std::optional<ButtonDesk> desk_;  // always there once the rig is made
  std::uint64_t finished_takes_ = 0, failures_ = 0;
  std::size_t salvaged_ = 0;  // takes of RecorderStatus::salvaged that were announced
  bool has_resumed_ = false;
  int ticks_ = 0;
  Progress progress_;  // when the watchdog was last fed
  std::unique_ptr<Review> review_;
  std::vector<std::unique_ptr<Review>> ended_reviews_;
  std::function<void()> changed_;
  std::optional<std::uint64_t> free_bytes_;
  LivePipeline pipeline_;  // last: its threads use all of the above
};

}  // namespace previz::rig
