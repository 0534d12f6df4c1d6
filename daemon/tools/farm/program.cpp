#include "daemon/tools/farm/program.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <sstream>

#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

constexpr std::size_t most_output = std::size_t{64} << 20;
// The statuses of timeout(1) for what took too long, cannot be started and is not there.
constexpr int was_late = 124, cannot_start = 126, is_not_there = 127;

OwnedDescriptor file_in_memory() {
  OwnedDescriptor file(::memfd_create("output", MFD_CLOEXEC));
  if (!file) throw Error(std::string("no memory for another program: ") + std::strerror(errno));
  return file;
}

// Starts the program and waits for its end. Signals that this program waits for are not blocked in
// it.
int run(std::vector<std::string>& words, const OwnedDescriptor& out,
        const OwnedDescriptor& errors) {
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out.get(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors.get(), STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  pid_t pid = -1;
  const int error = ::posix_spawn(&pid, argv[0], &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw Error(words[0] + ": cannot be started: " + std::strerror(error));
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

std::string text_of(const OwnedDescriptor& file) {
  const off_t size = std::min<off_t>(::lseek(file.get(), 0, SEEK_END), most_output);
  std::string text(static_cast<std::size_t>(std::max<off_t>(size, 0)), '\0');
  const ssize_t count = ::pread(file.get(), text.data(), text.size(), 0);
  return text.substr(0, static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
}

}  // namespace

std::string ProgramResult::why() const {
  if (!is_there) return "it is not installed";
  if (is_late) return "no answer in time";
  std::string last;
  std::istringstream lines(errors);
  for (std::string line; std::getline(lines, line);)
    if (!line.empty()) last = line;
  return last.empty() ? "exit status " + std::to_string(status) : last;
}

ProgramResult run_program(const std::string& program, const std::vector<std::string>& arguments,
                          std::chrono::milliseconds patience) {
  const OwnedDescriptor out = file_in_memory(), errors = file_in_memory();
  std::vector<std::string> words{"/usr/bin/timeout", "--kill-after=1",
                                 std::to_string(static_cast<double>(patience.count()) / 1000),
                                 program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  ProgramResult result;
  result.status = run(words, out, errors);
  result.is_late = result.status == was_late;
  result.is_there = result.status != cannot_start && result.status != is_not_there;
  result.out = text_of(out);
  result.errors = text_of(errors);
  return result;
}

}  // namespace previz::farm
