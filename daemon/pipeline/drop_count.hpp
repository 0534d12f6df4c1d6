// What a channel dropped, as it happens, for the metrics of the stage that reads it.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "daemon/pipeline/channel.hpp"
#include "daemon/pipeline/metrics.hpp"

namespace previz::pipeline {

template <class T>
class DropCount {
 public:
  // All three outlive this.
  DropCount(Metrics& metrics, std::string stage, const Channel<T>& channel)
      : metrics_(metrics), stage_(std::move(stage)), channel_(channel) {}

  // Those since the last call.
  void tell() {
    const std::uint64_t dropped = channel_.dropped();
    metrics_.dropped(stage_, "newer frame", dropped - std::exchange(told_, dropped));
  }

 private:
  Metrics& metrics_;
  const std::string stage_;
  const Channel<T>& channel_;
  std::uint64_t told_ = 0;
};

}  // namespace previz::pipeline
