#include "daemon/core/output/recorder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "drivers/bracket.hpp"
#include "drivers/error.hpp"

namespace previz::output {

using report::Severity;

namespace {

// A stopped take waits so long for the tracking of its last frames.
constexpr std::chrono::milliseconds track_patience{500};
constexpr std::chrono::seconds disk_interval{1};
// A take that ends is looked at so often.
constexpr std::chrono::milliseconds ending_interval{10};
// A recording that is further behind the cameras is reported.
constexpr double long_behind_s = 1;
// A disk that takes longer for one thing is reported.
constexpr std::chrono::seconds silence{2};

// Why something that was offered is not kept.
constexpr const char *too_far_behind = "too far behind", *memory_full = "memory full",
                     *cannot_be_recorded = "cannot be recorded";

}  // namespace

Recorder::Recorder(RecorderOptions options)
    : options_(std::move(options)),
      queue_(options_.preroll_s, options_.queue_bytes, options_.most_behind_s),
      folders_(options_.take.folders, options_.reserve_bytes, options_.free_bytes),
      told_(options_.take.folders.size()),
      kept_numbers_(options_.take.folders.size()) {
  const auto warn = [this](const std::string& what) { note(Severity::warning, what); };
  const std::string slate = options_.take.info.take.value_or(session::TakeInfo{}).slate;
  for (std::size_t i = 0; i < folders_.all().size(); ++i) {
    stores_.push_back(std::make_unique<AssetStore>(
        folders_.all()[i] / ".assets", options_.take.assets, warn, folders_.room_of(i)));
    const auto on_news = [this] {
      const std::lock_guard lock(mutex_);
      has_news_ = true;
      filled_.notify_one();
    };
    watches_.push_back(std::make_unique<FolderWatch>(
        FolderWatchOptions{folders_.all()[i], slate, options_.free_bytes, warn, on_news}));
  }
  status_.directory = options_.last_take;
  status_.finished = options_.last_take.filename().string();
  status_.good = options_.is_last_good;
  thread_ = std::jthread([this] { run(); });
}

Recorder::~Recorder() {
  finish();
}

void Recorder::finish() {
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(quit_, true)) return;
    status_.recording = false;  // the take that runs is ended with the last entry
  }
  filled_.notify_one();
  thread_.join();
}

void Recorder::offer(const FramePtr& frame) {
  const Captured captured{frame};
  bool is_first_dropped = false, is_silent = false, lags = false, is_far_behind = false;
  {
    std::unique_lock lock(mutex_);
    if (!status_.recording) {
      if (!queue_.keep(captured) || std::exchange(short_preroll_noted_, true)) return;
      const double kept_s = queue_.ring_length_s();
      lock.unlock();
      return note_short_preroll(kept_s);
    }
    is_silent = has_new_silence();
    const bool had_lost = status_.lost.frames > 0;
    const LeftOut left_out = queue_.push(captured);
    count_as_lost(left_out);
    is_far_behind = left_out.is_too_far_behind;
    is_first_dropped = !had_lost && status_.lost.frames > 0;
    lags = has_new_lag();
  }
  filled_.notify_one();
  if (is_silent)
    note(Severity::warning, "the disk does not respond; the recording waits in memory");
  if (lags)
    note(Severity::warning,
         "the recording is more than a second behind the cameras; what waits is lost if the "
         "computer crashes");
  if (is_first_dropped && is_far_behind)
    note_far_behind();
  else if (is_first_dropped)
    note(Severity::warning,
         "the disk is too slow, and the memory for what waits is full "
         "(recording.queue_mb); frames are dropped");
}

bool Recorder::has_new_silence() {
  if (silence_noted_ || !handling_since_ || Clock::now() - *handling_since_ < silence) return false;
  return silence_noted_ = true;
}

bool Recorder::has_new_lag() {
  const Backlog backlog = queue_.backlog();
  if (behind_noted_ || backlog.seconds - backlog.of_ring_s < long_behind_s) return false;
  return behind_noted_ = true;
}

void Recorder::offer_shown(const FramePtr& frame) {
  const Captured captured{frame};
  {
    const std::lock_guard lock(mutex_);
    if (!status_.recording) return;
    const LeftOut left_out = queue_.push_shown(captured);
    if (!left_out.any()) return filled_.notify_one();
    count_as_lost(left_out);
    if (status_.lost.shown > 1) return;
  }
  note(Severity::warning, "the disk is too slow; composite frames are dropped");
}

void Recorder::offer(const session::TrackRecord& record) {
  const std::lock_guard lock(mutex_);
  if (status_.recording || (late_tracks_ && record.timestamp_ns <= queue_.last_frame_ns()))
    offer_record(record);
  else
    queue_.keep(record);
}

void Recorder::offer(const ButtonEvent& event) {
  const std::lock_guard lock(mutex_);
  if (status_.recording) offer_record(event);
}

bool Recorder::offer(const session::MarkEvent& mark) {
  const std::lock_guard lock(mutex_);
  return status_.recording && offer_record(mark);
}

void Recorder::offer_event(std::int64_t timestamp_ns, const std::string& what) {
  const std::lock_guard lock(mutex_);
  if (status_.recording) offer_record(RecordQueue::Event{timestamp_ns, what});
}

bool Recorder::offer_record(Entry entry) {
  const LeftOut lost = queue_.push_record(std::move(entry));
  count_as_lost(lost);
  filled_.notify_one();
  return lost.of_newest == session::Losses{};
}

void Recorder::count_as_lost(const session::Losses& loss, const char* cause, bool of_newest) {
  if (of_newest) add(status_.lost, loss);
  const std::uint64_t pictures = loss.frames + loss.shown;
  try {
    if (pictures > 0 && options_.left_out) options_.left_out(cause, pictures);
  } catch (const std::exception&) {
    return;  // there is no memory for a new cause
  }
}

void Recorder::count_as_lost(const LeftOut& left_out) {
  const char* cause = left_out.is_too_far_behind ? too_far_behind : memory_full;
  count_as_lost(left_out.of_newest, cause, true);
  count_as_lost(left_out.of_older, cause, false);
}

void Recorder::note_short_preroll(double kept_s) const {
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(),
                "takes begin %.1f s before the button, not %.1f s: the frame memory is full "
                "(recording.queue_mb)",
                kept_s, options_.preroll_s);
  note(Severity::warning, text.data(), "recording", /*is_shown=*/true);
}

void Recorder::start() {
  const std::lock_guard lock(mutex_);
  if (status_.recording) return;
  if (stops_unmarked_) queue_.push_mark(RecordQueue::Stop{});
  stops_unmarked_ = false;
  const session::Losses lost = queue_.begin();
  ++starts_;
  status_.recording = true;
  status_.lost = {};
  count_as_lost(lost, memory_full, true);
  status_.frames = 0;
  status_.seconds = 0;
  status_.fault.clear();
  behind_noted_ = false;
  filled_.notify_one();
}

void Recorder::stop() {
  const std::lock_guard lock(mutex_);
  if (!status_.recording) return;
  try {
    queue_.push_mark(RecordQueue::Stop{});
  } catch (const std::bad_alloc&) {
    stops_unmarked_ = true;  // a stop needs no memory
  }
  status_.recording = false;
  late_tracks_ = true;
  filled_.notify_one();
}

void Recorder::mark_good() {
  const std::lock_guard lock(mutex_);
  queue_.push_mark(RecordQueue::MarkGood{});
  filled_.notify_one();
}

RecorderStatus Recorder::status() const {
  const std::lock_guard lock(mutex_);
  RecorderStatus status = status_;
  status.writing = status_.recording || writes_ || !queue_.empty();
  const bool is_whole =
      named_ == starts_ && status.finished == status.directory.filename().string();
  status.ending = status.writing && !status.recording && !is_whole;
  status.backlog = queue_.backlog();
  if (handling_since_)
    status.disk_silent_s = std::chrono::duration<double>(Clock::now() - *handling_since_).count();
  return status;
}

// No take ends, and nothing is counted twice, because there is no memory to speak of it.
void Recorder::note(Severity severity, std::string_view what, const char* source,
                    bool is_shown) const {
  try {
    report::Report report{severity, source, std::string(what)};
    if (is_shown) report.notice = report::Notice{severity, "", report.text};
    if (options_.note) options_.note(report);
  } catch (const std::exception&) {
    return;
  }
}

void Recorder::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    const bool waits = !ending_.empty();
    const auto due = Clock::now() + (waits ? ending_interval : disk_interval);
    filled_.wait_until(lock, due, [&] {
      return !queue_.empty() || stops_unmarked_ || has_news_ || (quit_ && !waits);
    });
    bool has_news = std::exchange(has_news_, false);
    std::optional<Queued> next;
    if (!queue_.empty())
      next = queue_.pop();
    else if (std::exchange(stops_unmarked_, false))
      next = Queued{RecordQueue::Stop{}, {}};
    if (next && std::holds_alternative<RecordQueue::Start>(next->entry)) ++begun_;
    const bool is_last = quit_ && !next;
    handling_since_ = Clock::now();
    writes_ = take_ || !ending_.empty() || next;
    lock.unlock();
    while (!is_served(has_news, next, is_last)) std::this_thread::sleep_for(memory_interval);
    lock.lock();
    writes_ = take_ || !ending_.empty();
    const bool answers_again = std::exchange(silence_noted_, false);
    handling_since_.reset();
    if (answers_again) {
      lock.unlock();
      note(Severity::info, "the disk responds again");
      lock.lock();
    }
    if (is_last && ending_.empty()) return;
  }
}

// Returns false if something is left to be served again: an entry that its disk did not take, on
// the next disk; a stop, a mark or the end of a failure, once there is memory for it.
bool Recorder::is_served(bool& has_news, std::optional<Queued>& next, bool is_last) {
  try {
    if (has_news) take_news();
    has_news = false;
    if (failing_) fail({});
    if (take_ && is_last) end_running_take();
    serve(next, is_last);
    return !next;
  } catch (const std::bad_alloc&) {
    return false;
  }
}

// Handles an entry and whatever else is due. What is left of `next` could not be written, and waits
// for the next disk.
void Recorder::serve(std::optional<Queued>& next, bool is_last) {
  try {
    if (next) handle(*next);
    next.reset();
    if (take_) name_assets(*take_, false);
    if (take_ && Clock::now() - checked_ >= disk_interval) check_disk();
  } catch (const std::exception& error) {
    const bool is_memory = dynamic_cast<const std::bad_alloc*>(&error) != nullptr;
    const bool is_mark = next && (std::holds_alternative<RecordQueue::Stop>(next->entry) ||
                                  std::holds_alternative<RecordQueue::MarkGood>(next->entry));
    if (is_memory && is_mark) throw;
    const std::string why = reason_of(error);
    if (next && take_ && take_->writer->is_sound()) {
      const Queued left_out = std::move(*next);
      next.reset();
      leave_out(left_out.entry, *take_, why);
    } else if (is_memory || !goes_on_elsewhere(why)) {
      if (next) {
        const std::lock_guard lock(mutex_);
        const session::Losses loss = RecordQueue::loss_of(next->entry);
        count_as_lost(loss, disk_failed, is_newest());
        if (take_) add(take_->lost, loss);
      }
      next.reset();
      fail(why);
    }
  }
  end_what_is_over(is_last);
}

void Recorder::handle(Queued& next) {
  const Entry& entry = next.entry;
  if (take_ || !ending_.empty())
    add((take_ ? *take_ : ending_.back().take).lost, std::exchange(next.lost, {}));
  if (std::holds_alternative<RecordQueue::Start>(entry)) {
    folders_.forgive_all();
    light_.clear();
    begin_take(false);
  } else if (std::holds_alternative<RecordQueue::MarkGood>(entry)) {
    mark_last_good();
  } else if (const auto* record = std::get_if<session::TrackRecord>(&entry)) {
    write(*record);
  } else if (std::holds_alternative<RecordQueue::Stop>(entry)) {
    if (take_) end_running_take();
    drop_wish();
  } else if (!take_) {
    return;  // the take has failed meanwhile
  } else if (const auto* captured = std::get_if<Captured>(&entry)) {
    write(*captured);
  } else if (const auto* button = std::get_if<ButtonEvent>(&entry)) {
    take_->writer->write(*button);
  } else if (const auto* event = std::get_if<RecordQueue::Event>(&entry)) {
    take_->writer->write_event(event->timestamp_ns, event->what);
  } else if (const auto* mark = std::get_if<session::MarkEvent>(&entry)) {
    take_->writer->write(*mark);
  }
}

void Recorder::mark_last_good() {
  const std::filesystem::path last = status().directory;
  if (take_) {
    take_->writer->mark_good();
  } else if (last.empty()) {
    return note(Severity::info, "no take to mark");
  } else {
    try {
      if (ending_.empty())
        session::change_take(last, [](session::TakeInfo& take) { take.good = true; });
      else
        ending_.back().take.writer->mark_good();
    } catch (const std::exception& error) {
      return note(Severity::warning,
                  std::string("the take cannot be marked good: ") + reason_of(error));
    }
  }
  {
    const std::lock_guard lock(mutex_);
    status_.good = true;
  }
  note(Severity::info, last.filename().string() + " is marked good", "recording",
       /*is_shown=*/true);
}

void Recorder::write(const Captured& captured) {
  const Frame& frame = *captured.frame;
  if (!take_->writer->fits(frame) && frame.source == "composite") {
    constexpr session::Losses one{.frames = 0, .shown = 1, .records = 0};
    add(take_->lost, one);
    const std::lock_guard lock(mutex_);
    return count_as_lost(one, cannot_be_recorded, is_newest());
  }
  if (!take_->writer->fits(frame)) {
    note(Severity::warning, "the " + frame.source + " camera changed its format; " +
                                take_->writer->directory().filename().string() +
                                " ends and the next take begins");
    if (frame.source == "light") light_.forget_unlike(frame);
    begin_next_take();
  }
  take_->writer->write(frame, captured.at);
  if (frame.source == "light") light_.remember(captured);
  if (frame.source != "observer") return;
  if (take_->writer->observer_frames() == 1) take_->begins_ns = frame.timestamp_ns;
  const std::lock_guard lock(mutex_);
  if (!is_newest()) return;
  status_.frames = take_->writer->observer_frames();
  status_.seconds = 1e-9 * static_cast<double>(frame.timestamp_ns - take_->begins_ns);
}

// A track goes to the take that has its frame, which may have been stopped meanwhile.
void Recorder::write(const session::TrackRecord& record) {
  const auto ending = std::ranges::find_if(
      ending_, [&](const EndingTake& e) { return e.take.writer->has_frame_of(record); });
  if (ending == ending_.end()) {
    if (take_) take_->writer->write(record);
    return;
  }
  try {
    ending->take.writer->write(record);
  } catch (const std::exception& error) {
    Take& take = ending->take;
    if (take.writer->is_sound())
      leave_out(record, take, reason_of(error));
    else if (take.fault.empty())
      take.fault = reason_of(error);
  }
}

void Recorder::leave_out(const Entry& entry, Take& take, const std::string& why) {
  const session::Losses loss = RecordQueue::loss_of(entry);
  add(take.lost, loss);
  {
    const std::lock_guard lock(mutex_);
    count_as_lost(loss, cannot_be_recorded, is_newest());
  }
  if (std::exchange(take.has_noted_odd, true)) return;
  try {
    note(Severity::warning, take.writer->directory().filename().string() +
                                " is missing what cannot be recorded: " + why);
  } catch (const std::bad_alloc&) {
    return;  // it is counted
  }
}

// Ends the running take in order and goes on in the next one, without a frame between them.
void Recorder::begin_next_take() {
  end_running_take();
  begin_take(true);
}

void Recorder::end_running_take() {
  const Clock::time_point now = Clock::now();
  EndingTake& ending = ending_.emplace_back();  // without memory for it the take goes on
  ending = {std::move(*take_), now + track_patience, now + options_.asset_patience};
  take_.reset();
}

void Recorder::begin_take(bool goes_on) {
  while (!take_) {
    const std::size_t folder = folders_.choose([&](std::size_t i) { return why_not_own(i); });
    take_ = Take();
    take_->folder = folder;
    try {
      highest_number_ = next_number_in(folder);
      take_->writer =
          std::make_unique<TakeWriter>(options_.take, folders_.all()[folder], highest_number_);
      if (goes_on)
        for (const Captured& light : light_.in_order())
          take_->writer->write(*light.frame, light.at);
      tell_of_begun_take();
    } catch (const std::exception& error) {
      const std::optional<Take> failed = std::exchange(take_, std::nullopt);
      if (failed->writer) failed->writer->abandon(reason_of(error));
      const bool is_disks_fault = dynamic_cast<const std::bad_alloc*>(&error) == nullptr;
      if (!is_disks_fault ||
          !folders_.give_up(folder, folders_.all()[folder].string() + ": its disk failed"))
        throw;
      note(Severity::error, std::string("switching to the next disk: ") + reason_of(error));
    }
  }
}

void Recorder::tell_of_begun_take() {
  std::filesystem::path directory = take_->writer->directory();
  checked_ = Clock::now();
  if (!options_.take.assets.empty()) take_->order = stores_[take_->folder]->deliver(directory);
  watches_[take_->folder]->follow(directory);
  watches_[take_->folder]->keep_wish(directory);
  keep_numbers(folders());
  const std::lock_guard lock(mutex_);
  named_ = begun_;
  status_.directory = std::move(directory);
  status_.good = false;
  status_.number = take_->writer->number();
}

void Recorder::name_assets(Take& take, bool is_last) {
  if (!take.order) return;
  std::optional<AssetStore::Delivered> delivered = take.order->result();
  if (!delivered && !is_last) return;
  if (!delivered)
    delivered = stores_[take.folder]->undelivered("it was not copied by the end of the take");
  for (const session::MissingAsset& asset : delivered->missing)
    note(Severity::warning, take.writer->directory().filename().string() + " is missing " +
                                asset.as_written + ": " + asset.why);
  try {
    take.writer->set_assets(delivered->assets, delivered->missing);
  } catch (const std::exception& error) {
    if (!take.writer->is_sound()) throw;
    note(Severity::warning, std::string("the set's files cannot be listed: ") + reason_of(error));
  }
  take.order.reset();
}

}  // namespace previz::output
