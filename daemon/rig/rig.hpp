// The running rig: opens a set's cameras, buttons and display, starts the live pipeline and the
// recorder, and carries out what buttons and bus ask for. It runs on the main thread's event loop.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/core/live/cameras.hpp"
#include "daemon/core/live/inbox.hpp"
#include "daemon/core/live/live_pipeline.hpp"
#include "daemon/core/output/recorder.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/report/reports.hpp"
#include "daemon/rig/button_desk.hpp"
#include "daemon/rig/controls.hpp"
#include "daemon/rig/event_loop.hpp"
#include "daemon/rig/live_guides.hpp"
#include "daemon/rig/osd.hpp"
#include "daemon/rig/review.hpp"
#include "daemon/rig/service.hpp"
#include "daemon/rig/set_keeper.hpp"

namespace previz::rig {

// The take that was recorded last, by this rig or one before it.
struct KeptTake {
  std::filesystem::path directory;  // empty: none yet
  std::string set_text;             // that it was recorded with
  bool is_good = false;
};

class Rig {
 public:
  struct Parts {  // outlive the rig
    EventLoop& loop;
    SetKeeper& sets;  // the rig runs its running set
    pipeline::StageKeeper::Parts kept;
    Service& service;
    pipeline::Liveness::Pulse& pulse;  // the main thread's
    std::shared_ptr<render::Device> device;
    std::shared_ptr<render::Renderer>& renderer;  // as LivePipeline's
    // Shows a picture and the lines over it, on the pipeline's last thread.
    std::function<void(pipeline::Shot, const live::Look&, GuidesOf)> show;
    live::LiveRender::Wants wants;                                        // on the render thread
    std::function<void(RigFacts)> show_facts;                             // facts for the overlay
    std::function<std::vector<std::unique_ptr<Buttons>>()> more_buttons;  // may be empty
    std::function<void(live::Cameras&)> around_cameras;  // as LiveOptions'; may be empty
    bool loop_cameras = false;
    KeptTake& last_take;  // of the rig before; run() leaves the last one in it
    std::stop_token stop;
  };

  // Opens the devices and starts; throws previz::Error on anything that keeps the set from running.
  explicit Rig(Parts parts);
  ~Rig();  // closes the take, then gives back the devices
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  // Runs until the observer's stream ends, a stop is requested, or SetKeeper::has_next(). The take
  // is closed first at the end, whatever devices do, then the pipeline is waited for. Throws what
  // no stage's keeper has caught.
  void run();

  // Call both on the loop's thread. `by` names who asks, for the log and the take: "button red".
  Outcome perform(const set::Action& action, const std::string& by);
  Outcome wish(live::Event event, const std::string& by);
  // Does what perform() does; what became of a snapshot is answered once it is known, on the loop's
  // thread.
  using Answered = std::function<void(const Outcome&)>;
  void perform(const set::Action& action, const std::string& by, Answered answered);

  const Controls& controls() const { return controls_; }
  // Returns the samples per pixel that the preview has now.
  int samples() const;
  output::RecorderStatus recorder_status() const { return recorder_.status(); }
  // Returns how long ago the last picture was shown; nothing before the first.
  std::optional<double> picture_age_s() const;
  // Returns how far the model is from the pictures; nothing while the guides are off.
  std::optional<fit::Figure> model_fit() const { return guides_.figure(); }
  // Called after controls, recorder or Reports::announced() have changed.
  void on_change(std::function<void()> changed) { changed_ = std::move(changed); }

 private:
  ButtonDesk::Asks asks_of_buttons();
  void know_picture();
  void know_take();
  void keep_take();
  void take_inbox();
  void take_snapshots();
  void look_at_snapshots();
  void answer_snapshot(const Outcome& outcome);
  void tick();
  void leave_if_stopped();
  bool ends() const;
  void look_at_set();
  void look_at_review();
  void announce_faults();
  void close_take();
  void look_at_folders();
  void look_at_recorder();
  void announce_salvaged(const std::vector<std::string>& salvaged);
  void resume(const std::string& take);
  void show_facts();
  // Carries out the outcome's request, announces the result and returns it.
  Outcome apply(Outcome outcome, const std::string& by,
                report::Severity severity = report::Severity::info);
  // Returns why the request was not carried out, or nothing if it was or will be.
  std::optional<std::string> carry_out(Request request, const std::string& by);
  std::optional<std::string> read_set(const std::function<void()>& begin, const std::string& by);
  std::optional<std::string> take_set(std::chrono::milliseconds patience);
  void look_at_guides();
  void show_picture(pipeline::Shot shot);
  void publish_look();
  std::int64_t now_ns() const;  // the cameras' clock

  Parts parts_;
  const LoadedSet& loaded_;
  live::Cameras cameras_;
  Controls controls_;
  pipeline::Newest<live::Look> look_;
  live::Inbox inbox_;
  output::Recorder recorder_;
  pipeline::Metrics::Watch recorder_watch_, folders_watch_, inbox_watch_;
  std::optional<ButtonDesk> desk_;  // always there once the rig is made
  std::uint64_t finished_takes_ = 0, failures_ = 0;
  bool is_good_ = false;      // the last take was marked good
  std::size_t salvaged_ = 0;  // takes of RecorderStatus::salvaged that were announced
  bool has_resumed_ = false;
  int ticks_ = 0;
  std::optional<std::chrono::steady_clock::time_point> stopped_;  // when the stop was noticed
  bool is_take_closed_ = false;
  std::atomic<std::chrono::steady_clock::time_point> shown_at_{};
  bool are_lamps_judged_ = false;  // by the exposure of the first picture that was shown
  std::string reading_for_;  // who wants the set that is being read; empty: its file has changed
  std::string announced_;    // the last announcement that the bus knows of
  std::string fit_said_;     // the last figure that the bus knows of, in words
  struct AwaitedSnapshot {
    std::chrono::steady_clock::time_point asked;
    Answered answered;  // empty: nobody waits for an answer
  };
  std::deque<AwaitedSnapshot> snapshots_;
  std::unique_ptr<Review> review_;  // at most one, even if it takes long to end
  std::function<void()> changed_;
  std::optional<std::uint64_t> free_bytes_;
  const PinholeIntrinsics lens_;
  pipeline::Newest<std::optional<live::Aim>> aim_{
      std::nullopt};  // of the picture that was shown last
  // When each button went down: whether a press is short, long or double is known only later.
  std::map<std::string, std::optional<live::Aim>> pressed_aims_;
  LiveGuides guides_;
  live::LivePipeline pipeline_;  // last: its threads use all of the above
};

}  // namespace previz::rig
