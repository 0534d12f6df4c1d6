#include "daemon/core/render/passes/showing_state.hpp"

namespace previz::render {

Counters with(Counters counters, const gpu::GpuControl& control) {
  const auto wide = [](std::uint32_t high, std::uint32_t low) {
    return static_cast<std::uint64_t>(high) << 32 | low;
  };
  counters.rays = wide(control.rays_high, control.rays_low);
  counters.shadow_rays = wide(control.shadow_rays_high, control.shadow_rays_low);
  counters.dropped_not_finite = control.dropped_not_finite;
  counters.dropped_negative = control.dropped_negative;
  counters.stopped_in_layers = control.stopped_in_layers;
  counters.unfinished = control.unfinished;
  counters.measured = wide(control.measured_high, control.measured_low);
  counters.unmeasured = wide(control.unmeasured_high, control.unmeasured_low);
  counters.below_zero = control.below_zero;
  return counters;
}

Showing::Showing(std::unique_ptr<State> state) : state_(std::move(state)) {}
Showing::~Showing() = default;
Showing::Showing(Showing&&) noexcept = default;
Showing& Showing::operator=(Showing&&) noexcept = default;

bool Showing::is_here() const {
  return state_->down.are_here();
}

Showing::Shown Showing::finish() {
  state_->down.finish();
  return {std::move(state_->picture), std::move(state_->on_card),
          with(state_->host, state_->control)};
}

}  // namespace previz::render
