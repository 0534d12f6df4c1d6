// How the recorder ends takes, in order or by a failure.
#include <algorithm>
#include <new>
#include <string>
#include <utility>

#include "daemon/core/output/recorder.hpp"
#include "daemon/core/set/check.hpp"
#include "drivers/error.hpp"

namespace previz::output {

using report::Severity;

// Ends the takes that have all they wait for, or have waited long enough.
void Recorder::end_what_is_over(bool is_last, bool at_once) {
  const Clock::time_point now = Clock::now();
  for (auto ending = ending_.begin(); ending != ending_.end();) {
    Take& take = ending->take;
    const bool has_tracks =
        is_last || take.writer->frames_without_track() == 0 || now >= ending->tracks_until;
    const bool has_assets =
        !take.order || take.order->result().has_value() || now >= ending->assets_until;
    if (!at_once && !(has_tracks && has_assets)) {
      ++ending;
      continue;
    }
    if (at_once && take.writer->has_track())
      take.lost.records += take.writer->frames_without_track();
    end(take);
    ending = ending_.erase(ending);
  }
  const std::lock_guard lock(mutex_);
  if (!status_.recording && !take_ && ending_.empty() && queue_.empty()) late_tracks_ = false;
}

// What goes wrong with a take that ends is that take's failure, and the recording's no more.
void Recorder::end(Take& take) {
  const std::string name = take.writer->directory().filename().string();
  // What is said is put into words before it is counted: afterwards there may be no memory for it.
  std::string said = name + " has " + set::plural(take.writer->observer_frames(), "frame");
  try {
    if (!take.fault.empty()) throw Error(take.fault);
    if (!take.writer->is_sound()) throw Error("a part of it could not be written");
    name_assets(take, true);
    take.writer->set_lost(take.lost);
    take.writer->close();
  } catch (const std::exception& error) {
    said = name + " could not be closed cleanly: " + reason_of(error);
    abandon(take, reason_of(error));
    {
      const std::lock_guard lock(mutex_);
      count_finished(take);
      count_failure(reason_of(error));
    }
    return note(Severity::error, said);
  }
  {
    const std::lock_guard lock(mutex_);
    count_finished(take);
  }
  note(Severity::info, said);
}

// Leaves the files as they are: a session that was not closed opens up to its last whole frame.
void Recorder::abandon(Take& take, const std::string& why) {
  if (take.order) {
    const AssetStore::Delivered delivered = take.order->result().value_or(
        stores_[take.folder]->undelivered("the take ended before it was copied"));
    take.writer->set_assets(delivered.assets, delivered.missing);
  }
  take.writer->set_lost(take.lost);
  take.writer->abandon(why);
}

// Where memory runs out meanwhile, it is called again, and goes on where it was.
void Recorder::fail(std::string why) {
  if (!failing_) failing_ = Failing{std::move(why)};
  if (!take_) {
    // The takes that are ending get the tracking that is there already, and wait for no more.
    std::unique_lock lock(mutex_);
    const std::vector<session::TrackRecord> late = leave_out_queue();
    lock.unlock();
    write_late(late);
    end_what_is_over(true, true);
  }
  std::vector<session::TrackRecord> late;
  {
    // In one go, so that nothing is offered to a take that is none any more.
    const std::lock_guard lock(mutex_);
    late = leave_out_queue();
    if (queue_.empty()) status_.recording = late_tracks_ = false;
    if (!failing_->is_counted) {
      if (take_) count_finished(*take_);
      count_failure(failing_->why);
      failing_->is_counted = true;
    }
  }
  if (take_) abandon(*take_, failing_->why);
  take_.reset();
  write_late(late);
  drop_wish();
  note(Severity::error, failing_->why, "recording ended");
  failing_.reset();
}

void Recorder::write_late(const std::vector<session::TrackRecord>& late) {
  for (const session::TrackRecord& record : late) {
    try {
      write(record);
    } catch (const std::bad_alloc&) {
      const std::lock_guard lock(mutex_);
      count_as_lost({.records = 1}, disk_failed, false);
    }
  }
}

// Takes what is queued before the next start out of the queue, and counts it as lost. Returns the
// tracks among it that takes which are ending wait for. Call it with the lock held.
std::vector<session::TrackRecord> Recorder::leave_out_queue() {
  std::vector<session::TrackRecord> late;
  while (!queue_.empty() && !queue_.begins_a_take()) {
    const Queued left = queue_.pop();
    const auto* record = std::get_if<session::TrackRecord>(&left.entry);
    bool is_late = record && std::ranges::any_of(ending_, [&](const EndingTake& ending) {
                     return ending.take.writer->has_frame_of(*record);
                   });
    try {
      if (is_late) late.push_back(*record);
    } catch (const std::bad_alloc&) {
      is_late = false;
    }
    const session::Losses loss = is_late ? session::Losses{} : RecordQueue::loss_of(left.entry);
    count_as_lost(loss, disk_failed, is_newest());
    if (!take_) continue;
    add(take_->lost, loss);
    add(take_->lost, left.lost);
  }
  if (take_ && queue_.empty()) add(take_->lost, queue_.take_left_out());
  return late;
}

void Recorder::count_failure(const std::string& why) {
  status_.fault = why;
  ++status_.failures;
}

void Recorder::count_finished(const Take& take) {
  if (take.writer->observer_frames() == 0) return;
  status_.finished = take.writer->directory().filename().string();
  ++status_.finished_takes;
}

}  // namespace previz::output
