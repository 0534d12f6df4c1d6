#include "daemon/core/render/passes/passes.hpp"

#include <span>

#include "daemon/core/render/passes/denoiser.hpp"
#include "daemon/core/render/passes/device_plate.hpp"
#include "daemon/core/render/passes/history.hpp"
#include "daemon/core/render/passes/presenter.hpp"
#include "daemon/core/render/passes/wavefront.hpp"

namespace previz::render {

std::vector<Pass> passes_for(std::uint32_t features, std::uint32_t device) {
  std::vector<Pass> passes = Wavefront::passes_for(features, device);
  const auto add = [&](std::span<const Pass> more) {
    passes.insert(passes.end(), more.begin(), more.end());
  };
  add(DevicePlate::passes());
  add(Presenter::passes());
  add(Denoiser::passes());
  add(History::passes());
  return passes;
}

}  // namespace previz::render
