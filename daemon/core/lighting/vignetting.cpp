#include "daemon/core/lighting/vignetting.hpp"

#include <cmath>
#include <cstddef>

namespace previz::lighting {

std::vector<float> vignetting_gains(const Fisheye& lens, const Vignetting& vignetting) {
  std::vector<float> gains;
  if (vignetting == Vignetting{}) return gains;
  const FisheyeIntrinsics& intrinsics = lens.intrinsics();
  for (int y = 0; y < intrinsics.height; ++y) {
    for (int x = 0; x < intrinsics.width; ++x) {
      const auto ray = lens.unproject({x, y});
      const double angle = ray ? std::atan2(std::hypot(ray->x, ray->y), ray->z) : 0;
      gains.push_back(static_cast<float>(1 / relative_illumination(vignetting, angle)));
    }
  }
  return gains;
}

void undo_vignetting(const std::vector<float>& gains, HdrPicture& picture) {
  for (std::size_t p = 0; p < gains.size(); ++p) {
    picture.radiance[p] *= gains[p];
    picture.variance[p] *= gains[p] * gains[p];
  }
}

}  // namespace previz::lighting
