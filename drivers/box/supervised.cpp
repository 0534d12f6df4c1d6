#include "drivers/box/supervised.hpp"

#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iostream>
#include <new>

#include "drivers/box/reading.hpp"
#include "drivers/session/draft.hpp"

namespace previz::box {
namespace {

using ReadingNote = ReadingNotes::Note;

// Returns the signal that came, and whether a process sent it to this one alone: those of a
// terminal go to the child as well. Returns 0 after a second without one.
int awaited(const sigset_t& signals, bool& is_for_this_alone) {
  siginfo_t info{};
  const timespec second{1, 0};
  const int signal = ::sigtimedwait(&signals, &info, &second);
  is_for_this_alone = info.si_code <= 0;
  return std::max(signal, 0);
}

std::uint64_t page_bytes() {
  return static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

// Returns how much memory a process has, in bytes; 0 if it has ended.
std::uint64_t memory_of(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/statm");
  std::uint64_t size = 0, resident = 0;
  file >> size >> resident;
  return resident * page_bytes();
}

// Returns the reading that began first; null: nobody reads.
const ReadingNote* longest_reading() {
  const ReadingNotes* const all = reading_notes;
  const ReadingNote* longest = nullptr;
  for (std::size_t i = 0; all && i < all->notes.size(); ++i)
    if (const ReadingNote& note = all->notes[i];
        note.since_ms != 0 && (!longest || note.since_ms < longest->since_ms))
      longest = &note;
  return longest;
}

// Waits for the work, and says how it ended.
class Watch {
 public:
  Watch(const Supervision& supervision, pid_t worker)
      : supervision_(supervision), worker_(worker) {}

  // Ends the work if a library takes too much for a file.
  void look() {
    const ReadingNote* const reading = longest_reading();
    if (!reading) return;
    const std::uint64_t most_memory =
        supervision_.most_memory != 0
            ? supervision_.most_memory
            : static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) / 4 * 3 * page_bytes();
    if (now_ms() - reading->since_ms > supervision_.longest_reading.count())
      end("one file took a library more than ten minutes");
    else if (memory_of(worker_) > most_memory)
      end("a file took more memory than three quarters of this computer's");
  }

  std::string words_of(int signal) const {
    std::string why = why_;
    if (why.empty()) why = ::strsignal(signal);
    if (why_.empty() && signal == SIGKILL) why += "; there may have been too little memory";
    std::string words = "the command was stopped: " + why;
    const ReadingNotes* const all = reading_notes;
    if (const ReadingNote* const reading = longest_reading())
      return words + ", while it read " + reading->file.data() +
             ". If it ends so again, this file is damaged or meets a fault of a library: export "
             "it again, or do without it";
    const std::string newest = all ? all->notes[all->newest].file.data() : "";
    return newest.empty() ? words : words + "; what it read last is " + newest;
  }

 private:
  void end(const char* why) {
    why_ = why;
    ::kill(worker_, SIGKILL);
  }

  const Supervision& supervision_;
  const pid_t worker_;
  std::string why_;  // it was ended here
};

}  // namespace

int supervised(const std::string& program, const Supervision& supervision,
               const std::function<int()>& work) {
  void* const shared = ::mmap(nullptr, sizeof(ReadingNotes), PROT_READ | PROT_WRITE,
                              MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared != MAP_FAILED) reading_notes = new (shared) ReadingNotes;
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
    const int status = work();
    // Libraries may end threads at the exit that are the parent's, as LTTng's does, which libcamera
    // brings along.
    if (child == 0) ::_exit(status);
    return status;
  }
  Watch watch(supervision, child);
  int status = 0;
  pid_t ended = 0;
  while ((ended = ::waitpid(child, &status, WNOHANG)) == 0) {
    bool is_for_this_alone = false;
    const int signal = awaited(signals, is_for_this_alone);
    if (signal == 0) watch.look();
    if (signal != 0 && signal != SIGCHLD && is_for_this_alone) ::kill(child, signal);
  }
  if (ended < 0) return 1;
  if (!WIFSIGNALED(status)) ::_exit(WEXITSTATUS(status));
  for (const int of_everyday : {SIGPIPE, SIGINT, SIGTERM, SIGHUP})
    if (WTERMSIG(status) == of_everyday) ::_exit(128 + of_everyday);
  for (const std::filesystem::path& folder : supervision.folders)
    session::remove_dead_drafts(folder);
  const std::string words = watch.words_of(WTERMSIG(status));
  std::cerr << program << ": " << words << std::endl;
  return supervision.when_stopped(child, words);
}

}  // namespace previz::box
