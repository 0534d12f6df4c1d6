// The camera's response in a device's memory, as shaders/lib/response.glsl reads it. Internal to
// the render room.
#pragma once

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/render/device/kernel.hpp"

namespace previz::render {

struct CodeTables {
  CodeTables(Device& device, const lighting::Response& response);
  void add_to(Buffers& buffers) const;

  int bits;                    // of a code
  Buffer signal_of, least_of;  // float[]: one for each code
  Buffer codes_near;           // uint[CODE_BINS]
};

}  // namespace previz::render
