#include "drivers/kms/modes.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "drivers/error.hpp"

namespace previz::kms {
namespace {

constexpr double same_rate_hz = 0.5;  // most people mean the same by 59.94 and 60

bool interlaced(const drmModeModeInfo& info) {
  return (info.flags & DRM_MODE_FLAG_INTERLACE) != 0;
}

// Returns how far a mode is from the wanted one: the less, the better.
double distance(const drmModeModeInfo& info, const DisplayMode& wanted) {
  const double rate_hz = mode_of(info).rate_hz;
  const double by_rate = wanted.rate_hz > 0 ? std::abs(rate_hz - wanted.rate_hz) : -rate_hz;
  return by_rate + (interlaced(info) ? 1e6 : 0);
}

}  // namespace

DisplayMode mode_of(const drmModeModeInfo& info) {
  double rate_hz = info.vrefresh;
  if (info.htotal > 0 && info.vtotal > 0) {
    rate_hz = 1000.0 * info.clock / (static_cast<double>(info.htotal) * info.vtotal);
    if (interlaced(info)) rate_hz *= 2;
    if ((info.flags & DRM_MODE_FLAG_DBLSCAN) != 0) rate_hz /= 2;
    if (info.vscan > 1) rate_hz /= info.vscan;
  }
  return {info.hdisplay, info.vdisplay, rate_hz};
}

const drmModeModeInfo& choose_mode(std::span<const drmModeModeInfo> modes,
                                   const std::optional<DisplayMode>& wanted) {
  if (modes.empty()) throw Error("offers no mode");
  if (!wanted) {
    const auto preferred = std::ranges::find_if(modes, [](const drmModeModeInfo& info) {
      return (info.type & DRM_MODE_TYPE_PREFERRED) != 0;
    });
    return preferred == modes.end() ? modes.front() : *preferred;
  }
  const drmModeModeInfo* best = nullptr;
  for (const drmModeModeInfo& info : modes) {
    const DisplayMode mode = mode_of(info);
    if (mode.width != wanted->width || mode.height != wanted->height) continue;
    if (wanted->rate_hz > 0 && std::abs(mode.rate_hz - wanted->rate_hz) > same_rate_hz) continue;
    if (!best || distance(info, *wanted) < distance(*best, *wanted)) best = &info;
  }
  if (!best) throw Error("has no mode " + to_string(*wanted) + "; it has " + list_of(modes));
  return *best;
}

std::string list_of(std::span<const drmModeModeInfo> modes) {
  std::vector<std::string> names;
  std::string list;
  for (const drmModeModeInfo& info : modes) {
    const std::string name = to_string(mode_of(info)) + (interlaced(info) ? " interlaced" : "");
    if (std::ranges::find(names, name) != names.end()) continue;
    names.push_back(name);
    add_to_list(list, name);
  }
  return list;
}

}  // namespace previz::kms
