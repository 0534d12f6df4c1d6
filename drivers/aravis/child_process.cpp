#include "drivers/aravis/child_process.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <string>

#include "drivers/error.hpp"

namespace previz::aravis {
namespace {

// Returns the process's id, or 0 with the error in `error`. It is in a process group of its own, so
// that Ctrl-C on a terminal does not end it before its camera is given back.
pid_t spawned(const std::filesystem::path& program, const std::string& argument, int socket,
              int& error) {
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&actions);
  posix_spawnattr_init(&attributes);
  posix_spawn_file_actions_adddup2(&actions, socket, ChildProcess::its_socket);
  for (const int standard : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    if (standard == STDERR_FILENO) continue;  // the sanitizer's report goes there
#endif
    posix_spawn_file_actions_addopen(&actions, standard, "/dev/null", O_RDWR, 0);
  }
  posix_spawn_file_actions_addclosefrom_np(&actions, ChildProcess::its_socket + 1);
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes,
                           POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  std::string path = program, first = argument, parent = std::to_string(getpid());
  std::array<char*, 4> arguments{path.data(), first.data(), parent.data(), nullptr};
  std::array<char*, 1> environment{nullptr};
  pid_t pid = 0;
  error =
      posix_spawn(&pid, path.c_str(), &actions, &attributes, arguments.data(), environment.data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return error == 0 ? pid : 0;
}

}  // namespace

ChildProcess::ChildProcess(const std::filesystem::path& program, const std::string& argument,
                           OwnedDescriptor socket) {
  keeper_ = std::thread([this, program, argument, given = std::move(socket)]() mutable {
    keep(program, argument, std::move(given));
  });
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return started_ || ended_; });
  if (started_) return;
  lock.unlock();
  keeper_.join();
  throw Error(program.string() + " cannot be started: " + std::strerror(error_));
}

ChildProcess::~ChildProcess() {
  end();
  keeper_.join();
}

// An ended process keeps its id until it is waited for, which happens with the mutex held: no
// signal reaches another process that got the id after it.
void ChildProcess::keep(const std::filesystem::path& program, const std::string& argument,
                        OwnedDescriptor socket) {
  int error = 0;
  const pid_t pid = spawned(program, argument, socket.get(), error);
  socket = {};
  {
    const std::lock_guard lock(mutex_);
    error_ = error;
    pid_ = pid;
    (pid > 0 ? started_ : ended_) = true;
  }
  changed_.notify_all();
  if (pid <= 0) return;
  siginfo_t information{};
  while (waitid(P_PID, static_cast<id_t>(pid), &information, WEXITED | WNOWAIT) != 0 &&
         errno == EINTR) {
  }
  {
    const std::lock_guard lock(mutex_);
    waitpid(pid, &status_, 0);
    ended_ = true;
  }
  changed_.notify_all();
}

bool ChildProcess::ends_within(std::chrono::milliseconds time) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, time, [&] { return ended_; });
}

std::string ChildProcess::end() {
  std::unique_lock lock(mutex_);
  const bool by_us = !ended_;
  if (by_us) kill(pid_, SIGKILL);
  changed_.wait(lock, [&] { return ended_; });
  if (by_us) return "it was stopped";
  if (WIFSIGNALED(status_))
    return "it was ended by signal " + std::to_string(WTERMSIG(status_)) + " (" +
           strsignal(WTERMSIG(status_)) + ")";
  return "it ended with status " + std::to_string(WEXITSTATUS(status_));
}

}  // namespace previz::aravis
