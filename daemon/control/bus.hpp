// org.previz.Rig1 on D-Bus, by sd-bus: the rig's verbs and what it is doing; nothing of its
// insides.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "daemon/set/actions.hpp"

struct sd_event;

namespace previz::control {

inline constexpr const char* bus_name = "org.previz.Rig1";
inline constexpr const char* object_path = "/org/previz/Rig1";
inline constexpr const char* interface_name = "org.previz.Rig1";

// The properties; each has a PropertiesChanged signal.
struct Status {
  std::string mode;  // "standby", "live", "refine", "review"
  bool recording = false;
  std::string take;  // name of the running or the last take; empty: none yet
  std::uint64_t take_frames = 0, take_dropped = 0;
  std::string fault;  // why the last take ended by itself
  bool camera_lost = false;
  std::int32_t samples = 0;
  std::string set, object, light;  // names: of the set, the selected object and lamp
  std::string message;             // what was said last
};

struct Answer {
  std::string said;
  bool refused = false;
};

struct Verbs {
  std::function<Answer(const set::Action&)> perform;
  std::function<Answer(set::Mode)> go;  // unlike the actions of the modes no toggle
  std::function<Answer(bool)> record;   // likewise
  std::function<Status()> status;
  std::function<std::string()> metrics;  // JSON
};

// "MoveLeft" for "move_left": the method that every action has on the bus.
std::string method_name(const std::string& action);

// Methods, beside one for each action: Action(s), SetMode(s) and Record(b), each answering with
// what the rig says, or the error org.previz.Error.Refused; Actions() -> a(ss); Metrics() -> s.
class Bus {
 public:
  // On the system bus ($DBUS_SYSTEM_BUS_ADDRESS), served by the event loop. Throws previz::Error if
  // there is no bus, or it does not give out the name.
  Bus(sd_event* loop, Verbs verbs);
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  void changed();  // signals the properties that are not as they were

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::control
