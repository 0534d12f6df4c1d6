// Serves org.previz.Rig1 on D-Bus through sd-bus: the actions and the status of the rig, but
// nothing of its internals.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "daemon/core/set/actions.hpp"

struct sd_event;

namespace previz::control {

inline constexpr const char* bus_name = "org.previz.Rig1";
inline constexpr const char* object_path = "/org/previz/Rig1";
inline constexpr const char* interface_name = "org.previz.Rig1";

// The properties on the bus; each has a PropertiesChanged signal.
struct Status {
  std::string mode;  // "standby", "live", "refine", "review", or "loading" until the set runs
  bool recording = false;
  bool writing = false;    // the take is not whole on the disk yet, perhaps after recording ended
  std::string take;        // name of the running or the last take; empty: none yet
  bool take_good = false;  // it was marked good
  double take_s = 0;       // its length so far
  std::uint64_t take_frames = 0;  // of the observer, written to the disk
  std::uint64_t take_dropped = 0;
  double behind_s = 0;          // of the recording behind the cameras, in tenths of a second
  std::uint64_t behind_mb = 0;  // what of it waits in memory, megabytes
  std::string fault;            // why the last take ended by itself
  bool camera_lost = false;
  std::int32_t samples = 0;
  std::string set, object, light;  // names of the set, the selected object and the selected lamp
  std::string set_problem;         // why a set that was asked for later is not the one in use
  std::string device;              // that draws: "NVIDIA RTX 4000", "llvmpipe (CPU)"; empty: none
  std::string model;               // how far it is from the pictures, in words; empty: not measured
  std::string message;             // the last announcement
  // These are as they are when they are asked for, and are not signalled.
  double picture_s = -1;  // since the last picture was shown; below 0: none was
  double loading_s = 0;   // for how long a set has been loading (mode "loading")
};

struct Answer {
  std::string said;
  bool refused = false;
};

// `who` is the caller: a user of this computer (Callers).
struct Verbs {
  // The reply may come later, on the loop's thread.
  using Reply = std::function<void(const Answer&)>;
  std::function<void(const set::Action&, const std::string& who, Reply)> perform;
  std::function<Answer(set::Mode, const std::string& who)> go;  // enters it; its action toggles
  std::function<Answer(bool, const std::string& who)>
      record;  // starts or stops; the action toggles
  std::function<Status()> status;
  std::function<std::string()> metrics;                                         // JSON
  std::function<void(const std::string& who, const std::string& verb)> denied;  // was told so
};

// Returns the name of an action's own method on the bus: "MoveLeft" for "move_left".
std::string method_name(const std::string& action);

// Serves the methods: one for each action; Action(s), SetMode(s) and Record(b), which also return
// what the rig answers or the error org.previz.Error.Refused; Actions() -> a(ss); Metrics() -> s.
// What a verb throws goes to the caller as org.previz.Error.Failed. What operates the rig is done
// once Callers lets the caller.
class Bus {
 public:
  // Connects to the system bus ($DBUS_SYSTEM_BUS_ADDRESS); the event loop serves it. Throws
  // previz::Error if there is no bus, or if it does not grant the name within three seconds.
  Bus(sd_event* loop, Verbs verbs);
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  // Lets another loop serve the bus, and other verbs answer, from now on. Nobody serves it after
  // leave(). A bus is served by one thread at a time.
  void serve(sd_event* loop, Verbs verbs);
  void leave();

  void changed();        // signals the properties that have changed
  bool is_open() const;  // false once the bus has gone

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::control
