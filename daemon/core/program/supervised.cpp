#include "daemon/core/program/supervised.hpp"

#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/lsan_interface.h>
#endif

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <new>
#include <set>
#include <sstream>
#include <tuple>

#include "daemon/core/session/draft.hpp"
#include "drivers/box/reading.hpp"

namespace previz {
namespace {

// Returns the signal that came, and whether a process sent it to this one alone: those of a
// terminal go to the child as well. Returns 0 after a second without one.
int awaited(const sigset_t& signals, bool& is_for_this_alone) {
  siginfo_t info{};
  const timespec second{1, 0};
  const int signal = ::sigtimedwait(&signals, &info, &second);
  is_for_this_alone = info.si_code <= 0;
  return std::max(signal, 0);
}

// Returns how much memory a process has, in bytes; 0 if it has ended.
std::uint64_t memory_of(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/statm");
  std::uint64_t size = 0, resident = 0;
  file >> size >> resident;
  return resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

std::uint64_t half_of_the_memory() {
  return static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) / 2 *
         static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

// Returns how long a thread of a process has been at work; 0 if it has ended. See proc(5), stat.
std::chrono::milliseconds work_of(pid_t process, pid_t thread) {
  std::ifstream file("/proc/" + std::to_string(process) + "/task/" + std::to_string(thread) +
                     "/stat");
  std::string text(std::istreambuf_iterator<char>(file), {});
  std::istringstream fields(text.substr(std::min(text.rfind(')'), text.size() - !text.empty())));
  std::string skipped;
  for (int i = 0; i < 12; ++i) fields >> skipped;  // the name's end, and fields 3 to 13
  std::int64_t user = 0, system = 0;
  fields >> user >> system;
  return std::chrono::milliseconds((user + system) * 1000 / ::sysconf(_SC_CLK_TCK));
}

std::string file_of(const box::ReadingNotes::Note& note) {
  return {note.file.data(), ::strnlen(note.file.data(), note.file.size())};
}

// Watches over the work, and says how it ended.
class Watch {
 public:
  Watch(const Supervision& supervision, pid_t worker)
      : supervision_(supervision), worker_(worker) {}

  // Ends the work if a library takes too much for a file. Waiting for a disk is no work.
  void look() {
    const box::ReadingNotes* const all = box::reading_notes;
    const std::uint64_t memory = memory_of(worker_);
    for (std::size_t i = 0; all && i < all->notes.size(); ++i) {
      const box::ReadingNotes::Note& note = all->notes[i];
      const pid_t reader = note.reader;
      if (reader == 0) continue;
      const std::chrono::milliseconds work = work_of(worker_, reader);
      Seen& seen = seen_[i];
      if (const std::uint32_t count = note.count; seen.count != count) seen = {count, work, memory};
      if (work - seen.work > supervision_.longest_reading)
        end("one file took a library more than ten minutes", note);
      else if (memory > seen.memory && memory - seen.memory > supervision_.most_memory)
        end("one file took more than half of this computer's memory", note);
    }
  }

  std::string words_of(int signal) const {
    std::string why = why_;
    if (why.empty()) why = ::strsignal(signal);
    if (why_.empty() && signal == SIGKILL) why += "; there may have been too little memory";
    const std::string words = "the command was stopped: " + why;
    if (const std::string read = why_.empty() ? being_read() : file_; !read.empty())
      return words + ", while it read " + read +
             ". If it ends so again, this file is damaged or meets a fault of a library: export "
             "it again, or do without it";
    const box::ReadingNotes* const all = box::reading_notes;
    const std::string newest = all ? file_of(all->notes[all->newest % all->notes.size()]) : "";
    return newest.empty() ? words : words + "; what it read last is " + newest;
  }

 private:
  // A reading, as it was seen the first time.
  struct Seen {
    std::uint32_t count = 0;
    std::chrono::milliseconds work{0};  // of its thread, until then
    std::uint64_t memory = 0;
  };

  void end(const char* why, const box::ReadingNotes::Note& note) {
    why_ = why;
    file_ = file_of(note);
    ::kill(worker_, SIGKILL);
  }

  static std::string being_read() {
    std::set<std::string> files;
    const box::ReadingNotes* const all = box::reading_notes;
    for (std::size_t i = 0; all && i < all->notes.size(); ++i)
      if (all->notes[i].reader != 0) files.insert(file_of(all->notes[i]));
    std::string words = files.size() > 1 ? "one of " : "";
    for (const std::string& file : files) words += (file == *files.begin() ? "" : ", ") + file;
    return words;
  }

  const Supervision& supervision_;
  const pid_t worker_;
  std::array<Seen, std::tuple_size_v<decltype(box::ReadingNotes::notes)>> seen_;
  std::string why_, file_;  // it was ended here
};

}  // namespace

Supervision::Supervision() : most_memory(half_of_the_memory()) {}

int supervised(const std::string& program, const Supervision& supervision,
               const std::function<int()>& work) {
  void* const shared = ::mmap(nullptr, sizeof(box::ReadingNotes), PROT_READ | PROT_WRITE,
                              MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared != MAP_FAILED) box::reading_notes = new (shared) box::ReadingNotes;
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
#ifdef __SANITIZE_ADDRESS__
    __lsan_do_leak_check();
#endif
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
  sigprocmask(SIG_UNBLOCK, &signals, nullptr);  // what follows may wait for a disk
  for (const int of_everyday : {SIGPIPE, SIGINT, SIGTERM, SIGHUP})
    if (WTERMSIG(status) == of_everyday) ::_exit(128 + of_everyday);
  for (const std::filesystem::path& folder : supervision.folders)
    session::remove_dead_drafts(folder);
  const std::string words = watch.words_of(WTERMSIG(status));
  std::cerr << program << ": " << words << std::endl;
  return supervision.when_stopped(child, words);
}

}  // namespace previz
