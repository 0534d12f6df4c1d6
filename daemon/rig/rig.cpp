#include "daemon/rig/rig.hpp"

#include <chrono>
#include <utility>

#include "daemon/pipeline/take.hpp"
#include "daemon/scene/assets.hpp"
#include "daemon/set/names.hpp"
#include "drivers/error.hpp"

namespace previz::rig {

using report::Reports;
using report::Severity;

namespace {

constexpr std::chrono::milliseconds tick_interval{20};
constexpr int ticks_a_second = 50;
constexpr int ticks_a_page = 5;               // the overlay is updated once in so many ticks
constexpr const char* cut_off = "recording";  // source of the trouble that a take was cut off

output::TakeTemplate take_template(const LoadedSet& loaded, const Cameras& cameras,
                                   Reports& reports) {
  const set::Set& set = loaded.set;
  output::TakeTemplate take;
  take.folders = {set.recording.directory};
  if (set.recording.second_directory) take.folders.push_back(*set.recording.second_directory);
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
    reports(report::once({Severity::warning, "takes will lack the scene", error.what()}));
  }
  return take;
}

output::RecorderOptions recorder_options(const LoadedSet& loaded, const Cameras& cameras,
                                         Reports& reports) {
  const set::Recording& recording = loaded.set.recording;
  output::RecorderOptions options;
  options.take = take_template(loaded, cameras, reports);
  options.preroll_s = recording.preroll_s;
  options.queue_bytes = recording.queue_mb ? static_cast<std::uint64_t>(*recording.queue_mb * 1e6)
                                           : output::default_queue_bytes();
  options.reserve_bytes = static_cast<std::uint64_t>(recording.reserve_mb * 1e6);
  options.measures_disk = true;
  options.note = [&reports](const report::Report& report) { reports(report); };
  return options;
}

// If the USB cannot be watched, cameras are still found, but only when the next attempt is due.
Usb watch_usb(Reports& reports) {
  try {
    return std::make_shared<const usb::Hotplug>();
  } catch (const Error& error) {
    reports(report::once({Severity::warning, "", error.what()}));
    return nullptr;
  }
}

}  // namespace

Rig::Rig(Parts parts)
    : parts_(std::move(parts)),
      loaded_(parts_.sets.running()),
      cameras_(open_cameras(loaded_.set, parts_.loop_cameras, watch_usb(parts_.reports))),
      controls_(loaded_.set, parts_.sets.edits(), loaded_.scene),
      look_(controls_.look()),
      recorder_(recorder_options(loaded_, cameras_, parts_.reports)),
      pipeline_(
          {.set = loaded_.set,
           .cameras = cameras_,
           .scene = loaded_.scene,
           .device = parts_.device,
           .renderer = parts_.renderer,
           .recorder = recorder_,
           .look = look_,
           .inbox = inbox_,
           .reports = parts_.reports,
           .metrics = parts_.metrics,
           .show = [this](pipeline::Shot shot) { parts_.show(std::move(shot), *look_.get()); }},
          parts_.stop) {
  for (const std::string& what : loaded_.scene.notes)
    parts_.reports(report::once({Severity::warning, "scene", what}));
  desk_.emplace(loaded_.set.buttons,
                open_button_devices(loaded_.set, cameras_, parts_.more_buttons),
                ButtonDesk::Parts{parts_.loop, parts_.reports, parts_.metrics}, asks_of_buttons());
  free_bytes_ = recorder_.free_bytes();
  show_facts();
}

// Reviews must end before the pipeline, because they push their frames into it.
Rig::~Rig() {
  review_.reset();
  ended_reviews_.clear();
}

ButtonDesk::Asks Rig::asks_of_buttons() {
  ButtonDesk::Asks asks;
  // Frames that came before the press must be known first. Presses after a set was read again
  // belong to the next rig.
  asks.listens = [this] {
    take_inbox();
    return !parts_.sets.has_next();
  };
  asks.edge = [this](const ButtonEvent& event) {
    recorder_.offer(event);
    if (!event.pressed || !controls_.pushed()) return false;
    apply({"live", false, {}}, "button " + event.button);
    return true;
  };
  asks.act = [this](const set::Action& action, const std::string& button, bool ended_refinement) {
    know_picture();
    apply(controls_.perform(action, ended_refinement), "button " + button);
  };
  return asks;
}

void Rig::run() {
  const auto inbox_watch = parts_.loop.on_readable(inbox_.fd(), [this] { take_inbox(); });
  const auto timer = parts_.loop.every(tick_interval, [this] { tick(); });
  std::unique_ptr<EventLoop::Watch> watchdog;
  if (const auto interval = service::watchdog_interval())
    watchdog = parts_.loop.every(*interval, [this] { feed_watchdog(); });
  service::ready("set \"" + loaded_.set.name + "\"");
  service::feed_watchdog();  // reading a set again takes long
  parts_.loop.run();
  if (!parts_.sets.has_next()) pipeline_.wait();
}

// Gives the controls what is known of the shown picture alone.
void Rig::know_picture() {
  controls_.use_found(pipeline_.found_lamps());
  controls_.use_recorded(pipeline_.recorded_variants());
}

Outcome Rig::perform(const set::Action& action, const std::string& by) {
  know_picture();
  return apply(controls_.perform(action), by);
}

Outcome Rig::wish(Event event, const std::string& by) {
  return apply(controls_.happened(event), by);
}

Outcome Rig::apply(Outcome outcome, const std::string& by, Severity severity) {
  if (outcome.request) {
    if (std::optional<std::string> why_not = carry_out(*outcome.request))
      outcome = {*std::move(why_not), true, {}};
  }
  publish_look();  // after the request, so that a take exists before its first shown picture
  if (outcome.refused) severity = Severity::warning;
  report::Report report{severity, by, outcome.said + (outcome.refused ? " (refused)" : "")};
  // The mode has its own place on the display and needs no notice.
  if (outcome.said != set::name_of(controls_.look().state.mode))
    report.notice = {outcome.refused ? Severity::warning : Severity::info, "", outcome.said};
  parts_.reports.announce(report);
  const std::string line = line_of(report);
  recorder_.offer_event(now_ns(), line);
  service::status(line);
  show_facts();
  if (changed_) changed_();
  return outcome;
}

void Rig::publish_look() {
  look_.set(controls_.look());
  const bool review = controls_.look().state.mode == Mode::review;
  if (review && !review_) {
    pipeline_.reviewed().try_pop();
    review_ = std::make_unique<Review>(recorder_.status().directory, loaded_, pipeline_.reviewed(),
                                       inbox_, parts_.reports);
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
      parts_.reports.settle(cut_off);
      break;
    case Request::mark_good:
      recorder_.mark_good();
      break;
    case Request::acknowledge:
      parts_.reports.settle(cut_off);
      break;
    case Request::reload_set:
      return change_set(0);
    case Request::keep_edits: {
      std::optional<std::string> why_not = parts_.sets.keep(controls_.look().edits);
      if (!why_not) parts_.loop.exit();
      return why_not;
    }
    case Request::next_set:
      return change_set(1);
    case Request::previous_set:
      return change_set(-1);
  }
  return std::nullopt;
}

std::optional<std::string> Rig::change_set(int next) {
  std::optional<std::string> why_not = parts_.sets.change(next);
  if (!why_not) parts_.loop.exit();
  return why_not;
}

void Rig::take_inbox() {
  for (const Event event : inbox_.take()) {
    const State before = controls_.look().state;
    const Outcome outcome = controls_.happened(event);
    if (controls_.look().state == before) continue;
    if (event == Event::good_frame)
      publish_look();
    else if (event == Event::camera_lost)
      apply({"camera lost", false, {}}, "rig", Severity::error);
    else if (event == Event::camera_back)
      apply({"camera is back", false, {}}, "rig");
    else
      apply(outcome, "rig");
  }
  if (!inbox_.finished()) return;
  // A recording that is played has ended; a restart is no reason to end what is recorded.
  if (!parts_.stop.stop_requested()) recorder_.stop();
  parts_.loop.exit();
}

void Rig::tick() {
  desk_->tick(now_ns());
  look_at_recorder();
  std::erase_if(ended_reviews_, [](const auto& review) { return review->done(); });
  if (++ticks_ % ticks_a_second == 0) {
    desk_->count();
    if (!controls_.look().state.recording) parts_.sets.look_at_file();
    if (parts_.sets.has_next()) parts_.loop.exit();
    free_bytes_ = recorder_.free_bytes();
  }
  if (ticks_ % ticks_a_page == 0) show_facts();
}

void Rig::look_at_recorder() {
  const output::RecorderStatus status = recorder_.status();
  const auto announce = [&](std::uint64_t& known, std::uint64_t now, Event event,
                            const std::string& said, Severity severity) {
    if (now == known) return;
    known = now;
    // A take that is lost while the next one runs does not end that one.
    if (event != Event::recorder_failed || !status.recording) controls_.happened(event);
    apply({said, false, {}}, "recorder", severity);
  };
  announce(failures_, status.failures, Event::recorder_failed, "take ended, " + status.fault,
           Severity::error);
  announce(finished_takes_, status.finished_takes, Event::take_finished,
           "take " + status.finished + " is finished", Severity::info);
  for (; salvaged_ < status.salvaged.size(); ++salvaged_)
    apply({status.salvaged[salvaged_], false, {}}, "recorder", Severity::warning);
  if (status.interrupted && !std::exchange(has_resumed_, true)) resume(*status.interrupted);
}

// A recording that nobody ended goes on in the next take, and the crew is told so until somebody
// says that he has seen it.
void Rig::resume(const std::string& take) {
  if (!controls_.look().state.recording) apply(controls_.happened(Event::record_on), "recorder");
  const std::string what = take + " was cut off; recording goes on in the next take";
  apply({what, false, {}}, "recorder", Severity::error);
  parts_.reports.show(report::lasting(cut_off, what));
}

void Rig::show_facts() {
  if (!parts_.show_facts) return;
  const output::RecorderStatus recorder = recorder_.status();
  RigFacts facts;
  facts.look = controls_.look();
  facts.take = recorder.directory.filename().string();
  facts.recorded_s = recorder.seconds;
  facts.lost = recorder.lost;
  facts.disk_silent_s = recorder.disk_silent_s;
  facts.recorder_fault = recorder.fault;
  facts.free_bytes = free_bytes_;
  facts.news = parts_.reports.news();
  facts.troubles = parts_.reports.troubles();
  parts_.show_facts(std::move(facts));
}

void Rig::feed_watchdog() {
  const bool has_screen = loaded_.set.display.driver != set::no_driver;
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
