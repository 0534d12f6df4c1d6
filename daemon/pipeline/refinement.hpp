// How many samples a picture gets: a number, or as many as a target error or a time asks for, spent
// where the picture still needs them.
#pragma once

#include <functional>

#include "daemon/render/renderer.hpp"
#include "daemon/set/set.hpp"

namespace previz::pipeline {

struct Refined {
  bool whole = false;  // false: cancelled
  int samples = 0;     // the most that a pixel got
  double error = 0;    // estimated rms error over the picture's rms; 0 where nothing was asked for
};

// Whether so many samples are spread by need: quality.adaptive, without a target, and enough of
// them (32) that those which tell where to are not too large a part.
bool spreads_samples(const set::Quality& quality);

// Gives the frame that the renderer has begun its samples. With neither quality.error nor .seconds
// every pixel gets quality.samples, or, where they are spread, that many on average, where they
// bring most; a sixteenth of them, at least 8, tell where. Else every pixel gets that many (at
// least 8), and then, round after round, twice as many where 8x8 blocks are still above the error
// (with a time alone: above half of the picture's), until none is or the time is over. `progress`
// is told how many of quality.samples are spent, and beyond them the most that a pixel got.
Refined refine(render::Renderer& renderer, const set::Quality& quality,
               const std::function<bool()>& cancelled,
               const std::function<void(int samples)>& progress);

}  // namespace previz::pipeline
