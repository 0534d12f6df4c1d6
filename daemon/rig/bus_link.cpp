#include "daemon/rig/bus_link.hpp"

#include <chrono>
#include <utility>

#include "drivers/error.hpp"

namespace previz::rig {

BusLink::BusLink(pipeline::StageKeeper::Parts kept)
    : keeper_("bus", std::move(kept), &pipeline::Patience::stage) {}

BusLink::~BusLink() {
  leave();
}

void BusLink::serve(EventLoop& loop, control::Verbs verbs) {
  leave();
  verbs_ = std::move(verbs);
  join(loop);
}

// Without a thread or a loop for it, nobody answers for a while.
void BusLink::serve_alone(control::Verbs verbs) try {
  leave();
  verbs_ = std::move(verbs);
  alone_ = std::jthread([this](const std::stop_token& stop) {
    try {
      EventLoop loop;
      const auto end = loop.every(std::chrono::milliseconds(20), [&] {
        if (stop.stop_requested()) loop.exit();
      });
      join(loop);
      loop.run();
      timer_.reset();
      if (bus_) bus_->leave();
    } catch (const std::exception&) {
      return;
    }
  });
} catch (const std::exception&) {
}

void BusLink::leave() {
  alone_ = {};
  timer_.reset();
  if (bus_) bus_->leave();
}

void BusLink::join(EventLoop& loop) {
  loop_ = &loop;
  keeper_.attempt([this] {
    if (bus_ && bus_->is_open()) bus_->serve(loop_->handle(), verbs_);
  });
  timer_ = loop.every(std::chrono::milliseconds(500), [this] { look(); });
  look();
}

void BusLink::changed() {
  if (bus_) bus_->changed();
}

void BusLink::look() {
  if (bus_ && bus_->is_open()) return;
  keeper_.attempt([this] { connect(); });
}

void BusLink::connect() {
  if (bus_) {
    bus_.reset();
    throw Error("D-Bus: lost the bus");
  }
  bus_.emplace(loop_->handle(), verbs_);
}

}  // namespace previz::rig
