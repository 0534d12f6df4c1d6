// Keeps the rig on the bus: connects when there is a bus, and again when it has come back.
#pragma once

#include <memory>
#include <optional>
#include <thread>

#include "daemon/control/bus.hpp"
#include "daemon/core/pipeline/stage_keeper.hpp"
#include "daemon/rig/event_loop.hpp"

namespace previz::rig {

// A rig without a bus goes on; that it is not on the bus is reported, and it tries again. What the
// verbs refer to lives until other verbs are given.
class BusLink {
 public:
  explicit BusLink(pipeline::StageKeeper::Parts kept);
  ~BusLink();

  // Serves the bus on the caller's loop, which lives until the next call of these two.
  void serve(EventLoop& loop, control::Verbs verbs);
  // Serves it on a thread of its own, which alone calls the verbs.
  void serve_alone(control::Verbs verbs);

  // Signals the properties that have changed; call it on the loop's thread.
  void changed();

 private:
  void leave();
  void join(EventLoop& loop);
  void look();
  void connect();

  EventLoop* loop_ = nullptr;
  control::Verbs verbs_;
  pipeline::StageKeeper keeper_;
  std::optional<control::Bus> bus_;
  std::unique_ptr<EventLoop::Watch> timer_;
  std::jthread alone_;  // last: it uses all of the above
};

}  // namespace previz::rig
