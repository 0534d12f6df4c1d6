// Runs a program of the build as a user would, with an end to its time and its memory.
#pragma once

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace previz::test {

struct Ended {
  int status = -1;        // of the exit; 128 + N where signal N ended it
  bool ran_over = false;  // its time was over, and it was killed
  double seconds = 0;     // that it ran, by the clock
  std::string said;       // on standard output and standard error
  // The /proc/PID/status of the process that did its work, when that was sent a signal.
  std::string worker_status;
};

struct ProgramLimits {
  std::chrono::duration<double> time{60};
  std::uint64_t memory = std::uint64_t{8} << 30;  // bytes of addresses
  // Sends this signal after so long.
  int signal = 0;
  std::chrono::duration<double> signal_after{0};
  bool signals_worker = false;  // the process that does its work gets it (box/supervised.hpp)
  std::string output;           // the file of its standard output; empty: `said`
};

// Returns the process that does a program's work, once it is confined; 0 before.
inline pid_t worker_of(pid_t program, std::string& status) {
  const auto content_of_proc = [](pid_t process, const std::string& file) {
    std::ifstream stream("/proc/" + std::to_string(process) + "/" + file);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  };
  const pid_t worker =
      std::atoi(content_of_proc(program, "task/" + std::to_string(program) + "/children").c_str());
  status = worker > 0 ? content_of_proc(worker, "status") : "";
  return status.find("Seccomp:\t2") != std::string::npos ? worker : 0;
}

// `words` begins with the program, below the folder of the build: "daemon/previzd".
inline Ended run_program(const std::vector<std::string>& words, const ProgramLimits& limits = {}) {
  using Clock = std::chrono::steady_clock;
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> said(std::tmpfile(), std::fclose);
  const std::string program = PREVIZ_BINARY_DIR "/" + words[0];
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const Clock::time_point begin = Clock::now();
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(::open("/dev/null", O_RDONLY), STDIN_FILENO);
    ::dup2(limits.output.empty() ? ::fileno(said.get())
                                 : ::open(limits.output.c_str(), O_WRONLY | O_CREAT, 0600),
           STDOUT_FILENO);
    ::dup2(::fileno(said.get()), STDERR_FILENO);
    [[maybe_unused]] const rlimit memory{limits.memory, limits.memory};
    const rlimit none{0, 0};
#ifndef __SANITIZE_ADDRESS__
    ::setrlimit(RLIMIT_AS, &memory);
#endif
    ::setrlimit(RLIMIT_CORE, &none);
    // AddressSanitizer would report the signal as a fault of the program, in its own words.
    if (limits.signal == SIGSEGV) ::setenv("ASAN_OPTIONS", "handle_segv=0", 1);
    ::execv(program.c_str(), arguments.data());
    ::_exit(127);
  }
  Ended ended;
  int status = 0;
  bool is_signalled = limits.signal == 0;
  while (::waitpid(child, &status, WNOHANG) == 0) {
    const auto ran = Clock::now() - begin;
    if (!is_signalled && ran > limits.signal_after) {
      const pid_t worker = limits.signals_worker ? worker_of(child, ended.worker_status) : child;
      is_signalled = worker > 0;
      if (is_signalled) ::kill(worker, limits.signal);
    }
    if (ran > limits.time) {
      ended.ran_over = true;
      ::kill(child, SIGKILL);
      ::waitpid(child, &status, 0);
      break;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));  // between two looks
  }
  ended.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  ended.status = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  std::rewind(said.get());
  char block[4096];
  for (std::size_t count; (count = std::fread(block, 1, sizeof block, said.get())) > 0;)
    ended.said.append(block, count);
  return ended;
}

}  // namespace previz::test
