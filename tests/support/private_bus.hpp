// A message bus that nobody else is on, in the place of the system's, while it lives.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <string>

#include "tests/support/temporary_directory.hpp"

namespace previz::test {

class PrivateBus {
 public:
  PrivateBus() {
    const std::string address = "unix:path=" + (directory_ / "bus").string();
    int ready[2];
    if (pipe(ready) != 0) return;
    child_ = fork();
    if (child_ == 0) {
      const std::string print = "--print-address=" + std::to_string(ready[1]);
      execlp("dbus-daemon", "dbus-daemon", "--session", "--nofork", "--nopidfile",
             ("--address=" + address).c_str(), print.c_str(), nullptr);
      _exit(127);
    }
    close(ready[1]);
    char byte = 0;
    running_ = read(ready[0], &byte, 1) == 1;  // nothing where it could not be started
    close(ready[0]);
    setenv("DBUS_SYSTEM_BUS_ADDRESS", address.c_str(), 1);
  }
  ~PrivateBus() {
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
    unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
  }
  PrivateBus(const PrivateBus&) = delete;
  PrivateBus& operator=(const PrivateBus&) = delete;

  bool running() const { return running_; }

 private:
  TemporaryDirectory directory_;
  pid_t child_ = -1;
  bool running_ = false;
};

}  // namespace previz::test
