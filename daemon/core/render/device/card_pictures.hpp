// Pictures in the device's memory that a display on the same card can show
// (drivers/card_picture.hpp). Internal to the render room.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/core/render/device/buffer.hpp"
#include "drivers/card_picture.hpp"

namespace previz::render {

class CardPictures {
 public:
  explicit CardPictures(Device& device) : device_(device) {}

  // Returns memory for a picture of this size, and the image in it, to be written by copy commands
  // that are recorded next; no picture where all are held, or the device has no memory for it or
  // shares none.
  struct Lent {
    CardPicturePtr picture;
    vk::Image image;
  };
  Lent lend(int width, int height);

  // One is being made, one waits for its end, two wait for the screen, and one is on it.
  static constexpr std::size_t most = 5;

 private:
  // In the order in which they are made.
  struct Shared {
    vk::raii::Image image{nullptr};
    vk::raii::DeviceMemory memory{nullptr};
  };
  struct Slot {
    std::unique_ptr<Shared, Retire<Shared>> shared;
    std::shared_ptr<const CardMemory> memory;
    std::shared_ptr<std::atomic<bool>> is_held;
  };
  bool create(int width, int height);

  Device& device_;
  std::vector<Slot> slots_;
};

}  // namespace previz::render
