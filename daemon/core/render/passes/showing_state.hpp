// This header has what a picture on its way from the device consists of. Internal to the render
// room.
#pragma once

#include <memory>

#include "daemon/core/render/device/buffer.hpp"
#include "daemon/core/render/passes/showing.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

struct Showing::State {
  std::shared_ptr<Device> device;  // goes last
  std::shared_ptr<Plate> picture;
  CardPicturePtr on_card;
  Counters host;
  gpu::GpuControl control{};
  Downloads down;
};

// Adds what a frame counted on the device.
Counters with(Counters counters, const gpu::GpuControl& control);

}  // namespace previz::render
