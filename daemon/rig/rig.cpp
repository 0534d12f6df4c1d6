#include "daemon/rig/rig.hpp"

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <future>
#include <system_error>
#include <utility>

#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/scene/assets.hpp"
#include "daemon/core/scene/lamp_strength.hpp"
#include "daemon/core/set/names.hpp"
#include "drivers/error.hpp"

namespace previz::rig {

using report::Reports;
using report::Severity;

namespace {

constexpr std::chrono::milliseconds tick_interval{20};
constexpr int ticks_a_second = 50;
constexpr int ticks_a_page = 5;               // the overlay is updated once in so many ticks
constexpr const char* cut_off = "recording";  // source of the trouble that a take was cut off
constexpr const char* salvage = "take";       // source of the trouble that takes from before were
// A set that is read within this time is answered for at once; the loop waits for it.
constexpr std::chrono::milliseconds prompt{200};
// What the stages have in hand when a stop comes is recorded if they end within this time.
constexpr std::chrono::milliseconds pipeline_patience{2000};
// A disk that does not answer for longer than this is not waited for when the rig ends.
constexpr double longest_disk_silence_s = 90;
// A disk of takes that does not answer for longer is reported.
constexpr double longest_folder_silence_s = 2;
// Whoever asks for a snapshot waits at most so long for the next picture; D-Bus itself waits 25 s.
constexpr std::chrono::seconds snapshot_patience{20};

output::TakeTemplate take_template(const LoadedSet& loaded, const live::Cameras& cameras,
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
  take.codec = set.recording.codec;
  try {
    take.assets = scene::assets_of(set);
  } catch (const Error& error) {
    reports(report::once({Severity::warning, "takes will miss the scene files", error.what()}));
  }
  return take;
}

output::RecorderOptions recorder_options(const LoadedSet& loaded, const live::Cameras& cameras,
                                         const pipeline::StageKeeper::Parts& kept,
                                         const KeptTake& last) {
  const set::Recording& recording = loaded.set.recording;
  output::RecorderOptions options;
  options.take = take_template(loaded, cameras, kept.reports);
  options.preroll_s = recording.preroll_s;
  options.most_behind_s = recording.most_behind_s;
  options.queue_bytes = output::queue_bytes(recording.queue_mb);
  if (recording.queue_mb && 1e6 * *recording.queue_mb > static_cast<double>(options.queue_bytes))
    kept.reports(
        report::once({Severity::warning, "recording.queue_mb",
                      "is more than three quarters of this computer's memory; " +
                          std::to_string(options.queue_bytes / 1'000'000) + " MB are used"}));
  options.reserve_bytes = static_cast<std::uint64_t>(recording.reserve_mb * 1e6);
  options.measures_disk = true;
  options.last_take = last.directory;
  options.is_last_good = last.is_good;
  options.note = [&reports = kept.reports](const report::Report& report) { reports(report); };
  options.left_out = [&metrics = kept.metrics](const std::string& cause, std::uint64_t pictures) {
    metrics.dropped("recorder", cause, pictures);
  };
  return options;
}

// The oldest has waited until the newest picture was offered: while none comes, it grows no older.
pipeline::Waiting waiting_in(const output::Recorder& recorder) {
  const output::Backlog backlog = recorder.status().backlog;
  return {.values = backlog.entries, .oldest_s = backlog.seconds, .bytes = backlog.bytes};
}

pipeline::Waiting waiting_for_folders(const output::Recorder& recorder) {
  pipeline::Waiting waiting;
  for (const output::FolderSeen& seen : recorder.folders()) {
    waiting.values += seen.tasks;
    waiting.oldest_s = std::max(waiting.oldest_s, seen.silent_s);
  }
  return waiting;
}

live::Cameras open_cameras_of(const LoadedSet& loaded, const Rig::Parts& parts,
                              const live::Usb& usb) {
  live::Cameras cameras = live::open_cameras(loaded.set, parts.loop_cameras, usb);
  if (parts.around_cameras) parts.around_cameras(cameras);
  return cameras;
}

// If the USB cannot be watched, cameras are still found, but only when the next attempt is due.
live::Usb watch_usb(Reports& reports) {
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
      cameras_(open_cameras_of(loaded_, parts_, watch_usb(parts_.kept.reports))),
      controls_(loaded_.set, parts_.sets.edits(), loaded_.scene),
      look_(controls_.look()),
      recorder_(recorder_options(loaded_, cameras_, parts_.kept, parts_.last_take)),
      recorder_watch_(parts_.kept.metrics, "recorder", [this] { return waiting_in(recorder_); }),
      folders_watch_(parts_.kept.metrics, "folders of takes",
                     [this] { return waiting_for_folders(recorder_); }),
      inbox_watch_(parts_.kept.metrics, "main loop", [this] { return inbox_.waiting(); }),
      lens_(pipeline::observer_calibration(loaded_.set, cameras_.recorded.info).intrinsics),
      guides_({loaded_.set, loaded_.scene, look_, parts_.kept},
              pipeline::observer_calibration(loaded_.set, cameras_.recorded.info)),
      pipeline_({.set = loaded_.set,
                 .cameras = cameras_,
                 .scene = loaded_.scene,
                 .device = parts_.device,
                 .renderer = parts_.renderer,
                 .recorder = recorder_,
                 .look = look_,
                 .inbox = inbox_,
                 .kept = parts_.kept,
                 .wants = parts_.wants,
                 .show = [this](pipeline::Shot shot) { show_picture(std::move(shot)); }},
                parts_.stop) {
  for (const std::string& what : loaded_.scene.notes)
    parts_.kept.reports(report::once({Severity::warning, "scene", what}));
  desk_.emplace(
      loaded_.set.buttons, open_button_devices(loaded_.set, cameras_, parts_.more_buttons),
      ButtonDesk::Parts{parts_.loop, parts_.kept.reports, parts_.kept.metrics}, asks_of_buttons());
  if (!parts_.last_take.directory.empty()) controls_.happened(live::Event::take_finished);
  free_bytes_ = recorder_.free_bytes();
  look_at_folders();
  show_facts();
}

// The review must end before the pipeline, because it pushes its frames into it.
Rig::~Rig() {
  close_take();
  review_.reset();
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
    if (event.pressed) pressed_aims_[event.button] = *aim_.get();
    if (!event.pressed || !controls_.pushed()) return false;
    apply({"live", false, {}}, "button " + event.button);
    return true;
  };
  asks.act = [this](const set::Action& action, const std::string& button, bool ended_refinement) {
    know_picture();
    controls_.use_aim(pressed_aims_[button]);
    apply(controls_.perform(action, ended_refinement), "button " + button);
  };
  return asks;
}

void Rig::run() {
  const auto inbox_watch = parts_.loop.on_readable(inbox_.fd(), [this] { take_inbox(); });
  const auto timer = parts_.loop.every(tick_interval, [this] { tick(); });
  parts_.service.ready("set \"" + loaded_.set.name + "\"");
  parts_.loop.run();
  if (ends()) parts_.service.stopping();
  for (; !snapshots_.empty(); snapshots_.pop_front())
    answer_snapshot({"nothing is saved: no picture came before the rig left this set", true, {}});
  close_take();
  keep_take();
  if (ends()) pipeline_.wait();
}

void Rig::keep_take() {
  const output::RecorderStatus recorder = recorder_.status();
  if (recorder.finished_takes > 0)
    parts_.last_take = {recorder.directory, loaded_.text, recorder.good};
  else if (recorder.number == 0)
    parts_.last_take.is_good = recorder.good;
}

// Another rig follows this one where a set was read, unless a stop came with it.
bool Rig::ends() const {
  return !parts_.sets.has_next() || parts_.stop.stop_requested();
}

// Closes the take before any device is given back, because a device may hang. While the disk takes
// what is queued, systemd is asked for more time.
void Rig::close_take() {
  if (std::exchange(is_take_closed_, true)) return;
  const pipeline::Patience& patience = parts_.kept.patience;
  const auto until_ended = ends() ? patience.ending : patience.set;
  parts_.pulse.begin(until_ended);
  parts_.service.closing_take(true);
  const auto finish = [this] { recorder_.finish(); };
  std::future<void> finished;
  try {
    finished = std::async(std::launch::async, finish);
  } catch (const std::system_error&) {  // there is no thread for it
    finish();
  }
  while (finished.valid() &&
         finished.wait_for(std::chrono::milliseconds(200)) != std::future_status::ready)
    if (recorder_.status().disk_silent_s < longest_disk_silence_s) parts_.pulse.begin(until_ended);
  parts_.service.closing_take(false);
}

// Gives the controls what is known of the shown picture alone.
void Rig::know_picture() {
  controls_.use_found(pipeline_.found_lamps());
  controls_.use_recorded(pipeline_.recorded_look());
  controls_.use_aim(*aim_.get());
  know_take();
  controls_.use_governed(pipeline_.governed().samples);
}

// What has ended meanwhile is announced first.
void Rig::know_take() {
  look_at_recorder();
  const output::RecorderStatus recorder = recorder_.status();
  controls_.use_take({recorder.directory.filename().string(), recorder.ending,
                      recorder.backlog.seconds,
                      recorder.number > 0 || parts_.last_take.set_text == loaded_.text});
}

int Rig::samples() const {
  const live::Look& look = controls_.look();
  const int governed = pipeline_.governed().samples;
  return look.governed && governed > 0 ? governed : look.samples;
}

Outcome Rig::perform(const set::Action& action, const std::string& by) {
  know_picture();
  return apply(controls_.perform(action), by);
}

void Rig::perform(const set::Action& action, const std::string& by, Answered answered) {
  const Outcome outcome = perform(action, by);
  if (outcome.request == Request::snapshot)
    snapshots_.back().answered = std::move(answered);
  else
    answered(outcome);
}

Outcome Rig::wish(live::Event event, const std::string& by) {
  know_take();
  return apply(controls_.happened(event), by);
}

Outcome Rig::apply(Outcome outcome, const std::string& by, Severity severity) {
  if (outcome.request) {
    if (std::optional<std::string> why_not = carry_out(*outcome.request, by))
      outcome = {*std::move(why_not), true, {}};
    else if (outcome.request == Request::keep_edits && parts_.sets.is_reading())
      outcome.said = "keeping the changes in the set file";
  }
  if (outcome.mark && !recorder_.offer(*outcome.mark)) {
    if (!outcome.mark->is_withdrawn) controls_.drop_mark();
    outcome = {"not marked: the take ends or has no room for it", true, {}};
  }
  publish_look();  // after the request, so that a take exists before its first shown picture
  if (outcome.refused) severity = Severity::warning;
  report::Report report{severity, by, outcome.said + (outcome.refused ? " (refused)" : "")};
  // The mode has its own place on the display and needs no notice.
  if (outcome.said != set::name_of(controls_.look().state.mode))
    report.notice = {outcome.refused ? Severity::warning : Severity::info, "", outcome.said};
  parts_.kept.reports.announce(report);
  announced_ = parts_.kept.reports.announced();
  const std::string line = line_of(report);
  recorder_.offer_event(now_ns(), line);
  parts_.service.status(line);
  show_facts();
  if (changed_) changed_();
  return outcome;
}

void Rig::publish_look() {
  look_.set(controls_.look());
  look_at_review();
}

// Begins and ends the review as the mode says. One that is to end may take a moment to do so; the
// next one waits for that.
void Rig::look_at_review() {
  const bool is_wanted = controls_.look().state.mode == live::Mode::review;
  if (review_ && !is_wanted) review_->stop();
  if (review_ && review_->is_stopped() && review_->done()) review_.reset();
  if (review_) return;
  pipeline_.reviewed().try_pop();  // of the review before
  if (!is_wanted) return;
  review_ = std::make_unique<Review>(recorder_.status().directory, loaded_, pipeline_.reviewed(),
                                     inbox_, parts_.kept.reports);
}

std::optional<std::string> Rig::carry_out(Request request, const std::string& by) {
  switch (request) {
    case Request::start_take:
      try {
        recorder_.start();
        controls_.begin_marks();
      } catch (const std::bad_alloc& error) {
        controls_.happened(live::Event::recorder_failed);
        return std::string("the take is not begun: ") + reason_of(error);
      }
      break;
    case Request::stop_take:
      recorder_.stop();
      parts_.kept.reports.settle(cut_off);
      break;
    case Request::mark_good:
      recorder_.mark_good();
      break;
    case Request::snapshot:
      snapshots_.push_back({std::chrono::steady_clock::now(), {}});
      break;
    case Request::acknowledge:
      parts_.kept.reports.settle(cut_off);
      parts_.kept.reports.settle(salvage);
      break;
    case Request::reload_set:
      return read_set([&] { parts_.sets.begin_change(0); }, by);
    case Request::keep_edits:
      return read_set([&] { parts_.sets.begin_keep(controls_.look().edits); }, by);
    case Request::next_set:
      return read_set([&] { parts_.sets.begin_change(1); }, by);
    case Request::previous_set:
      return read_set([&] { parts_.sets.begin_change(-1); }, by);
  }
  return std::nullopt;
}

// A set that is read at once, as most are, or is found wrong at once is answered for at once.
std::optional<std::string> Rig::read_set(const std::function<void()>& begin,
                                         const std::string& by) {
  if (parts_.sets.is_reading() || parts_.sets.has_next()) return "a set is already loading";
  begin();
  reading_for_ = by;
  return take_set(prompt);
}

// Goes over to the set that was read, if it is there by then. Returns why it does not, in one line.
std::optional<std::string> Rig::take_set(std::chrono::milliseconds patience) {
  const std::optional<SetKeeper::Ended> ended = parts_.sets.finish(patience);
  if (!ended) return std::nullopt;
  if (ended->why_not) return ended->why_not;
  if (controls_.look().state.recording)
    return parts_.sets.drop_next("recording began while another one was loading");
  parts_.loop.exit();
  return std::nullopt;
}

void Rig::look_at_set() {
  if (!parts_.sets.is_reading()) return;
  const std::optional<std::string> why_not = take_set(std::chrono::milliseconds(0));
  if (why_not && !reading_for_.empty()) apply({*why_not, true, {}}, reading_for_);
}

void Rig::take_snapshots() {
  for (const live::Inbox::Snapshot& snapshot : inbox_.take_snapshots()) {
    apply({snapshot.said, false, {}}, "snapshot",
          snapshot.is_saved ? Severity::info : Severity::error);
    answer_snapshot({snapshot.said, !snapshot.is_saved, {}});
    if (!snapshots_.empty()) snapshots_.pop_front();
  }
}

// The picture may still come when nobody waits for it any more.
void Rig::look_at_snapshots() {
  if (snapshots_.empty() ||
      std::chrono::steady_clock::now() - snapshots_.front().asked < snapshot_patience)
    return;
  answer_snapshot({"no picture has come for 20 s; the next one is saved", true, {}});
}

void Rig::answer_snapshot(const Outcome& outcome) {
  if (snapshots_.empty()) return;
  if (const Answered answered = std::exchange(snapshots_.front().answered, {})) answered(outcome);
}

void Rig::take_inbox() {
  take_snapshots();
  for (const live::Event event : inbox_.take()) {
    const live::State before = controls_.look().state;
    const Outcome outcome = controls_.happened(event);
    if (controls_.look().state == before) continue;
    if (event == live::Event::good_frame)
      publish_look();
    else if (event == live::Event::camera_lost)
      apply({"camera lost", false, {}}, "rig", Severity::error);
    else if (event == live::Event::camera_back)
      apply({"camera is back", false, {}}, "rig");
    else
      apply(outcome, "rig");
  }
  if (!inbox_.finished()) return;
  // A recording that is played has ended; a restart is no reason to end what is recorded, nor is an
  // error, after which the next process records on.
  if (!parts_.stop.stop_requested() && !inbox_.finished_by_error()) recorder_.stop();
  parts_.loop.exit();
}

void Rig::tick() {
  parts_.pulse.begin(parts_.kept.patience.loop);
  leave_if_stopped();
  desk_->tick(now_ns());
  look_at_recorder();
  look_at_set();
  look_at_review();
  look_at_snapshots();
  announce_faults();
  if (++ticks_ % ticks_a_second == 0) {
    desk_->count();
    if (!controls_.look().state.recording && !parts_.sets.is_reading()) {
      reading_for_.clear();
      parts_.sets.look_at_file();
    }
    free_bytes_ = recorder_.free_bytes();
    look_at_folders();
  }
  if (ticks_ % ticks_a_page != 0) return;
  show_facts();
  look_at_guides();
}

// A pipeline that has ended leaves the loop through the inbox. One that does not end, because a
// device hangs, must not keep the take open.
void Rig::leave_if_stopped() {
  if (!parts_.stop.stop_requested()) return;
  const auto now = std::chrono::steady_clock::now();
  if (!stopped_) stopped_ = now;
  if (now - *stopped_ > pipeline_patience) parts_.loop.exit();
}

// The stages announce from their own threads what has failed.
void Rig::announce_faults() {
  const std::string announced = parts_.kept.reports.announced();
  if (std::exchange(announced_, announced) == announced) return;
  if (changed_) changed_();
}

// A folder is looked at before a take needs it, because the unit may not let the service write
// there, or its disk may stand still.
void Rig::look_at_folders() {
  for (const output::FolderSeen& seen : recorder_.folders()) {
    const std::string name = seen.folder.string();
    std::string what;
    if (seen.silent_s > longest_folder_silence_s)
      what = "its disk does not respond; takes may not be written there";
    else if (!seen.why_not.empty())
      what = "is not writable for takes: " + seen.why_not;
    if (what.empty())
      parts_.kept.reports.settle(name);
    else
      parts_.kept.reports({Severity::error, name, what, name + what, report::lasting(name, what)});
  }
}

void Rig::look_at_recorder() {
  const output::RecorderStatus status = recorder_.status();
  const auto announce = [&](std::uint64_t& known, std::uint64_t now, live::Event event,
                            const std::string& said, Severity severity) {
    if (now == known) return;
    known = now;
    // A take that is lost while the next one runs does not end that one.
    if (event != live::Event::recorder_failed || !status.recording) controls_.happened(event);
    apply({said, false, {}}, "recorder", severity);
  };
  announce(failures_, status.failures, live::Event::recorder_failed, "take ended, " + status.fault,
           Severity::error);
  announce(finished_takes_, status.finished_takes, live::Event::take_finished,
           "take " + status.finished + " is finished", Severity::info);
  if (std::exchange(is_good_, status.good) != status.good && changed_) changed_();
  announce_salvaged(status.salvaged);
  if (status.interrupted && !std::exchange(has_resumed_, true)) resume(*status.interrupted);
}

// Names the takes of an earlier process that were cut off, each once in the log and on the bus. On
// the display, at which nobody may look just now, the last of them stands until somebody has taken
// note.
void Rig::announce_salvaged(const std::vector<std::string>& salvaged) {
  if (salvaged_ == salvaged.size()) return;
  for (; salvaged_ < salvaged.size(); ++salvaged_)
    apply({salvaged[salvaged_], false, {}}, "recorder", Severity::warning);
  std::string words = salvaged.back();
  if (salvaged.size() > 1) words += " (and " + std::to_string(salvaged.size() - 1) + " more)";
  parts_.kept.reports.show(report::lasting(salvage, words));
}

// A recording that nobody ended goes on in the next take, and the crew is told so until somebody
// says that he has seen it.
void Rig::resume(const std::string& take) {
  if (!controls_.look().state.recording)
    apply(controls_.happened(live::Event::record_on), "recorder");
  const std::string what = take + " was cut off; recording continues in the next take";
  apply({what, false, {}}, "recorder", Severity::error);
  parts_.kept.reports.show(report::lasting(cut_off, what));
}

void Rig::look_at_guides() {
  const std::optional<fit::Figure> fit = guides_.figure();
  std::string words = fit ? words_of(*fit) : "";
  if (words == std::exchange(fit_said_, words)) return;
  if (changed_) changed_();
}

void Rig::show_picture(pipeline::Shot shot) {
  shown_at_ = std::chrono::steady_clock::now();
  if (!std::exchange(are_lamps_judged_, true))
    for (const std::string& what : scene::remarks_on_bright_lamps(
             loaded_.scene, loaded_.set,
             loaded_.set.observer.exposure.value_or(shot.frame->exposure)))
      parts_.kept.reports(report::once({Severity::warning, "scene", what}));
  if (!shot.frozen) aim_.set(live::aim_of(shot, lens_));
  GuidesOf guides = guides_.look_at(shot);
  parts_.show(std::move(shot), *look_.get(), std::move(guides));
}

std::optional<double> Rig::picture_age_s() const {
  const std::chrono::steady_clock::time_point shown = shown_at_;
  if (shown == std::chrono::steady_clock::time_point()) return std::nullopt;
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - shown).count();
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
  facts.backlog = recorder.backlog;
  facts.recorder_fault = recorder.fault;
  facts.device = render::drawing_device(*parts_.device);
  facts.free_bytes = free_bytes_;
  facts.news = parts_.kept.reports.news();
  facts.troubles = parts_.kept.reports.troubles();
  if (facts.look.pass_times) facts.pass_times = pipeline_.pass_times();
  if (facts.look.guides) facts.fit = guides_.figure();
  parts_.show_facts(std::move(facts));
}

std::int64_t Rig::now_ns() const {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::nanoseconds(now).count() + cameras_.clock_offset_ns;
}

}  // namespace previz::rig
