// Gives a picture its samples: a fixed number, or as many as a target error or a time asks for,
// spent where the picture still needs them.
#pragma once

#include <functional>

#include "daemon/core/render/picture/sample_sums.hpp"
#include "daemon/core/render/renderer.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::pipeline {

struct Refined {
  bool whole = false;  // false: cancelled
  int samples = 0;     // largest number of any pixel
  double error = 0;    // estimated rms error over the picture's rms; 0: no target was set
};

// True if samples are spread by need: with quality.adaptive, without a target error or time, and
// with at least 32 samples a pixel, because with fewer the pilot samples would eat too much of the
// budget.
bool spreads_samples(const set::Quality& quality);

// Renders the samples of the frame that the renderer has begun. With neither quality.error nor
// .seconds every pixel gets quality.samples. If they are spread (spreads_samples), that number is
// the average: a sixteenth of them, at least 8 a pixel, are pilot samples that decide where the
// others help most. With a target every pixel first gets quality.samples (at least 8); then, round
// after round, the samples are doubled in those parts of 8x8 blocks that need more to come below
// the error (with a time alone: below half of the picture's error), until none does or the time is
// over. A part is judged by other pixels (render::parts_above), so that no light is lost where it
// has been missed by chance; photons, which pixels share, are the exception. So the picture comes
// down to the error, but a single block may stay above it. `progress` receives how many samples are
// done: the average where they are spread, else the largest number of any pixel.
Refined refine(render::Renderer& renderer, const set::Quality& quality,
               const std::function<bool()>& cancelled,
               const std::function<void(int samples)>& progress);

// True if every pixel gets quality.samples, so that the frame can be rendered in ranges of them.
bool has_fixed_samples(const set::Quality& quality);

// Renders a range of the `samples` a pixel of the frame that the renderer has begun, and sums it in
// parts (render::part_count), so that the sums of all ranges, merged by a render::SumTree, have the
// bits of those of one call for all samples. The range's count is a power of two and at most the
// number of parts. While it works it takes a frame's sums (Renderer::take_sums) of the computer's
// memory once for every doubling of the parts, and once more; with one part none. `progress`
// receives how many of the range's samples are done.
Refined render_range(render::Renderer& renderer, int samples, render::SampleRange range,
                     const std::function<bool()>& cancelled,
                     const std::function<void(int samples)>& progress);

}  // namespace previz::pipeline
