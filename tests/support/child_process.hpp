// A process beside the test that does something, tells of it, and may be killed.
#pragma once

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "drivers/descriptor.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

class ChildProcess {
 public:
  // Calls `work` in the child with the descriptor by which it tells the test.
  explicit ChildProcess(const std::function<void(int tells)>& work) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw Error("no pipe");
    told_ = OwnedDescriptor(ends[0]);
    const OwnedDescriptor tells(ends[1]);
    child_ = ::fork();
    if (child_ < 0) throw Error("no process");
    if (child_ != 0) return;
    try {
      work(tells.get());
    } catch (const std::exception& error) {  // the child must not go on as a second test program
      std::fprintf(stderr, "in the child: %s\n", error.what());
      ::_exit(1);
    }
    ::_exit(0);
  }
  ~ChildProcess() { kill(); }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  void kill() {
    if (child_ > 0) ::kill(child_, SIGKILL);
    if (child_ > 0) ::waitpid(child_, nullptr, 0);
    child_ = 0;
  }

  // Waits for the next value that it tells; returns whether there is one.
  template <class Value>
  [[nodiscard]] bool is_told(Value& value) {
    return ::read(told_.get(), &value, sizeof value) == ssize_t{sizeof value};
  }

 private:
  OwnedDescriptor told_;
  pid_t child_ = 0;
};

// Tells the test a value.
template <class Value>
void tell(int tells, const Value& value) {
  if (::write(tells, &value, sizeof value) != ssize_t{sizeof value}) ::_exit(1);
}

// Returns the text that a process of its own makes.
inline std::string text_of_child(const std::function<std::string()>& make) {
  ChildProcess child([&](int tells) {
    for (const char letter : make()) tell(tells, letter);
  });
  std::string text;
  for (char letter = 0; child.is_told(letter);) text += letter;
  return text;
}

}  // namespace previz::test
