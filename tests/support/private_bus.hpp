// Replaces the system's message bus by a private one while it lives.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/temporary_directory.hpp"

namespace previz::test {

class PrivateBus {
 public:
  // Everybody may do everything on the bus, unless a `policy` is given: a file such as packages
  // install for the system's bus, which says who may do what.
  explicit PrivateBus(const std::filesystem::path& policy = {}) {
    if (!policy.empty()) {
      configuration_ = "--config-file=" + (directory_ / "system.conf").string();
      std::ofstream(directory_ / "system.conf") << system_bus(address_, policy);
      std::filesystem::permissions(directory_.path(), std::filesystem::perms{0755});
    }
    start();
    setenv("DBUS_SYSTEM_BUS_ADDRESS", address_.c_str(), 1);
  }
  ~PrivateBus() {
    stop();
    unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
  }
  PrivateBus(const PrivateBus&) = delete;
  PrivateBus& operator=(const PrivateBus&) = delete;

  void start() {
    int ready[2];
    if (pipe(ready) != 0) return;
    child_ = fork();
    if (child_ == 0) {
      const std::string print = "--print-address=" + std::to_string(ready[1]);
      execlp("dbus-daemon", "dbus-daemon", configuration_.c_str(), "--nofork", "--nopidfile",
             ("--address=" + address_).c_str(), print.c_str(), nullptr);
      _exit(127);
    }
    close(ready[1]);
    char byte = 0;
    running_ = read(ready[0], &byte, 1) == 1;  // nothing where it could not be started
    close(ready[0]);
  }
  void stop() {
    if (child_ <= 0) return;
    kill(child_, SIGTERM);
    go_on();
    waitpid(child_, nullptr, 0);
    child_ = -1;
    running_ = false;
    std::filesystem::remove(directory_ / "bus");
  }
  bool running() const { return running_; }
  // It stands still, as under a debugger or on a disk that hangs, until it goes on.
  void stand_still() const { kill(child_, SIGSTOP); }
  void go_on() const { kill(child_, SIGCONT); }

 private:
  // What the system's bus has before any package's policy: signals and replies for all, and no
  // calls but to the bus itself (dbus-daemon's system.conf).
  static std::string system_bus(const std::string& address, const std::filesystem::path& policy) {
    return "<busconfig><type>system</type><listen>" + address +
           "</listen><auth>EXTERNAL</auth><policy context=\"default\"><allow user=\"*\"/>"
           "<deny own=\"*\"/><deny send_type=\"method_call\"/><allow send_type=\"signal\"/>"
           "<allow send_requested_reply=\"true\" send_type=\"method_return\"/>"
           "<allow send_requested_reply=\"true\" send_type=\"error\"/>"
           "<allow receive_type=\"method_call\"/><allow receive_type=\"method_return\"/>"
           "<allow receive_type=\"error\"/><allow receive_type=\"signal\"/>"
           "<allow send_destination=\"org.freedesktop.DBus\"/></policy><include>" +
           policy.string() + "</include></busconfig>\n";
  }

  TemporaryDirectory directory_;
  const std::string address_ = "unix:path=" + (directory_ / "bus").string();
  std::string configuration_ = "--session";
  pid_t child_ = -1;
  bool running_ = false;
};

}  // namespace previz::test
