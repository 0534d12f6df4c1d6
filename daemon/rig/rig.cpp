#include "daemon/rig/rig.hpp"

#include <algorithm>
#include <variant>

#include "daemon/pipeline/take.hpp"
#include "daemon/scene/assets.hpp"
#include "daemon/set/names.hpp"
#include "drivers/button_drivers.hpp"
#include "drivers/error.hpp"

namespace previz::rig {
namespace {

constexpr std::chrono::milliseconds tick_interval{20};
constexpr int ticks_a_second = 50;
constexpr int ticks_a_page = 5;  // the overlay's clock and faults

output::TakeTemplate take_template(const LoadedSet& loaded, const Cameras& cameras, Notes& note) {
  const set::Set& set = loaded.set;
  output::TakeTemplate take;
  take.directory = set.recording.directory;
  take.info.set_name = set.file.filename().string();
  take.info.set_text = loaded.text;
  take.info.observer = pipeline::observer_calibration(set, cameras.recorded.info);
  take.info.light = pipeline::light_calibration(set, cameras.recorded.info);
  take.info.take = session::TakeInfo{0,
                                     set.recording.slate.empty() ? set.name : set.recording.slate,
                                     "",
                                     set.recording.timecode_fps,
                                     set.recording.notes,
                                     false};
  try {
    take.assets = scene::assets_of(set);
  } catch (const Error& error) {
    note(std::string("takes will lack the scene: ") + error.what());
  }
  return take;
}

output::RecorderOptions recorder_options(const LoadedSet& loaded, const Cameras& cameras,
                                         Notes& note) {
  const set::Recording& recording = loaded.set.recording;
  output::RecorderOptions options;
  options.take = take_template(loaded, cameras, note);
  options.preroll_s = recording.preroll_s;
  options.queue_bytes = static_cast<std::uint64_t>(recording.queue_mb * 1e6);
  options.reserve_bytes = static_cast<std::uint64_t>(recording.reserve_mb * 1e6);
  options.note = [&note](const std::string& what) { note.again(what); };
  return options;
}

// Without it cameras are found too, but only when the next attempt is due.
Usb watch_usb(Notes& note) {
  try {
    return std::make_shared<const usb::Hotplug>();
  } catch (const Error& error) {
    note(error.what());
    return nullptr;
  }
}

}  // namespace

Rig::Rig(const LoadedSet& loaded, Parts parts)
    : loaded_(loaded),
      parts_(std::move(parts)),
      cameras_(open_cameras(loaded.set, parts_.loop_cameras, watch_usb(parts_.note))),
      controls_(loaded.set),
      look_(controls_.look()),
      recorder_(recorder_options(loaded, cameras_, parts_.note)),
      presses_(loaded.set.buttons),
      set_file_(loaded.changed),
      pipeline_(
          {.set = loaded.set,
           .cameras = cameras_,
           .scene = loaded.scene,
           .device = parts_.device,
           .recorder = recorder_,
           .look = look_,
           .inbox = inbox_,
           .note = parts_.note,
           .faults = faults_,
           .metrics = parts_.metrics,
           .show = [this](pipeline::Shot shot) { parts_.show(std::move(shot), *look_.get()); }},
          parts_.stop) {
  for (const std::string& what : loaded.scene.notes) parts_.note("scene: " + what);
  open_buttons();
  free_bytes_ = recorder_.free_bytes();
  tell_screen();
}

// Reviews hand what they play to the pipeline.
Rig::~Rig() {
  review_.reset();
  ended_reviews_.clear();
}

void Rig::open_buttons() {
  const auto add = [this](std::vector<std::unique_ptr<Buttons>> opened, std::int64_t offset_ns) {
    for (std::unique_ptr<Buttons>& buttons : opened) {
      DeviceCounts counts(parts_.metrics, buttons->name());
      devices_.push_back({std::move(buttons), std::move(counts), nullptr, offset_ns});
    }
  };
  add(rig::open_buttons(loaded_.set, cameras_), 0);
  std::vector<std::string> plugged;
  for (const set::Button& button : loaded_.set.buttons)
    if (is_button_name(button.name) && std::ranges::find(plugged, button.name) == plugged.end())
      plugged.push_back(button.name);
  ButtonSettings settings;
  for (const set::GpioContact& contact : loaded_.set.contacts)
    settings.wiring[contact.name] = contact.wiring;
  add(previz::open_buttons(plugged, settings), cameras_.clock_offset_ns);
  if (parts_.more_buttons) add(parts_.more_buttons(), 0);
  for (Device& device : devices_)
    device.watch = parts_.loop.on_readable(device.buttons->fd(), [this, &device] { read(device); });
}

std::optional<LoadedSet> Rig::run() {
  const auto inbox_watch = parts_.loop.on_readable(inbox_.fd(), [this] { inbox(); });
  const auto timer = parts_.loop.every(tick_interval, [this] { tick(); });
  std::unique_ptr<EventLoop::Watch> watchdog;
  if (const auto interval = service::watchdog_interval())
    watchdog = parts_.loop.every(*interval, [this] { feed_watchdog(); });
  service::ready("set \"" + loaded_.set.name + "\"");
  service::feed_watchdog();  // a set that was read again took its time
  parts_.loop.run();
  if (next_) return std::move(next_);
  pipeline_.wait();
  return std::nullopt;
}

// What was pressed after a set was read again is the next rig's.
void Rig::read(Device& device) {
  inbox();  // a frame that came before the press
  while (!next_) {
    std::optional<ButtonsEvent> event = device.buttons->next();
    if (!event) return;
    bool over = std::holds_alternative<EndOfStream>(*event);
    if (auto* pushed = std::get_if<ButtonEvent>(&*event)) {
      faults_.well(device.buttons->name());
      pushed->timestamp_ns += device.clock_offset_ns;
      edge(*pushed);
    }
    if (const auto* trouble = std::get_if<DeviceTrouble>(&*event)) {
      parts_.note(trouble->device + ": " + trouble->what);
      faults_.tell(device.buttons->name(), trouble->what);
      over = trouble->lost;
    }
    if (over) return device.watch.reset();
  }
}

void Rig::edge(const ButtonEvent& event) {
  recorder_.offer(event);
  if (event.pressed) {
    ended_refinement_.erase(event.button);
    if (controls_.pushed()) {
      ended_refinement_.insert(event.button);
      tell({"live", false, {}}, "button " + event.button);
    }
  }
  for (const Press& press : presses_.edge(event)) act(press);
}

void Rig::act(const Press& press) {
  const auto mapped = std::ranges::find_if(loaded_.set.buttons, [&](const set::Button& button) {
    return button.name == press.button && button.press == press.kind;
  });
  if (mapped == loaded_.set.buttons.end()) return;
  const set::Action& action = *set::find_action(mapped->action);
  // A press that ended the refinement has gone where a mode button goes: to live.
  const bool ended_refinement = ended_refinement_.erase(press.button) > 0;
  if (ended_refinement && Controls::is_mode(action)) return;
  tell(controls_.perform(action, ended_refinement), "button " + press.button);
}

Outcome Rig::perform(const set::Action& action, const std::string& by) {
  return tell(controls_.perform(action), by);
}

Outcome Rig::wish(Event event, const std::string& by) {
  return tell(controls_.happened(event), by);
}

Outcome Rig::tell(Outcome outcome, const std::string& by) {
  if (outcome.request) {
    if (std::optional<std::string> why_not = carry_out(*outcome.request))
      outcome = {*std::move(why_not), true, {}};
  }
  publish();  // after it: there is a take before what is shown is to be in it
  const std::string line = by + ": " + outcome.said + (outcome.refused ? " (refused)" : "");
  parts_.note.again(line);
  recorder_.offer_event(now_ns(), line);
  service::status(line);
  last_said_ = line;
  // The mode has its own place on the display.
  if (outcome.said != set::name_of(controls_.look().state.mode))
    news_.tell({outcome.said, outcome.refused});
  tell_screen();
  if (changed_) changed_();
  return outcome;
}

void Rig::publish() {
  look_.set(controls_.look());
  const bool review = controls_.look().state.mode == Mode::review;
  if (review && !review_) {
    pipeline_.reviewed().try_pop();
    review_ = std::make_unique<Review>(recorder_.status().directory, loaded_.text,
                                       pipeline_.reviewed(), inbox_, parts_.note);
  } else if (!review && review_) {
    review_->stop();
    ended_reviews_.push_back(std::move(review_));
  }
}

std::optional<std::string> Rig::carry_out(Request request) {
  switch (request) {
    case Request::start_take:
      recorder_.start();
      break;
    case Request::stop_take:
      recorder_.stop();
      break;
    case Request::mark_good:
      recorder_.mark_good();
      break;
    case Request::reload_set:
      return change_set(0);
    case Request::next_set:
      return change_set(1);
    case Request::previous_set:
      return change_set(-1);
  }
  return std::nullopt;
}

// All or nothing: a set with a fault leaves this one running.
std::optional<std::string> Rig::change_set(int next) {
  service::feed_watchdog();
  try {
    const std::filesystem::path& file = loaded_.set.file;
    next_ = load_whole_set(next == 0 ? file : neighbour(file, next));
    parts_.loop.exit();
    return std::nullopt;
  } catch (const std::exception& error) {
    parts_.note.again(std::string(error.what()) + "\nthe set stays as it was");
    const std::string what = error.what();
    const std::string first = what.substr(0, what.find('\n'));
    faults_.pass("the set stays as it was", first);
    return "the set stays as it was: " + first;
  }
}

void Rig::inbox() {
  for (const Event event : inbox_.take()) {
    const State before = controls_.look().state;
    const Outcome outcome = controls_.happened(event);
    if (controls_.look().state == before) continue;
    if (event == Event::good_frame)
      publish();
    else
      tell(event == Event::camera_lost   ? Outcome{"camera lost", false, {}}
           : event == Event::camera_back ? Outcome{"camera is back", false, {}}
                                         : outcome,
           "rig");
  }
  if (inbox_.finished()) parts_.loop.exit();
}

void Rig::tick() {
  for (const Press& press : presses_.tick(now_ns())) act(press);
  look_at_recorder();
  std::erase_if(ended_reviews_, [](const auto& review) { return review->done(); });
  if (++ticks_ % ticks_a_second == 0) {
    for (Device& device : devices_) device.counts.tell(device.buttons->counters());
    look_at_set_file();
    free_bytes_ = recorder_.free_bytes();
  }
  if (ticks_ % ticks_a_page == 0) tell_screen();
}

void Rig::look_at_recorder() {
  const output::RecorderStatus status = recorder_.status();
  const auto tell_of = [&](std::uint64_t& known, std::uint64_t now, Event event,
                           const std::string& said) {
    if (now == known) return;
    known = now;
    controls_.happened(event);
    tell({said, false, {}}, "recorder");
  };
  tell_of(failures_, status.failures, Event::recorder_failed, "take ended, " + status.fault);
  tell_of(finished_takes_, status.finished_takes, Event::take_finished,
          "take " + status.directory.filename().string() + " is finished");
}

void Rig::tell_screen() {
  if (!parts_.tell) return;
  const output::RecorderStatus recorder = recorder_.status();
  RigFacts facts;
  facts.look = controls_.look();
  facts.take = recorder.directory.filename().string();
  facts.recorded_s = recorder.seconds;
  facts.frames_lost = recorder.dropped;
  facts.recorder_fault = recorder.fault;
  facts.free_bytes = free_bytes_;
  facts.news = news_.fresh();
  facts.faults = faults_.words();
  parts_.tell(std::move(facts));
}

void Rig::look_at_set_file() {
  std::error_code gone;
  const auto time = std::filesystem::last_write_time(loaded_.set.file, gone);
  if (gone || controls_.look().state.recording || !set_file_.is_changed(time)) return;
  parts_.note.again(loaded_.set.file.string() + ": the file has changed");
  change_set(0);
}

void Rig::feed_watchdog() {
  const bool has_screen = loaded_.set.display.driver != set::DisplayDriver::none;
  const Progress now = progress_of(parts_.metrics.snapshot(0), controls_.look().state, has_screen);
  if (!advances(progress_, now)) return;
  progress_ = now;
  service::feed_watchdog();
}

std::int64_t Rig::now_ns() const {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::nanoseconds(now).count() + cameras_.clock_offset_ns;
}

}  // namespace previz::rig
