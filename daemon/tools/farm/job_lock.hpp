// Lets one process at a time do the last step of a job, or a retry.
#pragma once

#include <iosfwd>
#include <optional>
#include <stop_token>
#include <string>

#include "daemon/core/session/files.hpp"
#include "daemon/tools/farm/folder.hpp"
#include "daemon/tools/farm/signs_of_life.hpp"

namespace previz::farm {

// Held while pictures are moved and compared. JOB/state/finish.json says who has it.
class JobLock {
 public:
  // Waits until no other process has it, and says so; throws previz::Error on a stop. Where the
  // file system has no locks that other machines see, others are known by their signs of life.
  JobLock(const JobFolder& folder, const std::string& host, std::ostream& out,
          const std::stop_token& stop);
  // Unless it has ended, says that the job is done if it was, and otherwise that it was stopped.
  ~JobLock();
  JobLock(const JobLock&) = delete;
  JobLock& operator=(const JobLock&) = delete;

  // Returns whether another process had it first, and has completed the job.
  bool is_complete() const { return is_complete_; }

  // Says how it has ended. Throws previz::Error where that cannot be written.
  void end(TaskOutcome outcome, const std::string& message);
  // Leaves no word: a last step is still to come.
  void end_without_word();

 private:
  bool lock();
  bool tell();
  void say_that_it_waits(std::ostream& out) const;

  const JobFolder& folder_;
  const std::string host_;
  session::OpenFile file_;
  std::optional<TaskState> before_;  // what was said before
  bool is_complete_ = false, has_ended_ = false;
  std::optional<SignsOfLife> signs_;
};

}  // namespace previz::farm
