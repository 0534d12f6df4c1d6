// The sums of a frame's samples in the computer's memory, and how parts of them are merged, so that
// several processes that render a range of the samples each make the picture of one, bit for bit
// (shaders/README.md, "Accumulation").
#pragma once

#include <cstdint>
#include <glm/vec4.hpp>
#include <string>
#include <vector>

#include "daemon/core/render/picture/layers.hpp"
#include "daemon/core/render/picture/scratch.hpp"
#include "drivers/calibration.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

// One of `count` equal ranges of a frame's samples. `index` counts from 1.
struct SampleRange {
  int index = 1;
  int count = 1;

  friend bool operator==(const SampleRange&, const SampleRange&) = default;
};

// Returns "2/4".
std::string to_string(SampleRange range);

// The samples from `first` on, as many as `count`.
struct SampleSpan {
  int first = 0;
  int count = 0;

  friend bool operator==(const SampleSpan&, const SampleSpan&) = default;
};

// Returns the number of parts in which a frame of so many samples a pixel is summed: the largest
// power of two that leaves each part 64 samples or more, from 1 to 16. A frame can be divided into
// as many ranges, or into any smaller power of two.
int part_count(int samples);

// Returns the samples of a range of a frame of so many samples a pixel (0 or more). Ranges are
// equal up to one sample, and every range of a frame consists of whole ranges of any finer
// division by a power of two. A part is a range, too, of part_count() ones.
SampleSpan samples_of(SampleRange range, int samples);

// The sums of a picture's pixels, row-major.
struct PixelSums {
  PixelSums() = default;
  explicit PixelSums(const std::shared_ptr<Scratch>& scratch)
      : pixels(scratch), caustics(scratch) {}

  Sheet<gpu::GpuPixel> pixels;
  // Sum of what photons bring to the change (shaders/README.md, "Denoising"); empty: there are no
  // photons.
  Sheet<glm::vec4> caustics;
};

// The sums of some samples of a frame.
struct SampleSums {
  int width = 0, height = 0;
  std::int64_t samples = 0;  // of every pixel
  PixelSums sums;
  // What was counted for these samples, where another frame or process rendered them. Of these,
  // only the members that count paths and samples are used.
  Counters counters = {};
};

// Adds sums of other samples of the same frame. Two-float sums are added by algorithm 6
// (AccurateDWPlusDW) of Joldes, Muller and Popescu (Tight and rigorous error bounds for basic
// building blocks of double-word arithmetic, 2017), whose relative error is below 3 * 2^-48 where
// both have one sign; the result is the same in both orders. `sums` and `more` must have the same
// size, and both photons or neither.
void add_to(SampleSums& sums, const SampleSums& more);

// Adds what was counted of paths and samples.
void add_samples_counted(Counters& counters, const Counters& more);

// Throws previz::Error if a frame through this lens cannot have these sums: they have another size,
// or their caustics are there where the scene has no photons, or the other way round.
void refuse_unfit(const SampleSums& sums, const PinholeIntrinsics& lens, bool has_photons);

// Merges sums that come in the order of their samples in a balanced binary tree: pairwise summation
// (Higham, Accuracy and Stability of Numerical Algorithms, 4.1), whose rounding grows with the
// logarithm of their number. It keeps no more sums than that logarithm. The sum of an aligned
// range is a node of the tree, so merging such ranges gives the bits of the whole.
class SumTree {
 public:
  void add(SampleSums sums);
  // Returns the sum of all, of which there must be a power of two, and is then empty.
  SampleSums take();

 private:
  struct Node {
    int height;  // 0: a leaf
    SampleSums sums;
  };
  std::vector<Node> waiting_;  // for a neighbour of the same height; heights decrease
};

}  // namespace previz::render
