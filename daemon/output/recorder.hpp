// Records takes while the rig goes on (P21): a thread of its own, a ring of what came before the
// button, and a bounded queue in front of the disk.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>

#include "daemon/output/take_writer.hpp"
#include "daemon/report/report.hpp"
#include "drivers/buttons.hpp"
#include "drivers/frame.hpp"
#include "drivers/session/session.hpp"

namespace previz::output {

struct RecorderOptions {
  TakeTemplate take;
  double preroll_s = 2;
  std::uint64_t queue_bytes = 1'000'000'000;        // of frames; the ring has at most half of it
  std::uint64_t reserve_bytes = 500'000'000;        // a take ends before the disk has less
  std::function<void(const report::Report&)> note;  // called from any thread
  std::function<std::uint64_t()> free_bytes;        // of the disk; left out: asks the file system
};

struct RecorderStatus {
  bool recording = false;
  std::filesystem::path directory;  // of the running take, or of the last; empty: none yet
  int number = 0;
  std::uint64_t frames = 0;          // observer frames of that take on disk
  double seconds = 0;                // from the first to the last of them
  std::uint64_t dropped = 0;         // frames of that take, of either camera, that are not
  std::uint64_t dropped_shown = 0;   // pictures that were shown in that take and are not in it
  std::uint64_t finished_takes = 0;  // since the start; a take without a frame is none
  std::uint64_t failures = 0;        // takes that ended by themselves
  std::string fault;                 // why the last one did; empty once another has begun
};

// No call here waits for the disk; all may come from any thread. A take is on disk as SessionWriter
// says: at most the frame in hand is lost with the process, about the last second with the power.
// What goes wrong with the disk ends the take, with everything so far readable, and nothing else.
class Recorder {
 public:
  explicit Recorder(RecorderOptions options);
  ~Recorder();  // finishes the running take
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // Every frame either camera delivers, recording or not. One that does not fit the queue is
  // dropped and counted. A frame of another format or size begins the next take.
  void offer(const FramePtr& frame);
  // What was shown, where the set wants that in its takes (shown_frame.hpp): of less worth than
  // what the cameras saw, it has half of the queue.
  void offer_shown(const FramePtr& frame);
  // What tracking made of an observer frame, in order; `frame` is filled in here.
  void offer(const session::TrackRecord& record);
  void offer(const ButtonEvent& event);
  void offer_event(std::int64_t timestamp_ns, const std::string& what);

  void start();  // with what the ring holds
  void stop();
  void mark_good();  // the running take, else the last

  RecorderStatus status() const;
  // What takes may still use of the disk, before its reserve; none where the disk does not say.
  std::optional<std::uint64_t> free_bytes() const;

 private:
  using WallClock = std::chrono::system_clock;
  struct Captured {
    FramePtr frame;
    WallClock::time_point at = WallClock::now();
    std::chrono::steady_clock::time_point offered = std::chrono::steady_clock::now();
  };
  struct Event {
    std::int64_t timestamp_ns;
    std::string what;
  };
  struct Start {};
  struct Stop {};
  struct MarkGood {};
  using Entry =
      std::variant<Captured, session::TrackRecord, ButtonEvent, Event, Start, Stop, MarkGood>;

  static std::uint64_t bytes_of(const Entry& entry);
  // With the lock held:
  void enqueue(Entry entry);
  void trim_ring();
  void forget_first_of_ring();
  void forget_what_is_long_ago();
  void remember_light(const Captured& captured);
  void forget_lights_unlike(const Frame& frame);  // of another format: they fit no take with it
  // On the writer thread, without it:
  void run();
  void handle(Entry& entry);
  void write(const Captured& captured);
  void begin_take();
  void end_take();  // in order
  void fail(const std::string& why);
  void check_disk();
  std::uint64_t free_on_disk() const;
  void note(report::Severity severity, const std::string& what) const;

  const RecorderOptions options_;

  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::deque<Entry> queue_;  // for the disk, in order
  std::uint64_t queued_bytes_ = 0;
  std::deque<Entry> ring_;  // while nothing is recorded
  std::uint64_t ring_bytes_ = 0;
  // Light frames that are not in the ring, the newest of each exposure (most_exposures at
  // the most, of one format): a take begins with its light, however old.
  std::map<long, Captured> older_light_;
  std::int64_t last_frame_ns_ = 0;  // of the observer, offered to the running take
  bool late_tracks_ = false;        // of the take that was stopped last are still welcome
  bool quit_ = false;
  RecorderStatus status_;

  // The writer thread's own.
  std::unique_ptr<TakeWriter> take_;
  std::int64_t take_begins_ns_ = 0;                              // its first observer frame
  std::optional<std::chrono::steady_clock::time_point> end_at_;  // stopped; waits for its tracks
  std::chrono::steady_clock::time_point checked_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace previz::output
