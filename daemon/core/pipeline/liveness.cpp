#include "daemon/core/pipeline/liveness.hpp"

#include <utility>

namespace previz::pipeline {

Liveness::Pulse::Pulse(Liveness& liveness, std::string name) : liveness_(liveness) {
  const std::lock_guard lock(liveness_.mutex_);
  work_ = liveness_.works_.insert(liveness_.works_.end(), {std::move(name), std::nullopt});
}

Liveness::Pulse::~Pulse() {
  const std::lock_guard lock(liveness_.mutex_);
  liveness_.works_.erase(work_);
}

void Liveness::Pulse::begin(std::chrono::milliseconds patience) {
  const HostClock::Time due = liveness_.clock_.now() + patience;
  const std::lock_guard lock(liveness_.mutex_);
  work_->due = due;
}

void Liveness::Pulse::wait() {
  const std::lock_guard lock(liveness_.mutex_);
  work_->due.reset();
}

std::vector<std::string> Liveness::hung() const {
  const HostClock::Time now = clock_.now();
  std::vector<std::string> names;
  const std::lock_guard lock(mutex_);
  for (const Work& work : works_)
    if (work.due && now > *work.due) names.push_back(work.name);
  return names;
}

}  // namespace previz::pipeline
