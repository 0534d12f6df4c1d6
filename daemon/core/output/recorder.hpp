// Records takes while the rig goes on (P21), with a thread of its own, a ring that holds the time
// before the button press, and a bounded queue in front of the disk.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "daemon/core/output/asset_store.hpp"
#include "daemon/core/output/folder_watch.hpp"
#include "daemon/core/output/memory.hpp"
#include "daemon/core/output/record_queue.hpp"
#include "daemon/core/output/take_folders.hpp"
#include "daemon/core/output/take_writer.hpp"
#include "daemon/core/report/report.hpp"
#include "daemon/core/session/session.hpp"
#include "drivers/buttons.hpp"
#include "drivers/frame.hpp"

namespace previz::output {

struct RecorderOptions {
  TakeTemplate take;
  double preroll_s = 2;
  // Room for frames, of which the ring gets at most half; tracking, buttons and events may take an
  // eighth more.
  std::uint64_t queue_bytes = 1'000'000'000;
  // A frame is left out if the disk and the encoder are more than this behind the cameras, because
  // what is in memory only is lost where the process dies. The ring's frames are given ten seconds.
  double most_behind_s = 2;
  std::uint64_t reserve_bytes = 500'000'000;        // a take ends before less than this is free
  std::function<void(const report::Report&)> note;  // called from any thread
  // Counts pictures that were offered and are not kept, by cause ("too far behind", "memory full",
  // "disk failed", "cannot be recorded"). Called from any thread; it may not call the recorder.
  std::function<void(const std::string& cause, std::uint64_t pictures)> left_out;
  TakeFolders::FreeBytes free_bytes;  // empty: the file system is asked
  bool measures_disk = false;         // whether the disk's speed is measured before the first take
  // A take that ends waits so long for files of the set that are still being copied.
  std::chrono::milliseconds asset_patience{20'000};
  std::filesystem::path last_take;  // of an earlier recorder, in any folder; empty: none
  bool is_last_good = false;
};

struct RecorderStatus {
  bool recording = false;
  bool writing = false;  // the take is not whole on the disk yet, perhaps after recording ended
  bool ending = false;   // recording has ended, and its take is not whole on the disk yet
  bool good = false;     // the take of `directory` was marked good
  std::filesystem::path directory;  // the running take's or the last one's; empty: none yet
  int number = 0;
  std::uint64_t frames = 0;          // observer frames of the take on disk
  double seconds = 0;                // from the first to the last of them
  session::Losses lost;              // since the take began
  Backlog backlog;                   // of the take, or of what is left of the last one
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
// bounds what can be lost: the backlog (RecorderStatus), at most most_behind_s, if the process
// dies, and about the last second before it if the power fails. An error of the disk ends the take,
// with everything so far readable, but nothing else. A full or failing disk ends the take, too, and
// the next one begins at once on the next disk, if there is one; that disk is then left alone until
// the next start(). What cannot be recorded by its nature, such as a frame without an exposure, is
// left out and counted, and no file of the set that is missing ends a take: the take says so.
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
  bool offer(const session::MarkEvent& mark);  // returns whether a take is recorded and gets it
  void offer_event(std::int64_t timestamp_ns, const std::string& what);

  void start();  // begins with what the ring holds
  void stop();
  void mark_good();  // marks the running take, else the last

  RecorderStatus status() const;
  // Returns how much of the disk takes may still use, without the reserve, as it was about a second
  // ago; nothing if the disk cannot say.
  std::optional<std::uint64_t> free_bytes() const;
  // Returns the folders of takes as they were last seen, in the order of preference.
  std::vector<FolderSeen> folders() const;

 private:
  using Entry = RecordQueue::Entry;
  using Queued = RecordQueue::Queued;
  using Clock = std::chrono::steady_clock;

  // A take that is being written.
  struct Take {
    std::unique_ptr<TakeWriter> writer;
    std::size_t folder = 0;                    // its index in TakeFolders
    std::shared_ptr<AssetStore::Order> order;  // of its assets; null once it names them
    session::Losses lost;                      // of what was offered for it
    std::int64_t begins_ns = 0;                // time of its first observer frame
    std::string fault;                         // what of its disk failed while it was ending
    bool has_noted_odd = false;  // it was reported that something could not be recorded
  };
  // A take that gets no more frames: it waits for the tracking of its last ones and for its assets.
  struct EndingTake {
    Take take;
    Clock::time_point tracks_until, assets_until;
  };

  static constexpr const char* disk_failed = "disk failed";  // why something is not kept

  // Call these with the lock held.
  bool offer_record(Entry entry);  // false: it is counted as lost
  void count_as_lost(const session::Losses& loss, const char* cause, bool of_newest);
  void count_as_lost(const LeftOut& left_out);
  void count_failure(const std::string& why);
  void count_finished(const Take& take);  // in order or not
  bool has_new_silence();                 // of the disk, that nobody was told of
  bool has_new_lag();                     // behind the cameras, likewise
  // Returns whether no take was begun after the one that the writer thread works on: the status is
  // that take's.
  bool is_newest() const { return begun_ == starts_; }
  // Call these on the writer thread, without the lock.
  void run();
  bool is_served(bool& has_news, std::optional<Queued>& next, bool is_last);
  void serve(std::optional<Queued>& next, bool is_last);
  void handle(Queued& next);
  void write(const Captured& captured);
  void write(const session::TrackRecord& record);
  void leave_out(const Entry& entry, Take& take, const std::string& why);  // it cannot be recorded
  void mark_last_good();
  void begin_take(bool goes_on);  // from another take, which had its light before
  void tell_of_begun_take();
  void begin_next_take();  // and lets the running one end
  void end_running_take();
  void end_what_is_over(bool is_last, bool at_once = false);
  void end(Take& take);
  void name_assets(Take& take, bool is_last);  // in the running take, if they are there by now
  bool goes_on_elsewhere(const std::string& why);
  void fail(std::string why);  // ends the take and leaves out what is queued of it
  void write_late(const std::vector<session::TrackRecord>& late);
  std::vector<session::TrackRecord> leave_out_queue();
  void abandon(Take& take, const std::string& why);
  void check_disk();
  void compare_speeds();
  void note_slow(double taken, double delivered, double bytes_a_s);
  std::string why_not_own(std::size_t folder);
  void take_news();  // of the folders' watches
  void look_for_interruption(const std::vector<FolderSeen>& seen, bool are_known);
  int highest_known_number() const;
  int next_number_in(std::size_t folder) const;
  void keep_numbers(const std::vector<FolderSeen>& seen);
  void drop_wish();
  void note(report::Severity severity, std::string_view what, const char* source = "recording",
            bool is_shown = false) const;
  void note_short_preroll(double kept_s) const;
  void note_far_behind() const;

  const RecorderOptions options_;

  mutable std::mutex mutex_;
  std::condition_variable filled_;
  RecordQueue queue_;
  bool late_tracks_ = false;  // true: tracks may still arrive for takes that were stopped
  bool quit_ = false;
  bool stops_unmarked_ = false;  // a stop is the last entry, without memory for it in the queue
  RecorderStatus status_;
  std::uint64_t starts_ = 0;  // calls of start() that began a take
  std::uint64_t begun_ = 0;   // those of them that the writer thread has got to
  std::uint64_t named_ = 0;   // those of them whose take is known to status_
  std::optional<std::uint64_t> free_bytes_;
  std::optional<Clock::time_point> handling_since_;  // by the writer thread
  bool writes_ = false;  // the writer thread has a take, or an entry in hand
  bool silence_noted_ = false;
  bool behind_noted_ = false;  // of the running take
  bool short_preroll_noted_ = false;
  bool has_news_ = true;  // a folder was looked at

  // Only the writer thread uses these.
  TakeFolders folders_;
  std::vector<std::unique_ptr<AssetStore>> stores_;    // one in each folder
  std::vector<std::unique_ptr<FolderWatch>> watches_;  // one of each folder
  std::vector<std::size_t> told_;                      // takes of each that were salvaged, and said
  std::vector<int> kept_numbers_;                      // that each was told (FolderWatch)
  std::optional<Take> take_;
  std::list<EndingTake> ending_;
  struct Failing {
    std::string why;
    bool is_counted = false;
  };
  std::optional<Failing> failing_;  // fail() has begun, and has not ended
  NewestLight light_;               // that the running take has
  int highest_number_ = 0;          // of the takes so far
  Clock::time_point checked_;
  bool has_compared_speeds_ = false;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace previz::output
