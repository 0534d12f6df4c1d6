// Plays a take on a thread of its own: its frames with their recorded poses, light and places, at
// the speed they were taken.
#pragma once

#include <atomic>
#include <filesystem>
#include <thread>

#include "daemon/core/live/inbox.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/report/reports.hpp"
#include "daemon/rig/set_keeper.hpp"

namespace previz::rig {

class Review {
 public:
  // Posts Event::review_ended at the take's end. If the take cannot be played, for example because
  // it was recorded with another set, it also reports why. `set` is the running one; it, `out` and
  // the other two outlive this.
  Review(std::filesystem::path take, const LoadedSet& set, pipeline::Mailbox<pipeline::Shot>& out,
         live::Inbox& inbox, report::Reports& reports);

  // Ends it soon, whatever it is at: a take is read as a whole before its first picture.
  void stop() { thread_.request_stop(); }
  bool is_stopped() const { return thread_.get_stop_token().stop_requested(); }
  bool done() const { return done_; }  // true: the destructor does not wait

 private:
  std::atomic<bool> done_ = false;
  std::jthread thread_;
};

}  // namespace previz::rig
