// What kind of device the passes run on.
#ifndef PREVIZ_DEVICE_GLSL
#define PREVIZ_DEVICE_GLSL

#include "shaders/lib/shared.h"

layout(constant_id = 1) const uint DEVICE = 0u;  // bits of DEVICE_*

// A card has many registers to save and cheap memory for a work group; a CPU device has caches.
bool on_card() { return (DEVICE & DEVICE_IS_CARD) != 0u; }
// Whether the lanes of a subgroup are known to be together again behind a branch that parted them.
// The CPU devices that there are have shown it.
bool lanes_meet() { return !on_card() || (DEVICE & DEVICE_LANES_MEET) != 0u; }

#endif
