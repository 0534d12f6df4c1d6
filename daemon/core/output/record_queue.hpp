// What was offered for recording and is not on the disk yet: the bounded queue in front of the
// disk, the ring that holds the time before the button press, and the light from before the ring.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "daemon/core/session/session.hpp"
#include "drivers/buttons.hpp"
#include "drivers/frame.hpp"

namespace previz::output {

// A frame and when it was offered.
struct Captured {
  FramePtr frame;
  std::chrono::system_clock::time_point at = std::chrono::system_clock::now();
  std::chrono::steady_clock::time_point offered = std::chrono::steady_clock::now();
};

// The newest light frame of each exposure (at most most_exposures, of one format), because a take
// begins with its light, however old.
class NewestLight {
 public:
  void remember(const Captured& captured);
  void forget_unlike(const Frame& frame);  // lights of another format fit no take with this one
  void clear() { by_exposure_.clear(); }
  std::vector<Captured> in_order() const;  // of time

 private:
  std::map<long, Captured> by_exposure_;
};

void add(session::Losses& to, const session::Losses& more);

// What was offered and is not written yet.
struct Backlog {
  double seconds = 0;  // from the oldest frame that waits to the newest that was offered
  std::uint64_t bytes = 0;
  // Of these seconds what the ring held when the take began, and is given time to be written: the
  // whole at the beginning, nothing after `ring_grace_s`.
  double of_ring_s = 0;
  std::uint64_t entries = 0;  // pictures of both cameras and lines
};

// What an entry that was offered cost: itself, or pictures that waited before it.
struct LeftOut {
  session::Losses of_newest;       // of the take that was begun last
  session::Losses of_older;        // of those before it, which are not all on the disk yet
  bool is_too_far_behind = false;  // whether the backlog was too long in time; else in memory

  bool any() const { return of_newest != session::Losses{} || of_older != session::Losses{}; }
};

// Not thread-safe; the recorder holds its lock.
class RecordQueue {
 public:
  using SteadyClock = std::chrono::steady_clock;
  struct Event {
    std::int64_t timestamp_ns;
    std::string what;
  };
  struct Start {};
  struct Stop {};
  struct MarkGood {};
  using Entry = std::variant<Captured, session::TrackRecord, ButtonEvent, Event, Start, Stop,
                             MarkGood, session::MarkEvent>;
  struct Queued {
    Entry entry;
    session::Losses lost;  // offered between the entry before and this one, and left out
  };

  static constexpr double ring_grace_s = 10;

  // `bytes` is the room for frames, of which the ring gets at most half and pictures that were
  // shown half; tracking, buttons and events may take an eighth more. Where the backlog is more
  // than `most_behind_s`, beside what of it is the ring's, the oldest pictures that wait are left
  // out: so it is never longer, and an encoder that is too slow keeps every second or third frame
  // instead of a few seconds at a time. A picture that was shown is left out at half of that.
  RecordQueue(double preroll_s, std::uint64_t bytes, double most_behind_s)
      : preroll_s_(preroll_s), bytes_(bytes), most_behind_s_(most_behind_s) {}

  // Returns the entry as a loss.
  static session::Losses loss_of(const Entry& entry);

  // These return what had to be left out, also because memory has run out; the next entry says so.
  LeftOut push(const Captured& captured);
  LeftOut push_shown(const Captured& captured);
  LeftOut push_record(Entry entry);  // a line of tracking, a button or an event
  // A stop or a mark, for which there is always room. Throws std::bad_alloc, and changes nothing,
  // if there is no memory for it.
  void push_mark(Entry entry);

  // Keep what is offered while nothing is recorded. Of a frame: returns whether others were dropped
  // only because the ring was full.
  bool keep(const Captured& captured);
  void keep(const session::TrackRecord& record);
  // Begins a take with the light from before the ring and what the ring holds, and returns what of
  // it had to be left out. Throws std::bad_alloc, and begins none, if there is no memory for that.
  session::Losses begin();

  bool empty() const { return queue_.empty(); }
  Backlog backlog() const;
  bool begins_a_take() const;  // the next entry does
  Queued pop();
  session::Losses take_left_out();  // after the last entry; the next one does not say it then

  // The newest frames of the ring, of both cameras, that it holds within so many seconds.
  std::vector<FramePtr> newest_of_ring(double seconds) const;
  double ring_length_s() const;  // from its oldest frame to its newest
  std::uint64_t ring_bytes() const { return ring_bytes_; }
  // Returns the time of the newest observer frame that was queued.
  std::int64_t last_frame_ns() const { return last_frame_ns_; }

 private:
  static std::uint64_t bytes_of(const Entry& entry);
  session::Losses push_within(std::uint64_t room, Entry entry);
  std::size_t oldest_picture() const;  // its place in the queue; the queue's size if there is none
  bool is_behind(double bound_s) const;
  void leave_out(std::size_t place, LeftOut& left_out);
  bool trim_ring();
  Backlog backlog_with(SteadyClock::time_point newest) const;
  void forget_first_of_ring();
  void remember_light(const Captured& captured);
  void forget_what_is_long_ago();

  const double preroll_s_;
  const std::uint64_t bytes_;
  const double most_behind_s_;
  std::deque<Queued> queue_;  // entries for the disk, in order
  std::uint64_t queued_bytes_ = 0;
  session::Losses left_out_;  // since the last entry of the queue
  std::deque<Entry> ring_;    // entries while nothing is recorded
  std::uint64_t ring_bytes_ = 0;
  NewestLight older_light_;  // that is no longer in the ring
  std::int64_t last_frame_ns_ = 0;
  // Of the running take: when it began, how long the ring was, and the newest frame that was
  // offered.
  SteadyClock::time_point began_{}, newest_{};
  double begun_with_s_ = 0;
};

}  // namespace previz::output
