#include "daemon/tools/farm/job_lock.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <ostream>
#include <thread>
#include <utility>

#include "daemon/core/report/printable.hpp"
#include "drivers/error.hpp"

namespace previz::farm {

using std::chrono::milliseconds;

JobLock::JobLock(const JobFolder& folder, const std::string& host, std::ostream& out,
                 const std::stop_token& stop)
    : folder_(folder),
      host_(host),
      file_(folder.path() / "job.lock", O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK) {
  bool has_waited = false;
  // A lock that fcntl(2) waits for could not be given up on a stop.
  for (;; std::this_thread::sleep_for(milliseconds(100))) {
    if (lock()) {
      before_ = folder.read_finish_state();
      is_complete_ = has_waited && before_ && before_->outcome == TaskOutcome::done;
      if (tell()) break;
    }
    if (!std::exchange(has_waited, true)) say_that_it_waits(out);
    if (stop.stop_requested())
      throw Error(folder.path().string() + ": interrupted while another last step was at work");
  }
  signs_.emplace(folder.finish_state_file());
}

void JobLock::say_that_it_waits(std::ostream& out) const {
  const std::optional<TaskState> other = folder_.living_finish();
  out << folder_.path().string() << ": waits for the last step or retry of "
      << (other ? on_one_line(other->host + ", since " + other->since) : "another process");
  if (!folder_.has_locks()) out << "; at most three minutes if that has died";
  out << std::endl;
}

// Takes the file's lock. Returns false if another process has it, or would have it if the file
// system had locks.
bool JobLock::lock() {
  struct flock whole {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  int result = 0;
  do result = folder_.lock_call()(file_.get(), F_OFD_SETLK, &whole);
  while (result != 0 && errno == EINTR);
  if (result != 0 && (errno == EAGAIN || errno == EACCES)) return false;
  return !folder_.living_finish();
}

// Says that it is at work. Returns false if another process has said so at the same moment.
bool JobLock::tell() {
  folder_.write_finish_state(state_now(TaskOutcome::running, host_, ""));
  if (!folder_.has_locks()) {
    std::this_thread::sleep_for(for_another_to_tell);
    const std::optional<TaskState> now = folder_.read_finish_state();
    if (now && (now->host != host_ || now->pid != ::getpid())) return false;
  }
  return true;
}

JobLock::~JobLock() {
  try {
    if (has_ended_) return;
    if (before_ && before_->outcome == TaskOutcome::done) {
      signs_.reset();
      folder_.write_finish_state(*before_);
    } else {
      end(TaskOutcome::stopped, "");
    }
  } catch (const std::exception&) {
    // Its sign of life grows old.
  }
}

void JobLock::end_without_word() {
  has_ended_ = true;
  signs_.reset();
  folder_.remove_finish_state();
}

void JobLock::end(TaskOutcome outcome, const std::string& message) {
  has_ended_ = true;
  signs_.reset();
  folder_.write_finish_state(state_now(outcome, host_, message));
}

}  // namespace previz::farm
