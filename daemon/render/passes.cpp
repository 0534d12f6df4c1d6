#include "daemon/render/passes.hpp"

#include <span>

#include "daemon/render/denoiser.hpp"
#include "daemon/render/device_plate.hpp"
#include "daemon/render/history.hpp"
#include "daemon/render/presenter.hpp"
#include "daemon/render/wavefront.hpp"

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
