#include "drivers/box/supervised.hpp"

#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <iostream>
#include <string_view>

#include "drivers/box/now_reading.hpp"
#include "drivers/session/draft.hpp"

namespace previz::box {
namespace {

// Returns the signal that came, and whether a process sent it to this one alone: those of a
// terminal go to the child as well.
int awaited(const sigset_t& signals, bool& is_for_this_alone) {
  siginfo_t info{};
  int signal = 0;
  while ((signal = ::sigwaitinfo(&signals, &info)) < 0 && errno == EINTR) {
  }
  is_for_this_alone = info.si_code <= 0;
  return signal;
}

std::string words_of(const std::string& program, int signal) {
  const ReadingNote* const note = reading_note;
  const std::string read = note ? note->file : "";
  std::string words = program + ": the command was stopped (" + ::strsignal(signal) + ")";
  if (signal == SIGKILL) words += "; there may have been too little memory";
  if (read.empty()) return words;
  return words + "; it last read " + read +
         ". If it ends so again, this file is damaged or meets a fault of a library: export it "
         "again, or do without it";
}

}  // namespace

int supervised(const std::string& program, const std::vector<std::filesystem::path>& folders,
               const std::function<int()>& work) {
  void* const shared = ::mmap(nullptr, sizeof(ReadingNote), PROT_READ | PROT_WRITE,
                              MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared != MAP_FAILED) reading_note = static_cast<ReadingNote*>(shared);
  std::signal(SIGCHLD, SIG_DFL);  // who starts this may ignore it, and nobody would be waited for
  sigset_t signals, of_child;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGCHLD}) sigaddset(&signals, signal);
  sigemptyset(&of_child);
  sigaddset(&of_child, SIGCHLD);
  sigprocmask(SIG_BLOCK, &signals, nullptr);
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child <= 0) {
    sigprocmask(SIG_UNBLOCK, &of_child, nullptr);  // the others wait for whoever looks for them
    // In no process of its own the work is done all the same.
    if (child == 0 && (::prctl(PR_SET_PDEATHSIG, SIGKILL) != 0 || ::getppid() != parent))
      ::_exit(1);
    return work();
  }
  int status = 0;
  pid_t ended = 0;
  while ((ended = ::waitpid(child, &status, WNOHANG)) == 0) {
    bool is_for_this_alone = false;
    const int signal = awaited(signals, is_for_this_alone);
    if (signal != SIGCHLD && is_for_this_alone) ::kill(child, signal);
  }
  if (ended < 0) return 1;
  if (!WIFSIGNALED(status)) ::_exit(WEXITSTATUS(status));
  for (const int of_everyday : {SIGPIPE, SIGINT, SIGTERM, SIGHUP})
    if (WTERMSIG(status) == of_everyday) ::_exit(128 + of_everyday);
  for (const std::filesystem::path& folder : folders) session::remove_dead_drafts(folder);
  std::cerr << words_of(program, WTERMSIG(status)) << std::endl;
  return 1;
}

}  // namespace previz::box
