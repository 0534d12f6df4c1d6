// The camera's response on a device: what codes stand for, and which code a signal becomes.
#ifndef PREVIZ_RESPONSE_GLSL
#define PREVIZ_RESPONSE_GLSL

#include "shaders/lib/render_shared.h"

// The linear signal of each code, and the least signal that becomes it.
layout(scalar) readonly buffer SignalOf { float signal_of[]; };
layout(scalar) readonly buffer LeastOf { float least_of[]; };
// For signals whose square root lies in each of CODE_BINS equal parts, the codes between which theirs
// are: the largest that stands for no more than any of them, and, in the upper half, than some of them.
layout(scalar) readonly buffer CodesNear { uint codes_near[]; };

// Returns the largest code, up to `most`, that stands for no more than `signal`, and 0 for NaN. With
// `rounds`, what is nearer to the next code already counts as that.
uint code_of(float signal, uint most, bool rounds) {
  if (!(signal > 0.0)) return 0u;
  const uint near = codes_near[min(uint(sqrt(signal) * float(CODE_BINS)), CODE_BINS - 1u)];
  uint code = near & 0xffffu;
  uint above = min((near >> 16u) + 2u, most + 1u);
  while (above - code > 1u) {
    const uint middle = (code + above) / 2u;
    if ((rounds ? least_of[middle] : signal_of[middle]) <= signal) code = middle;
    else above = middle;
  }
  return code;
}

#endif
