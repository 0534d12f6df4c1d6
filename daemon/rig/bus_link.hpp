// Keeps the rig on the bus: connects when there is a bus, and again when it has come back.
#pragma once

#include <memory>
#include <optional>

#include "daemon/control/bus.hpp"
#include "daemon/pipeline/stage_keeper.hpp"
#include "daemon/rig/event_loop.hpp"

namespace previz::rig {

// A rig without a bus goes on; that it is not on the bus is reported, and it tries again. All of
// this belongs to the loop's thread.
class BusLink {
 public:
  // The loop and what the verbs refer to outlive the link.
  BusLink(EventLoop& loop, control::Verbs verbs, pipeline::StageKeeper::Parts kept);

  // Signals the properties that have changed.
  void changed();

 private:
  void look();
  void connect();

  EventLoop& loop_;
  const control::Verbs verbs_;
  pipeline::StageKeeper keeper_;
  std::optional<control::Bus> bus_;
  std::unique_ptr<EventLoop::Watch> timer_;
};

}  // namespace previz::rig
