#include "daemon/core/render/device/code_tables.hpp"

#include <algorithm>
#include <vector>

#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

// Where one bin ends and the next begins, single precision may be off by much less than this part
// of a bin.
constexpr double bin_margin = 0.01;

std::vector<std::uint32_t> codes_near_bins(const std::vector<double>& signals) {
  const auto code_below = [&](double root) {
    const double signal = root <= 0 ? 0 : root * root;
    const auto above = std::ranges::upper_bound(signals, signal);
    return static_cast<std::uint32_t>(std::max<std::ptrdiff_t>(above - signals.begin() - 1, 0));
  };
  std::vector<std::uint32_t> near;
  for (std::uint32_t bin = 0; bin < gpu::CODE_BINS; ++bin) {
    const bool is_last = bin + 1 == gpu::CODE_BINS;
    const std::uint32_t high = is_last ? static_cast<std::uint32_t>(signals.size() - 1)
                                       : code_below((bin + 1 + bin_margin) / gpu::CODE_BINS);
    near.push_back(code_below((bin - bin_margin) / gpu::CODE_BINS) | high << 16u);
  }
  return near;
}

}  // namespace

CodeTables::CodeTables(Device& device, const lighting::Response& response) : bits(response.bits()) {
  const Purpose purpose{"the camera's response", "close other programs"};
  const std::vector<double>& inverse = response.inverse();
  upload_storage(device, purpose, signal_of, std::vector<float>(inverse.begin(), inverse.end()));
  std::vector<float> least;
  for (std::size_t code = 0; code < inverse.size(); ++code)
    least.push_back(static_cast<float>(response.least_signal(static_cast<std::uint16_t>(code))));
  upload_storage(device, purpose, least_of, least);
  upload_storage(device, purpose, codes_near, codes_near_bins(inverse));
}

void CodeTables::add_to(Buffers& buffers) const {
  buffers.insert({{"signal_of", &signal_of}, {"least_of", &least_of}, {"codes_near", &codes_near}});
}

}  // namespace previz::render
