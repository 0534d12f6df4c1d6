#include "daemon/output/recorder.hpp"

#include <algorithm>
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

std::string megabytes(std::uint64_t bytes) {
  return std::to_string(bytes / 1'000'000) + " MB";
}

}  // namespace

Recorder::Recorder(RecorderOptions options) : options_(std::move(options)) {
  thread_ = std::jthread([this] { run(); });
}

Recorder::~Recorder() {
  stop();
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
  }
  filled_.notify_one();
  thread_.join();
}

std::uint64_t Recorder::bytes_of(const Entry& entry) {
  const auto* captured = std::get_if<Captured>(&entry);
  return captured ? captured->frame->bytes.size() : 0;
}

void Recorder::offer(const FramePtr& frame) {
  const Captured captured{frame};
  {
    const std::lock_guard lock(mutex_);
    if (!status_.recording) {
      ring_bytes_ += bytes_of(captured);
      ring_.emplace_back(captured);
      return trim_ring();
    }
    if (frame->source == "light") remember_light(captured);
    if (queued_bytes_ + bytes_of(captured) <= options_.queue_bytes) {
      if (frame->source == "observer") last_frame_ns_ = frame->timestamp_ns;
      return enqueue(captured);
    }
    if (++status_.dropped > 1) return;
  }
  note(Severity::warning, "the disk is too slow; frames are left out");
}

void Recorder::offer_shown(const FramePtr& frame) {
  const Captured captured{frame};
  {
    const std::lock_guard lock(mutex_);
    if (!status_.recording) return;
    if (queued_bytes_ + bytes_of(captured) <= options_.queue_bytes / 2) return enqueue(captured);
    if (++status_.dropped_shown > 1) return;
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
    return enqueue(record);
  ring_.emplace_back(record);
}

void Recorder::offer(const ButtonEvent& event) {
  const std::lock_guard lock(mutex_);
  if (status_.recording) enqueue(event);
}

void Recorder::offer_event(std::int64_t timestamp_ns, const std::string& what) {
  const std::lock_guard lock(mutex_);
  if (status_.recording) enqueue(Event{timestamp_ns, what});
}

void Recorder::enqueue(Entry entry) {
  queued_bytes_ += bytes_of(entry);
  queue_.push_back(std::move(entry));
  filled_.notify_one();
}

// Drops the ring's oldest entries, counting time from its newest frame. A full ring must fit the
// queue with room to spare.
void Recorder::trim_ring() {
  const std::int64_t newest = std::get<Captured>(ring_.back()).frame->timestamp_ns;
  const auto keep_ns = static_cast<std::int64_t>(options_.preroll_s * 1e9);
  while (!ring_.empty()) {
    const auto* captured = std::get_if<Captured>(&ring_.front());
    const bool old = !captured || newest - captured->frame->timestamp_ns > keep_ns;
    if (!old && ring_bytes_ <= options_.queue_bytes / 2) break;
    forget_first_of_ring();
  }
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
  status_.dropped = status_.dropped_shown = status_.frames = 0;
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
  if (!status_.recording) return;
  status_.recording = false;
  late_tracks_ = true;
  enqueue(Stop{});
}

void Recorder::mark_good() {
  const std::lock_guard lock(mutex_);
  enqueue(MarkGood{});
}

RecorderStatus Recorder::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void Recorder::note(Severity severity, const std::string& what) const {
  if (options_.note) options_.note({severity, "recording", what});
}

void Recorder::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    const auto something = [this] { return !queue_.empty() || quit_; };
    if (end_at_)
      filled_.wait_until(lock, *end_at_, something);
    else
      filled_.wait(lock, something);
    if (queue_.empty() && !quit_ && !(end_at_ && Clock::now() >= *end_at_)) continue;
    const bool finished = queue_.empty();
    std::optional<Entry> entry;
    if (!finished) {
      entry = std::move(queue_.front());
      queue_.pop_front();
      queued_bytes_ -= bytes_of(*entry);
    }
    const bool leave = quit_ && finished;
    lock.unlock();
    try {
      if (entry) handle(*entry);
      if (end_at_ && (finished || take_->track_is_complete())) end_take();
      if (take_ && Clock::now() - checked_ >= disk_interval) check_disk();
    } catch (const std::exception& error) {
      fail(error.what());
    }
    lock.lock();
    if (leave) return;
  }
}

void Recorder::handle(Entry& entry) {
  if (std::holds_alternative<Start>(entry)) {
    if (end_at_) end_take();
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
  } else if (std::holds_alternative<Stop>(entry)) {
    end_at_ = Clock::now() + track_patience;
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
    ++status_.dropped_shown;
    return;
  }
  if (!take_->fits(*captured.frame)) {
    note(Severity::warning, "the " + captured.frame->source + " camera changed its format; " +
                                take_->directory().filename().string() +
                                " ends and the next take begins");
    end_take();
    begin_take();
  }
  take_->write(*captured.frame, captured.at);
  if (captured.frame->source != "observer") return;
  const std::int64_t now_ns = captured.frame->timestamp_ns;
  if (take_->observer_frames() == 1) take_begins_ns_ = now_ns;
  const std::lock_guard lock(mutex_);
  status_.frames = take_->observer_frames();
  status_.seconds = 1e-9 * static_cast<double>(now_ns - take_begins_ns_);
}

void Recorder::begin_take() {
  check_disk();
  take_ = std::make_unique<TakeWriter>(options_.take);
  const std::lock_guard lock(mutex_);
  status_.directory = take_->directory();
  status_.number = take_->number();
}

void Recorder::end_take() {
  end_at_.reset();
  take_->close();
  const std::unique_ptr<TakeWriter> take = std::move(take_);
  {
    const std::lock_guard lock(mutex_);
    if (take->observer_frames() > 0) ++status_.finished_takes;
    if (!status_.recording) late_tracks_ = false;
  }
  note(Severity::info, take->directory().filename().string() + " has " +
                           std::to_string(take->observer_frames()) + " frames");
}

// Leaves the files as they are: a session that was not closed opens up to its last whole frame.
void Recorder::fail(const std::string& why) {
  end_at_.reset();
  const bool any = take_ && take_->observer_frames() > 0;
  take_.reset();
  {
    const std::lock_guard lock(mutex_);
    for (; !queue_.empty() && !std::holds_alternative<Start>(queue_.front()); queue_.pop_front()) {
      queued_bytes_ -= bytes_of(queue_.front());
      if (std::holds_alternative<Captured>(queue_.front())) ++status_.dropped;
    }
    if (queue_.empty()) status_.recording = late_tracks_ = false;
    status_.fault = why;
    ++status_.failures;
    if (any) ++status_.finished_takes;
  }
  if (options_.note) options_.note({Severity::error, "recording ended", why});
}

// Ends the take properly while there is still room on the disk.
void Recorder::check_disk() {
  checked_ = Clock::now();
  std::filesystem::create_directories(options_.take.directory);
  const std::uint64_t free = free_on_disk();
  if (free >= options_.reserve_bytes) return;
  if (take_) take_->close();
  throw Error(options_.take.directory.string() + ": the disk is almost full, " + megabytes(free) +
              " are left and " + megabytes(options_.reserve_bytes) +
              " are kept free (recording.reserve_mb)");
}

// If the directory is not there yet, this asks the disk on which it will be made.
std::uint64_t Recorder::free_on_disk() const {
  if (options_.free_bytes) return options_.free_bytes();
  std::filesystem::path folder = std::filesystem::absolute(options_.take.directory);
  while (!std::filesystem::exists(folder) && folder.has_relative_path())
    folder = folder.parent_path();
  return std::filesystem::space(folder).available;
}

std::optional<std::uint64_t> Recorder::free_bytes() const {
  try {
    const std::uint64_t free = free_on_disk();
    return free - std::min(free, options_.reserve_bytes);
  } catch (const std::filesystem::filesystem_error&) {
    return std::nullopt;
  }
}

}  // namespace previz::output
