// Knows who calls over the bus, and lets polkit decide whether they may operate the rig.
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <string>

struct sd_bus;
struct sd_bus_message;

namespace previz::control {

// The action of polkit that allows a call, as systemd/org.previz.Rig1.policy describes it. Its
// detail "verb" is the name of an action (daemon/core/set/actions.hpp), a mode, or "record".
inline constexpr const char* operate_action = "org.previz.Rig1.operate";

class Callers {
 public:
  // Sends the answer; returns what a handler of sd-bus does.
  using Act = std::function<int(sd_bus_message* call, const std::string& who)>;
  // Is told of a call that was denied: who it was, and the verb.
  using Denied = std::function<void(const std::string& who, const std::string& verb)>;

  Callers(sd_bus* bus, Denied denied);
  ~Callers();
  Callers(const Callers&) = delete;
  Callers& operator=(const Callers&) = delete;

  // Calls `act` with the caller's name, "anna", or "uid 1000" if /etc/passwd has none, once it is
  // known that it may do `verb`: root and this process's own user may, others if polkit says so.
  // Whoever may not gets the error org.previz.Error.Denied, and whoever calls while 16 calls of his
  // wait for polkit, or 1024 of all, LimitsExceeded. Does not wait. Returns what a handler of
  // sd-bus does.
  int admit(sd_bus_message* call, const std::string& verb, Act act);

 private:
  class Waiting;

  std::string name_of(std::uint32_t user);

  sd_bus* const bus_;
  const Denied denied_;
  std::map<std::uint32_t, std::string> names_;  // of users, since somebody was unknown
  std::list<Waiting> waiting_;
};

}  // namespace previz::control
