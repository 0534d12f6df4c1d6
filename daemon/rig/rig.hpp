// The rig running one set: desk, buttons, recorder and pipeline, on the main thread's event loop.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "daemon/output/recorder.hpp"
#include "daemon/pipeline/metrics.hpp"
#include "daemon/pipeline/newest.hpp"
#include "daemon/rig/cameras.hpp"
#include "daemon/rig/controls.hpp"
#include "daemon/rig/device_counts.hpp"
#include "daemon/rig/event_loop.hpp"
#include "daemon/rig/faults.hpp"
#include "daemon/rig/inbox.hpp"
#include "daemon/rig/live_pipeline.hpp"
#include "daemon/rig/loaded_set.hpp"
#include "daemon/rig/news_ticker.hpp"
#include "daemon/rig/notes.hpp"
#include "daemon/rig/osd.hpp"
#include "daemon/rig/press.hpp"
#include "daemon/rig/review.hpp"
#include "daemon/rig/service.hpp"

namespace previz::rig {

class Rig {
 public:
  struct Parts {  // outlive the rig
    EventLoop& loop;
    Notes& note;
    pipeline::Metrics& metrics;
    std::shared_ptr<render::Device> device;
    std::function<void(pipeline::Shot, const Look&)> show;  // on the pipeline's last thread
    std::function<void(RigFacts)> tell;                     // what the overlay may say
    std::function<std::vector<std::unique_ptr<Buttons>>()> more_buttons;  // or empty
    bool loop_cameras = false;
    std::stop_token stop;
  };

  // Opens the devices and starts; throws previz::Error on anything that keeps the set from running.
  Rig(const LoadedSet& loaded, Parts parts);
  ~Rig();
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  // Until the observer's stream ends or a stop is requested; or until another set is wanted, which
  // is returned, read without fault. Throws what a stage threw.
  std::optional<LoadedSet> run();

  // From the loop's thread; `by` is who asks, for the log and the take: "button red", "bus".
  Outcome perform(const set::Action& action, const std::string& by);
  Outcome wish(Event event, const std::string& by);

  const Controls& controls() const { return controls_; }
  const LoadedSet& loaded() const { return loaded_; }
  const std::string& last_said() const { return last_said_; }
  output::RecorderStatus recorder_status() const { return recorder_.status(); }
  // Called after anything of the above has changed.
  void on_change(std::function<void()> changed) { changed_ = std::move(changed); }

 private:
  struct Device {
    std::unique_ptr<Buttons> buttons;
    DeviceCounts counts;
    std::unique_ptr<EventLoop::Watch> watch;
    std::int64_t clock_offset_ns = 0;  // of the cameras' clock, in which presses are recorded
  };

  void open_buttons();
  void read(Device& device);
  void edge(const ButtonEvent& event);
  void act(const Press& press);
  void inbox();
  void tick();
  void look_at_recorder();
  void look_at_set_file();
  void feed_watchdog();
  void tell_screen();
  // Does what the outcome asks for, and tells everybody; returns what then became of it.
  Outcome tell(Outcome outcome, const std::string& by);
  // Why it was not done, where it was not.
  std::optional<std::string> carry_out(Request request);
  std::optional<std::string> change_set(int next);  // to that file of the folder; 0: this one again
  void publish();
  std::int64_t now_ns() const;  // the cameras' clock

  const LoadedSet& loaded_;
  Parts parts_;
  Cameras cameras_;
  Controls controls_;
  pipeline::Newest<Look> look_;
  Inbox inbox_;
  Faults faults_;
  output::Recorder recorder_;
  PressRecognizer presses_;
  std::set<std::string> ended_refinement_;  // buttons whose running press did
  std::vector<Device> devices_;
  std::uint64_t finished_takes_ = 0, failures_ = 0;
  SetFileWatch set_file_;
  int ticks_ = 0;
  Progress progress_;  // when the watchdog was last fed
  std::unique_ptr<Review> review_;
  std::vector<std::unique_ptr<Review>> ended_reviews_;
  std::optional<LoadedSet> next_;
  std::function<void()> changed_;
  std::string last_said_;
  NewsTicker news_;  // the same for the display
  std::optional<std::uint64_t> free_bytes_;
  LivePipeline pipeline_;  // last: its threads use all of the above
};

}  // namespace previz::rig
