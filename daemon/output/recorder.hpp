// Records takes while the rig goes on (P21), with a thread of its own, a ring that holds the time
// before the button press, and a bounded queue in front of the disk.
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
#include <vector>

#include "daemon/output/asset_store.hpp"
#include "daemon/output/take_folders.hpp"
#include "daemon/output/take_writer.hpp"
#include "daemon/report/report.hpp"
#include "drivers/buttons.hpp"
#include "drivers/frame.hpp"
#include "drivers/session/session.hpp"

namespace previz::output {

struct RecorderOptions {
  TakeTemplate take;
  double preroll_s = 2;
  // Room for frames, of which the ring gets at most half; tracking, buttons and events may take an
  // eighth more.
  std::uint64_t queue_bytes = 1'000'000'000;
  std::uint64_t reserve_bytes = 500'000'000;        // a take ends before less than this is free
  std::function<void(const report::Report&)> note;  // called from any thread
  TakeFolders::FreeBytes free_bytes;                // empty: the file system is asked
  bool measures_disk = false;  // whether the disk's speed is measured before the first take
};

// Returns a quarter of the memory that is free now, in bytes: room for what is recorded on a
// machine that has other things to do.
std::uint64_t default_queue_bytes();

struct RecorderStatus {
  bool recording = false;
  std::filesystem::path directory;  // the running take's or the last one's; empty: none yet
  int number = 0;
  std::uint64_t frames = 0;          // observer frames of the take on disk
  double seconds = 0;                // from the first to the last of them
  session::Losses lost;              // since the take began
  double disk_silent_s = 0;          // for how long the disk has not answered a write
  std::uint64_t finished_takes = 0;  // since the start; takes without a frame do not count
  std::string finished;              // name of the take that finished last
  std::uint64_t failures = 0;        // takes that ended by an error
  std::string fault;                 // cause of the last failure; empty once another take begins
  // The take that was being recorded when the last process ended, if it was not ended by anybody;
  // known about when the folder of takes is there.
  std::optional<std::string> interrupted;
  // Takes that were cut off and are in order again, in words: "12A_take003 was cut off; it has 250
  // frames".
  std::vector<std::string> salvaged;
};

// No call here but finish() waits for the disk, and all may come from any thread. SessionWriter
// bounds what can be lost: at most the frame in hand if the process dies, about the last second if
// the power fails. An error of the disk ends the take, with everything so far readable, but nothing
// else. A full or failing disk ends the take, too, and the next one begins at once on the next
// disk, if there is one.
class Recorder {
 public:
  explicit Recorder(RecorderOptions options);
  ~Recorder();  // finish()
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // Finishes the running take and waits until all of it is on the disk. That it was being recorded
  // is remembered in the folder of takes. Nothing that is offered from then on is recorded.
  void finish();

  // Takes every frame of either camera, recording or not. A frame that does not fit the queue is
  // dropped and counted. A frame of another format or size begins the next take.
  void offer(const FramePtr& frame);
  // Takes a shown picture, if the set wants these in its takes (shown_frame.hpp). It may use only
  // half of the queue, because it is worth less than the cameras' frames.
  void offer_shown(const FramePtr& frame);
  // Takes the tracking of an observer frame, in order; the recorder fills in `frame`.
  void offer(const session::TrackRecord& record);
  void offer(const ButtonEvent& event);
  void offer_event(std::int64_t timestamp_ns, const std::string& what);

  void start();  // begins with what the ring holds
  void stop();
  void mark_good();  // marks the running take, else the last

  RecorderStatus status() const;
  // Returns how much of the disk takes may still use, without the reserve, as it was about a second
  // ago; nothing if the disk cannot say.
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
  struct Stop {
    session::Losses lost;  // of the take that ends
    bool is_wished;        // by somebody; otherwise the process ends
  };
  struct MarkGood {};
  using Entry =
      std::variant<Captured, session::TrackRecord, ButtonEvent, Event, Start, Stop, MarkGood>;

  static std::uint64_t bytes_of(const Entry& entry);
  // Call these with the lock held.
  void enqueue(Entry entry);
  void enqueue_record(Entry entry);  // or counts it as lost
  void enqueue_stop(bool is_wished);
  void count_failure(const std::string& why);
  void count_finished();  // the take that ends, in order or not
  void count_as_lost(const Entry& entry);
  bool has_new_silence();  // of the disk, that nobody was told of
  bool trim_ring();
  double ring_length_s() const;
  void forget_first_of_ring();
  void forget_what_is_long_ago();
  void remember_light(const Captured& captured);
  void forget_lights_unlike(const Frame& frame);  // lights of another format fit no take with it
  // Call these on the writer thread, without the lock.
  void run();
  void serve(std::optional<Entry>& entry, bool is_last);
  void handle(Entry& entry);
  void write(const Captured& captured);
  void begin_take();
  void begin_next_take();
  void add_assets();  // to the running take, if it lacks them; waits for them
  void end_last_take();
  void end_take(const session::Losses& lost);   // properly, not by a failure
  void attribute(const session::Losses& lost);  // to the running take, as far as no take has them
  bool goes_on_elsewhere(const std::string& why);
  void fail(const std::string& why);  // ends the take and leaves out what is queued of it
  void leave_take(const std::string& why);
  void check_disk();
  void look_at_disk();  // for free_bytes()
  void compare_speeds();
  void look_for_interruption();
  void salvage(const std::filesystem::path& take);
  void drop_wish();
  void note(report::Severity severity, const std::string& what) const;
  void note_short_preroll(double kept_s) const;

  const RecorderOptions options_;

  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::deque<Entry> queue_;  // entries for the disk, in order
  std::uint64_t queued_bytes_ = 0;
  std::deque<Entry> ring_;  // entries while nothing is recorded
  std::uint64_t ring_bytes_ = 0;
  // The newest light frame of each exposure that is no longer in the ring (at most most_exposures,
  // of one format), because a take begins with its light, however old.
  std::map<long, Captured> older_light_;
  std::int64_t last_frame_ns_ = 0;  // the last observer frame offered to the running take
  bool late_tracks_ = false;  // true: tracks may still arrive for the take that was stopped last
  bool quit_ = false;
  RecorderStatus status_;
  std::optional<std::uint64_t> free_bytes_;
  std::optional<std::chrono::steady_clock::time_point> handling_since_;  // by the writer thread
  bool silence_noted_ = false;
  bool short_preroll_noted_ = false;

  // Only the writer thread uses these.
  TakeFolders folders_;
  AssetStore assets_;
  bool lacks_assets_ = false;  // the running take, because they are still being copied
  std::unique_ptr<TakeWriter> take_;
  std::int64_t take_begins_ns_ = 0;                              // time of its first observer frame
  std::optional<std::chrono::steady_clock::time_point> end_at_;  // stopped; waits for its tracks
  session::Losses stopped_lost_;                                 // of the take that waits
  session::Losses attributed_;  // of the losses since the start, those of takes that have ended
  std::chrono::steady_clock::time_point checked_, looked_;
  bool has_compared_speeds_ = false;
  bool looked_for_interruption_ = false;
  bool was_stopped_ = false;  // the take that waits was ended by somebody
  std::jthread thread_;       // last: it uses all of the above
};

}  // namespace previz::output
