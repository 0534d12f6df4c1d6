// A process that this one starts, and that never outlives it.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "drivers/descriptor.hpp"

namespace previz::aravis {

// A program with no descriptors but one socket, no environment and no terminal. The thread that
// starts it also waits for its end, so that it is a child of a thread that lives as long: the
// program asks the kernel to be killed when that thread ends.
class ChildProcess {
 public:
  // The descriptor under which the program has its socket.
  static constexpr int its_socket = 3;

  // Starts `program ARGUMENTS... PID`, where PID is this process's. Throws previz::Error.
  ChildProcess(const std::filesystem::path& program, std::vector<std::string> arguments,
               OwnedDescriptor socket);
  // Kills it if it still runs.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t pid() const { return state_->pid; }
  // Waits for its end; returns false if it still runs then.
  bool ends_within(std::chrono::milliseconds time);
  // Kills it and waits until it is gone; returns how it ended: "it was ended by signal 11
  // (Segmentation fault)". If it had ended before, that is returned. One that a device driver of
  // the kernel holds up is waited for two seconds, and then left to its thread.
  std::string end();

 private:
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    bool started = false, ended = false;
    pid_t pid = -1;
    int error = 0;  // why it was not started
    int status = 0;
  };
  static void keep(const std::shared_ptr<State>& state, const std::filesystem::path& program,
                   std::vector<std::string> arguments, OwnedDescriptor socket);

  std::shared_ptr<State> state_ = std::make_shared<State>();
  std::thread keeper_;
};

}  // namespace previz::aravis
