#include "daemon/rig/bus_link.hpp"

#include <chrono>
#include <utility>

#include "drivers/error.hpp"

namespace previz::rig {

BusLink::BusLink(EventLoop& loop, control::Verbs verbs, pipeline::StageKeeper::Parts kept)
    : loop_(loop),
      verbs_(std::move(verbs)),
      keeper_("bus", std::move(kept), &pipeline::Patience::stage),
      timer_(loop_.every(std::chrono::milliseconds(500), [this] { look(); })) {
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
  bus_.emplace(loop_.handle(), verbs_);
}

}  // namespace previz::rig
