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
#include <utility>
#include <vector>

#include "drivers/error.hpp"

namespace previz::aravis {
namespace {

// Returns the process's id, or 0 with the error in `error`. It is in a process group of its own, so
// that Ctrl-C on a terminal does not end it before its camera is given back.
pid_t spawned(const std::filesystem::path& program, std::vector<std::string> arguments, int socket,
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
  arguments.insert(arguments.begin(), program);
  arguments.push_back(std::to_string(getpid()));
  std::vector<char*> words;
  for (std::string& argument : arguments) words.push_back(argument.data());
  words.push_back(nullptr);
  std::array<char*, 1> environment{nullptr};
  pid_t pid = 0;
  error =
      posix_spawn(&pid, program.c_str(), &actions, &attributes, words.data(), environment.data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return error == 0 ? pid : 0;
}

}  // namespace

ChildProcess::ChildProcess(const std::filesystem::path& program, std::vector<std::string> arguments,
                           OwnedDescriptor socket) {
  keeper_ = std::thread([state = state_, program, given = std::move(arguments),
                         its_end = std::move(socket)]() mutable {
    keep(state, program, std::move(given), std::move(its_end));
  });
  std::unique_lock lock(state_->mutex);
  state_->changed.wait(lock, [&] { return state_->started || state_->ended; });
  if (state_->started) return;
  lock.unlock();
  keeper_.join();
  throw Error(program.string() + " cannot be started: " + std::strerror(state_->error));
}

ChildProcess::~ChildProcess() {
  end();
  if (ends_within({}))
    keeper_.join();
  else
    keeper_.detach();
}

// An ended process keeps its id until it is waited for, which happens with the mutex held: no
// signal reaches another process that got the id after it.
void ChildProcess::keep(const std::shared_ptr<State>& state, const std::filesystem::path& program,
                        std::vector<std::string> arguments, OwnedDescriptor socket) {
  int error = 0;
  const pid_t pid = spawned(program, std::move(arguments), socket.get(), error);
  socket = {};
  {
    const std::lock_guard lock(state->mutex);
    state->error = error;
    state->pid = pid;
    (pid > 0 ? state->started : state->ended) = true;
  }
  state->changed.notify_all();
  if (pid <= 0) return;
  siginfo_t information{};
  while (waitid(P_PID, static_cast<id_t>(pid), &information, WEXITED | WNOWAIT) != 0 &&
         errno == EINTR) {
  }
  {
    const std::lock_guard lock(state->mutex);
    waitpid(pid, &state->status, 0);
    state->ended = true;
  }
  state->changed.notify_all();
}

bool ChildProcess::ends_within(std::chrono::milliseconds time) {
  std::unique_lock lock(state_->mutex);
  return state_->changed.wait_for(lock, time, [&] { return state_->ended; });
}

std::string ChildProcess::end() {
  std::unique_lock lock(state_->mutex);
  const bool by_us = !state_->ended;
  if (by_us) kill(state_->pid, SIGKILL);
  if (!state_->changed.wait_for(lock, std::chrono::seconds(2), [&] { return state_->ended; }))
    return "it was killed but does not exit";
  const int status = state_->status;
  if (by_us) return "it was stopped";
  if (WIFSIGNALED(status))
    return "it was ended by signal " + std::to_string(WTERMSIG(status)) + " (" +
           strsignal(WTERMSIG(status)) + ")";
  return "it ended with status " + std::to_string(WEXITSTATUS(status));
}

}  // namespace previz::aravis
