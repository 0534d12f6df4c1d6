#include "daemon/core/render/device/plate_pool.hpp"

#include <utility>

namespace previz::render {

std::shared_ptr<Plate> PlatePool::lend(int width, int height, int bits) {
  std::unique_ptr<Plate> plate;
  {
    const std::lock_guard lock(kept_->mutex);
    if (!kept_->plates.empty()) {
      plate = std::move(kept_->plates.back());
      kept_->plates.pop_back();
    }
  }
  if (!plate) plate = std::make_unique<Plate>();
  plate->width = width;
  plate->height = height;
  plate->bits = bits;
  plate->samples.resize(std::size_t{3} * static_cast<std::size_t>(width) *
                        static_cast<std::size_t>(height));
  return {plate.release(), [kept = kept_](Plate* back) {
            std::unique_ptr<Plate> owned(back);
            const std::lock_guard lock(kept->mutex);
            if (kept->plates.size() < most_kept) kept->plates.push_back(std::move(owned));
          }};
}

}  // namespace previz::render
