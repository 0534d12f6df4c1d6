// Lends pictures, and lends them again once nobody holds them: a picture of 3840x2160 has 50 MB,
// and having the system give and take them for every frame takes longer than filling them.
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "drivers/plate.hpp"

namespace previz::render {

class PlatePool {
 public:
  // Returns a picture of this size, whose samples are of chance. It may be given back on any
  // thread, also after the pool is gone. The pool keeps no more than two that nobody holds.
  std::shared_ptr<Plate> lend(int width, int height, int bits);

 private:
  static constexpr std::size_t most_kept = 2;
  struct Kept {
    std::mutex mutex;
    std::vector<std::unique_ptr<Plate>> plates;
  };
  std::shared_ptr<Kept> kept_ = std::make_shared<Kept>();
};

}  // namespace previz::render
