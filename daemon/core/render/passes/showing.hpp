// A picture on its way from the device.
#pragma once

#include <memory>

#include "daemon/core/render/picture/layers.hpp"
#include "drivers/card_picture.hpp"
#include "drivers/plate.hpp"

namespace previz::render {

// The device may still be at work on the picture.
class Showing {
 public:
  struct State;
  explicit Showing(std::unique_ptr<State> state);
  ~Showing();
  Showing(Showing&&) noexcept;
  Showing& operator=(Showing&&) noexcept;

  // Returns whether finish() has nothing to wait for.
  bool is_here() const;
  // Waits for the picture and what was counted in its frame. May be called once. Throws as
  // Renderer::show() does.
  struct Shown {
    PlatePtr picture;        // null: it was not to come down
    CardPicturePtr on_card;  // null: it was not to be there, or could not
    Counters counters;
  };
  Shown finish();

 private:
  std::unique_ptr<State> state_;
};

}  // namespace previz::render
