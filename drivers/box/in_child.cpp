#include "drivers/box/in_child.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <new>
#include <string_view>

#include "drivers/box/confinement.hpp"
#include "drivers/error.hpp"

namespace previz::box {
namespace {

constexpr rlim_t most_cpu_s = 600;

// Reads all that is written to a pipe.
std::string all_of(int pipe) {
  std::string bytes;
  std::array<char, 1 << 16> part{};
  for (;;) {
    const ssize_t count = ::read(pipe, part.data(), part.size());
    if (count > 0) bytes.append(part.data(), static_cast<std::size_t>(count));
    if (count == 0 || (count < 0 && errno != EINTR)) return bytes;
  }
}

// The first letter says what follows: a result, or the words of an error.
[[noreturn]] void work_and_end(const std::string& subject, int pipe, pid_t parent,
                               const std::function<std::string()>& work) {
  const auto limit = [](__rlimit_resource_t what, rlim_t most) {
    const rlimit limits{most, most};
    ::setrlimit(what, &limits);
  };
  limit(RLIMIT_CPU, most_cpu_s);
  limit(RLIMIT_CORE, 0);
#ifndef __SANITIZE_ADDRESS__
  limit(RLIMIT_AS, static_cast<rlim_t>(::sysconf(_SC_PHYS_PAGES)) / 4 * 3 *
                       static_cast<rlim_t>(::sysconf(_SC_PAGESIZE)));
#endif
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTERM, SIGINT})
    ::signal(signal, SIG_DFL);
  for (const auto& leave :
       {std::function(leave_network_and_programs), std::function([] { confine_files({}); })}) {
    try {
      leave();
    } catch (const Error&) {
      // The kernel cannot: whoever confined the command has said so.
    }
  }
  std::string bytes;
  try {
    bytes = 'r' + work();
  } catch (const std::bad_alloc&) {
    bytes = "e" + subject + ": needs more memory than three quarters of this computer's";
  } catch (const std::exception& error) {
    bytes = std::string("e") + error.what();
  }
  for (std::string_view rest = bytes; !rest.empty();) {
    const ssize_t count = ::write(pipe, rest.data(), rest.size());
    if (count < 0 && errno != EINTR) ::_exit(1);
    if (count > 0) rest.remove_prefix(static_cast<std::size_t>(count));
  }
  ::_exit(0);
}

}  // namespace

std::string in_child(const std::string& subject, const std::function<std::string()>& work) {
  std::array<int, 2> pipe{};
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0)
    throw Error(subject + ": no process can be made to read it: " + std::strerror(errno));
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(pipe[0]);
    work_and_end(subject, pipe[1], parent, work);
  }
  ::close(pipe[1]);
  std::string bytes = child > 0 ? all_of(pipe[0]) : std::string();
  ::close(pipe[0]);
  if (child < 0)
    throw Error(subject + ": no process can be made to read it: " + std::strerror(errno));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status))
    throw Error(fmt::format(
        "{}: the library that reads this format {} by it ({}); export it as binary PLY or glTF",
        subject, WTERMSIG(status) == SIGXCPU ? "was kept busy for ten minutes" : "was stopped",
        ::strsignal(WTERMSIG(status))));
  if (status != 0 || bytes.empty())
    throw Error(subject + ": the process that reads it ended without a result; try again");
  const bool is_error = bytes[0] == 'e';
  bytes.erase(0, 1);
  if (is_error) throw Error(bytes);
  return bytes;
}

}  // namespace previz::box
