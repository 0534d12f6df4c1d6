#include "daemon/output/recorder.hpp"

#include <algorithm>
#include <array>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <utility>
#include <vector>

#include "drivers/bracket.hpp"
#include "drivers/error.hpp"

namespace previz::output {

using report::Severity;

namespace {

using Clock = std::chrono::steady_clock;

// A stopped take waits so long for the tracking of its last frames.
constexpr std::chrono::milliseconds track_patience{500};
constexpr std::chrono::seconds disk_interval{1};
// A frame may be offered so long after its capture.
constexpr std::chrono::seconds late{1};
// A disk that takes longer for one thing is reported.
constexpr std::chrono::seconds silence{2};

std::string megabytes(double bytes) {
  return std::to_string(std::lround(1e-6 * bytes)) + " MB";
}

}  // namespace

std::uint64_t default_queue_bytes() {
  constexpr std::uint64_t least = 256'000'000;
  std::ifstream file("/proc/meminfo");
  for (std::string line; std::getline(file, line);) {
    std::uint64_t kib = 0;
    if (std::sscanf(line.c_str(), "MemAvailable: %" SCNu64 " kB", &kib) == 1)
      return std::max(least, kib * 1024 / 4);
  }
  return least;
}

Recorder::Recorder(RecorderOptions options)
    : options_(std::move(options)),
      folders_(options_.take.folders, options_.reserve_bytes, options_.free_bytes),
      assets_(folders_.all().front() / ".assets", options_.take.assets,
              [this](const std::string& what) { note(Severity::warning, what); }) {
  thread_ = std::jthread([this] { run(); });
}

Recorder::~Recorder() {
  finish();
}

void Recorder::finish() {
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(quit_, true)) return;
    if (status_.recording) enqueue_stop(false);
  }
  filled_.notify_one();
  thread_.join();
}

// Returns about how much memory an entry takes. An entry that begins or ends a take counts as 0, so
// that it is never left out.
std::uint64_t Recorder::bytes_of(const Entry& entry) {
  if (const auto* captured = std::get_if<Captured>(&entry)) return captured->frame->bytes.size();
  if (const auto* event = std::get_if<Event>(&entry)) return sizeof(Entry) + event->what.size();
  if (const auto* button = std::get_if<ButtonEvent>(&entry))
    return sizeof(Entry) + button->button.size();
  const auto* record = std::get_if<session::TrackRecord>(&entry);
  if (!record) return 0;
  constexpr std::uint64_t of_a_name = 128;  // of a node of a map and its key
  std::uint64_t bytes = sizeof(Entry) + record->tags.size() * sizeof(int);
  bytes += record->scene.objects.size() * (of_a_name + sizeof(glm::dmat4));
  bytes += record->scene.lights.size() * (of_a_name + sizeof(session::LightState));
  bytes += record->carriers.size() * (of_a_name + sizeof(session::CarrierState));
  if (const auto& light = record->captured_light)
    bytes += light->sources.size() * sizeof(session::CapturedSource) +
             light->ambient.size() * sizeof(glm::vec3);
  return bytes;
}

void Recorder::offer(const FramePtr& frame) {
  const Captured captured{frame};
  bool is_first_dropped = false, is_silent = false;
  {
    std::unique_lock lock(mutex_);
    if (!status_.recording) {
      ring_bytes_ += bytes_of(captured);
      ring_.emplace_back(captured);
      if (!trim_ring() || std::exchange(short_preroll_noted_, true)) return;
      const double kept_s = ring_length_s();
      lock.unlock();
      return note_short_preroll(kept_s);
    }
    is_silent = has_new_silence();
    if (frame->source == "light") remember_light(captured);
    if (queued_bytes_ + bytes_of(captured) <= options_.queue_bytes) {
      if (frame->source == "observer") last_frame_ns_ = frame->timestamp_ns;
      enqueue(captured);
    } else {
      count_as_lost(captured);
      is_first_dropped = status_.lost.frames == 1;
    }
  }
  if (is_silent)
    note(Severity::warning, "the disk does not answer; what is recorded waits in memory");
  if (is_first_dropped) note(Severity::warning, "the disk is too slow; frames are left out");
}

bool Recorder::has_new_silence() {
  if (silence_noted_ || !handling_since_ || Clock::now() - *handling_since_ < silence) return false;
  return silence_noted_ = true;
}

void Recorder::offer_shown(const FramePtr& frame) {
  const Captured captured{frame};
  {
    const std::lock_guard lock(mutex_);
    if (!status_.recording) return;
    if (queued_bytes_ + bytes_of(captured) <= options_.queue_bytes / 2) return enqueue(captured);
    count_as_lost(captured);
    if (status_.lost.shown > 1) return;
  }
  note(Severity::warning, "the disk is too slow; pictures that were shown are left out");
}

void Recorder::remember_light(const Captured& captured) {
  forget_lights_unlike(*captured.frame);
  older_light_[exposure_step(captured.frame->exposure)] = captured;
  if (older_light_.size() <= most_exposures) return;
  older_light_.erase(std::ranges::min_element(
      older_light_, {}, [](const auto& older) { return older.second.frame->timestamp_ns; }));
}

void Recorder::forget_lights_unlike(const Frame& frame) {
  std::erase_if(older_light_, [&](const auto& older) {
    const Frame& known = *older.second.frame;
    return known.format != frame.format || known.bayer != frame.bayer ||
           known.width != frame.width || known.height != frame.height;
  });
}

void Recorder::offer(const session::TrackRecord& record) {
  const std::lock_guard lock(mutex_);
  if (status_.recording || (late_tracks_ && record.timestamp_ns <= last_frame_ns_))
    return enqueue_record(record);
  ring_.emplace_back(record);
  ring_bytes_ += bytes_of(ring_.back());
  while (ring_bytes_ > options_.queue_bytes / 2) forget_first_of_ring();
}

void Recorder::offer(const ButtonEvent& event) {
  const std::lock_guard lock(mutex_);
  if (status_.recording) enqueue_record(event);
}

void Recorder::offer_event(std::int64_t timestamp_ns, const std::string& what) {
  const std::lock_guard lock(mutex_);
  if (status_.recording) enqueue_record(Event{timestamp_ns, what});
}

void Recorder::enqueue(Entry entry) {
  queued_bytes_ += bytes_of(entry);
  queue_.push_back(std::move(entry));
  filled_.notify_one();
}

// Frames fill the queue first, so that a disk that is a little too slow loses no tracking.
void Recorder::enqueue_record(Entry entry) {
  if (queued_bytes_ + bytes_of(entry) <= options_.queue_bytes + options_.queue_bytes / 8)
    enqueue(std::move(entry));
  else
    count_as_lost(entry);
}

void Recorder::count_as_lost(const Entry& entry) {
  if (const auto* captured = std::get_if<Captured>(&entry))
    ++(captured->frame->source == "composite" ? status_.lost.shown : status_.lost.frames);
  else if (bytes_of(entry) > 0)
    ++status_.lost.records;
}

// Drops the ring's oldest entries, counting time from its newest frame. A full ring must fit the
// queue with room to spare. Returns whether frames were dropped only because it was full.
bool Recorder::trim_ring() {
  const std::int64_t newest = std::get<Captured>(ring_.back()).frame->timestamp_ns;
  const auto keep_ns = static_cast<std::int64_t>(options_.preroll_s * 1e9);
  bool is_short = false;
  while (!ring_.empty()) {
    const auto* captured = std::get_if<Captured>(&ring_.front());
    const bool old = !captured || newest - captured->frame->timestamp_ns > keep_ns;
    if (!old && ring_bytes_ <= options_.queue_bytes / 2) break;
    is_short = is_short || !old;
    forget_first_of_ring();
  }
  return is_short;
}

// Returns the time from the oldest frame of the ring to the newest.
double Recorder::ring_length_s() const {
  std::optional<std::int64_t> first, last;
  for (const Entry& entry : ring_)
    if (const auto* captured = std::get_if<Captured>(&entry)) {
      last = captured->frame->timestamp_ns;
      if (!first) first = last;
    }
  return first ? 1e-9 * static_cast<double>(*last - *first) : 0;
}

void Recorder::note_short_preroll(double kept_s) const {
  if (!options_.note) return;
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(),
                "a take begins %.1f s before the button, and not %.1f s: the memory for it is full "
                "(recording.queue_mb)",
                kept_s, options_.preroll_s);
  options_.note({.severity = Severity::warning,
                 .source = "recording",
                 .text = text.data(),
                 .notice = report::Notice{Severity::warning, "", text.data()}});
}

void Recorder::forget_first_of_ring() {
  ring_bytes_ -= bytes_of(ring_.front());
  const auto* captured = std::get_if<Captured>(&ring_.front());
  if (captured && captured->frame->source == "light") remember_light(*captured);
  ring_.pop_front();
}

// In standby, or while the camera is missing, nothing is offered, and the ring's entries become too
// old.
void Recorder::forget_what_is_long_ago() {
  const auto keep = std::chrono::duration<double>(options_.preroll_s) + late;
  const auto is_long_ago = [&](const Entry& entry) {
    const auto* captured = std::get_if<Captured>(&entry);
    return !captured || Clock::now() - captured->offered > keep;
  };
  while (!ring_.empty() && is_long_ago(ring_.front())) forget_first_of_ring();
}

void Recorder::start() {
  const std::lock_guard lock(mutex_);
  if (status_.recording) return;
  status_.recording = true;
  late_tracks_ = false;
  status_.lost = {};
  status_.frames = 0;
  status_.seconds = 0;
  status_.fault.clear();
  enqueue(Start{});
  forget_what_is_long_ago();
  for (const Entry& entry : ring_)
    if (const auto* captured = std::get_if<Captured>(&entry);
        captured && captured->frame->source == "light")
      forget_lights_unlike(*captured->frame);
  std::vector<Captured> lights;
  for (const auto& [step, light] : older_light_) lights.push_back(light);
  std::ranges::sort(lights, {}, [](const Captured& c) { return c.frame->timestamp_ns; });
  for (const Captured& light : lights) enqueue(light);
  for (Entry& entry : ring_) {
    if (const auto* captured = std::get_if<Captured>(&entry)) {
      if (captured->frame->source == "observer") last_frame_ns_ = captured->frame->timestamp_ns;
      if (captured->frame->source == "light") remember_light(*captured);
    }
    enqueue(std::move(entry));
  }
  ring_.clear();
  ring_bytes_ = 0;
}

void Recorder::stop() {
  const std::lock_guard lock(mutex_);
  if (status_.recording) enqueue_stop(true);
}

void Recorder::enqueue_stop(bool is_wished) {
  status_.recording = false;
  late_tracks_ = true;
  enqueue(Stop{status_.lost, is_wished});
}

void Recorder::mark_good() {
  const std::lock_guard lock(mutex_);
  enqueue(MarkGood{});
}

RecorderStatus Recorder::status() const {
  const std::lock_guard lock(mutex_);
  RecorderStatus status = status_;
  if (handling_since_)
    status.disk_silent_s = std::chrono::duration<double>(Clock::now() - *handling_since_).count();
  return status;
}

void Recorder::note(Severity severity, const std::string& what) const {
  if (options_.note) options_.note({severity, "recording", what});
}

void Recorder::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    const auto something = [this] { return !queue_.empty() || quit_; };
    filled_.wait_until(lock, end_at_.value_or(looked_ + disk_interval), something);
    const bool finished = queue_.empty();
    std::optional<Entry> entry;
    if (!finished) {
      entry = std::move(queue_.front());
      queue_.pop_front();
      queued_bytes_ -= bytes_of(*entry);
    }
    const bool leave = quit_ && finished;
    handling_since_ = Clock::now();
    lock.unlock();
    if (!looked_for_interruption_ && !take_) look_for_interruption();
    serve(entry, leave);
    look_at_disk();
    lock.lock();
    if (entry) {
      queued_bytes_ += bytes_of(*entry);
      queue_.push_front(std::move(*entry));
    }
    const bool answers_again = std::exchange(silence_noted_, false);
    handling_since_.reset();
    if (answers_again) {
      lock.unlock();
      note(Severity::info, "the disk answers again");
      lock.lock();
    }
    if (leave) return;
  }
}

// Handles an entry and whatever else is due. What is left of `entry` could not be written, and
// waits for the next disk.
void Recorder::serve(std::optional<Entry>& entry, bool is_last) {
  try {
    if (entry) handle(*entry);
    entry.reset();
    if (take_ && assets_.is_ready()) add_assets();
    const bool is_over = end_at_ && (is_last || Clock::now() >= *end_at_);
    if (is_over || (end_at_ && take_->track_is_complete())) end_take(stopped_lost_);
    if (take_ && Clock::now() - checked_ >= disk_interval) check_disk();
  } catch (const std::exception& error) {
    if (goes_on_elsewhere(error.what())) return;
    if (entry) {
      const std::lock_guard lock(mutex_);
      count_as_lost(*entry);
    }
    entry.reset();
    fail(error.what());
  }
}

void Recorder::handle(Entry& entry) {
  if (std::holds_alternative<Start>(entry)) {
    end_last_take();
    folders_.forgive_all();
    begin_take();
  } else if (std::holds_alternative<MarkGood>(entry)) {
    const std::filesystem::path last = status().directory;
    if (take_)
      take_->mark_good();
    else if (!last.empty())
      session::change_take(last, [](session::TakeInfo& take) { take.good = true; });
    note(Severity::info,
         last.empty() ? "there is no take to mark" : last.filename().string() + " is marked good");
  } else if (!take_) {
    return;  // the take has failed meanwhile
  } else if (const auto* stop = std::get_if<Stop>(&entry)) {
    end_at_ = Clock::now() + track_patience;
    stopped_lost_ = stop->lost;
    was_stopped_ = stop->is_wished;
  } else if (const auto* captured = std::get_if<Captured>(&entry)) {
    write(*captured);
  } else if (const auto* record = std::get_if<session::TrackRecord>(&entry)) {
    take_->write(*record);
  } else if (const auto* button = std::get_if<ButtonEvent>(&entry)) {
    take_->write(*button);
  } else if (const auto* event = std::get_if<Event>(&entry)) {
    take_->write_event(event->timestamp_ns, event->what);
  }
}

void Recorder::write(const Captured& captured) {
  if (!take_->fits(*captured.frame) && captured.frame->source == "composite") {
    const std::lock_guard lock(mutex_);  // forgets lights from before the camera's format changed
    ++status_.lost.shown;
    return;
  }
  if (!take_->fits(*captured.frame)) {
    note(Severity::warning, "the " + captured.frame->source + " camera changed its format; " +
                                take_->directory().filename().string() +
                                " ends and the next take begins");
    begin_next_take();
  }
  take_->write(*captured.frame, captured.at);
  if (captured.frame->source != "observer") return;
  const std::int64_t now_ns = captured.frame->timestamp_ns;
  if (take_->observer_frames() == 1) take_begins_ns_ = now_ns;
  const std::lock_guard lock(mutex_);
  status_.frames = take_->observer_frames();
  status_.seconds = 1e-9 * static_cast<double>(now_ns - take_begins_ns_);
}

// Ends the running take in order and goes on in the next one, without a frame between them.
void Recorder::begin_next_take() {
  session::Losses so_far;
  {
    const std::lock_guard lock(mutex_);
    so_far = status_.lost;
  }
  end_take(so_far);
  begin_take();
}

void Recorder::begin_take() {
  while (!take_) {
    const std::filesystem::path folder = folders_.choose();
    try {
      take_ = std::make_unique<TakeWriter>(options_.take, folder);
    } catch (const std::exception& error) {
      if (!folders_.give_up(folder)) throw;
      note(Severity::error, std::string("the next disk is taken: ") + error.what());
    }
  }
  checked_ = Clock::now();
  lacks_assets_ = !options_.take.assets.empty();
  try {
    TakeFolders::keep_wish(take_->directory());
  } catch (const Error& error) {
    note(Severity::warning,
         std::string("after a restart it would not go on by itself: ") + error.what());
  }
  const std::lock_guard lock(mutex_);
  status_.directory = take_->directory();
  status_.number = take_->number();
}

void Recorder::add_assets() {
  if (std::exchange(lacks_assets_, false)) take_->add_assets(assets_.files());
}

void Recorder::drop_wish() {
  try {
    folders_.drop_wish();
  } catch (const Error& error) {
    note(Severity::warning,
         std::string("after a restart it would begin by itself: ") + error.what());
  }
}

// Looks for what the last process left: the wish to record, and takes that it could not end.
void Recorder::look_for_interruption() {
  try {
    looked_for_interruption_ = std::ranges::any_of(
        folders_.all(), [](const auto& folder) { return std::filesystem::exists(folder); });
    if (!looked_for_interruption_) return;
    std::vector<std::filesystem::path> takes;
    for (const std::filesystem::path& folder : folders_.all()) {
      if (!std::filesystem::exists(folder)) continue;
      for (const auto& entry : std::filesystem::directory_iterator(folder))
        if (entry.is_directory()) takes.push_back(entry.path());
    }
    std::ranges::sort(takes, {}, [](const auto& take) { return take.filename(); });
    for (const std::filesystem::path& take : takes) salvage(take);
    std::optional<std::string> interrupted = folders_.kept_wish();
    const std::lock_guard lock(mutex_);
    status_.interrupted = std::move(interrupted);
  } catch (const std::exception& error) {
    looked_for_interruption_ = true;  // once, and not each second
    note(Severity::warning, std::string("takes from before cannot be looked at: ") + error.what());
  }
}

void Recorder::salvage(const std::filesystem::path& take) {
  try {
    const std::optional<std::uint64_t> frames = session::salvage(take);
    if (!frames) return;
    const std::lock_guard lock(mutex_);
    status_.salvaged.push_back(take.filename().string() + " was cut off; it has " +
                               std::to_string(*frames) + " frames");
  } catch (const std::exception& error) {
    note(Severity::warning, std::string("a take from before cannot be read: ") + error.what());
  }
}

// Ends the take that waits for its tracks when the next one begins. What goes wrong with it is no
// reason not to begin.
void Recorder::end_last_take() {
  try {
    if (end_at_) end_take(stopped_lost_);
  } catch (const std::exception& error) {
    {
      const std::lock_guard lock(mutex_);
      count_failure(error.what());
    }
    leave_take(error.what());
  }
  attributed_ = {};
  was_stopped_ = false;
}

void Recorder::end_take(const session::Losses& lost) {
  end_at_.reset();
  attribute(lost);
  add_assets();
  take_->close();
  {
    const std::lock_guard lock(mutex_);
    count_finished();
    if (!status_.recording) late_tracks_ = false;
  }
  if (was_stopped_) drop_wish();
  note(Severity::info, take_->directory().filename().string() + " has " +
                           std::to_string(take_->observer_frames()) + " frames");
  take_.reset();
}

void Recorder::attribute(const session::Losses& lost) {
  take_->set_lost({lost.frames - attributed_.frames, lost.shown - attributed_.shown,
                   lost.records - attributed_.records});
  attributed_ = lost;
}

// After a failure of the running take's disk: leaves that take and begins the next one on the next
// disk, if there is one. Returns whether it goes on.
bool Recorder::goes_on_elsewhere(const std::string& why) {
  if (!take_ || end_at_) return false;
  const std::filesystem::path failed = take_->directory();
  if (!folders_.give_up(failed.parent_path())) return false;
  session::Losses so_far;
  {
    const std::lock_guard lock(mutex_);
    so_far = status_.lost;
    count_finished();
  }
  attribute(so_far);
  take_->abandon(why);
  take_.reset();
  try {
    begin_take();
  } catch (const std::exception& error) {
    note(Severity::error, std::string("recording cannot go on elsewhere: ") + error.what());
    return false;
  }
  note(Severity::error, failed.filename().string() + " ended: " + why + "; recording goes on in " +
                            take_->directory().string());
  return true;
}

void Recorder::fail(const std::string& why) {
  {
    const std::lock_guard lock(mutex_);
    for (; !queue_.empty() && !std::holds_alternative<Start>(queue_.front()); queue_.pop_front()) {
      queued_bytes_ -= bytes_of(queue_.front());
      count_as_lost(queue_.front());
    }
    if (queue_.empty()) status_.recording = late_tracks_ = false;
    if (take_) attribute(status_.lost);
    count_failure(why);
  }
  leave_take(why);
  drop_wish();
}

void Recorder::count_failure(const std::string& why) {
  status_.fault = why;
  ++status_.failures;
  count_finished();
}

void Recorder::count_finished() {
  if (!take_ || take_->observer_frames() == 0) return;
  ++status_.finished_takes;
  status_.finished = take_->directory().filename().string();
}

// Leaves the files as they are: a session that was not closed opens up to its last whole frame.
void Recorder::leave_take(const std::string& why) {
  end_at_.reset();
  if (take_) take_->abandon(why);
  take_.reset();
  if (options_.note) options_.note({Severity::error, "recording ended", why});
}

// Ends the take properly while there is still room on its disk, and goes on where there is more.
void Recorder::check_disk() {
  checked_ = Clock::now();
  const std::filesystem::path full = take_->directory();
  if (end_at_ || folders_.has_room(full.parent_path())) return;
  begin_next_take();
  note(Severity::warning, "the disk of " + full.filename().string() +
                              " is almost full; recording goes on in " +
                              take_->directory().string());
}

void Recorder::look_at_disk() {
  if (Clock::now() - looked_ < disk_interval) return;
  looked_ = Clock::now();
  if (options_.measures_disk && !take_ && !has_compared_speeds_) compare_speeds();
  const std::optional<std::uint64_t> left = folders_.free_bytes();
  const std::lock_guard lock(mutex_);
  free_bytes_ = left;
}

// Compares what the cameras deliver, by the ring, with what the disk takes. FFV1 packs pictures of
// a camera to about half.
void Recorder::compare_speeds() {
  constexpr double packed = 0.5, least_length_s = 0.5;
  double rate = 0;
  {
    const std::lock_guard lock(mutex_);
    const double length_s = ring_length_s();
    if (status_.recording || length_s <= 0) return;
    if (length_s < std::min(least_length_s, 0.5 * options_.preroll_s)) return;
    rate = static_cast<double>(ring_bytes_) / length_s;
  }
  has_compared_speeds_ = true;
  try {
    const std::optional<double> speed = folders_.measure_speed();
    if (!speed || *speed > packed * rate) return;
    note(Severity::warning, "the disk takes " + megabytes(*speed) +
                                " a second, and the cameras deliver " + megabytes(rate) +
                                ": takes will lack frames");
  } catch (const std::exception& error) {
    note(Severity::warning, std::string("the disk's speed is not known: ") + error.what());
  }
}

std::optional<std::uint64_t> Recorder::free_bytes() const {
  const std::lock_guard lock(mutex_);
  return free_bytes_;
}

}  // namespace previz::output
