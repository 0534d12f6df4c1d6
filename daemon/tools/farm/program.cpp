#include "daemon/tools/farm/program.hpp"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>

#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

constexpr std::size_t most_output = std::size_t{64} << 20;

struct Pipe {
  OwnedDescriptor read, write;
};

Pipe make_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0)
    throw Error(std::string("no pipe to another program: ") + std::strerror(errno));
  return {OwnedDescriptor(ends[0]), OwnedDescriptor(ends[1])};
}

// Starts the program; returns 0 or the error's number. Signals that this program waits for are not
// blocked in it.
int start(const std::string& program, const std::vector<std::string>& arguments, const Pipe& out,
          const Pipe& errors, pid_t& pid) {
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out.write.get(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors.write.get(), STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  const int error =
      ::posix_spawnp(&pid, program.c_str(), &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return error;
}

// Reads what is there; returns false at the end.
bool read_some(const OwnedDescriptor& from, std::string& text) {
  std::array<char, 65536> block{};
  const ssize_t count = ::read(from.get(), block.data(), block.size());
  if (count < 0 && errno == EINTR) return true;
  if (count <= 0) return false;
  text.append(block.data(),
              std::min<std::size_t>(static_cast<std::size_t>(count), most_output - text.size()));
  return true;
}

// Reads both until their ends; returns false if that is not within `patience`.
bool read_both(Pipe& out, Pipe& errors, ProgramResult& result, std::chrono::milliseconds patience) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end = Clock::now() + patience;
  while (out.read || errors.read) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
    if (left.count() <= 0) return false;
    std::array<pollfd, 2> ends{pollfd{out.read ? out.read.get() : -1, POLLIN, 0},
                               pollfd{errors.read ? errors.read.get() : -1, POLLIN, 0}};
    if (::poll(ends.data(), ends.size(), static_cast<int>(left.count())) < 0 && errno != EINTR)
      return false;
    if (ends[0].revents != 0 && !read_some(out.read, result.out)) out.read = OwnedDescriptor();
    if (ends[1].revents != 0 && !read_some(errors.read, result.errors))
      errors.read = OwnedDescriptor();
  }
  return true;
}

}  // namespace

std::string ProgramResult::why() const {
  if (!is_there) return "it is not installed";
  if (is_late) return "no answer in time";
  std::string last;
  for (std::size_t begin = 0; begin < errors.size();) {
    const std::size_t end = std::min(errors.find('\n', begin), errors.size());
    if (end > begin) last = errors.substr(begin, end - begin);
    begin = end + 1;
  }
  return last.empty() ? "exit status " + std::to_string(status) : last;
}

ProgramResult run_program(const std::string& program, const std::vector<std::string>& arguments,
                          std::chrono::milliseconds patience) {
  Pipe out = make_pipe(), errors = make_pipe();
  pid_t pid = -1;
  ProgramResult result;
  const int error = start(program, arguments, out, errors, pid);
  if (error == ENOENT || error == EACCES) {
    result.is_there = false;
    return result;
  }
  if (error != 0) throw Error(program + ": cannot be started: " + std::strerror(error));
  out.write = OwnedDescriptor();
  errors.write = OwnedDescriptor();
  result.is_late = !read_both(out, errors, result, patience);
  if (result.is_late) ::kill(pid, SIGKILL);
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  result.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return result;
}

}  // namespace previz::farm
