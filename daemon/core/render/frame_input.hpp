// One observer frame, as the renderer is given it.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <optional>

#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::render {

struct FrameInput {
  PlatePtr plate = {};                     // samples as captured; or `camera`
  double exposure = 1.0;                   // absolute, of this frame
  glm::dmat4 world_from_camera{1.0};       // OpenCV camera axes
  std::optional<std::uint32_t> seed = {};  // absent: the set's, the same in every frame (P8)
  // What show() returns is averaged with the frames before, as far as they show the same
  // (daemon/core/render/passes/history.hpp). The frame's random numbers then follow those of the
  // frames before. A frame that does not accumulate ends what was accumulated, unless it only
  // stands aside.
  bool accumulates = false;
  bool stands_aside = false;
  // show() dithers the codes where the worlds differ, by a pattern that stands still, so that the
  // mean over a few pixels is right to a fraction of a code.
  bool dithers = false;
  // The frame as the camera gave it, in place of `plate`, which the device then makes of it. If
  // both are null, the composite is over black.
  FramePtr camera = {};
  // `camera` is larger than the calibration's picture, and is made smaller: every pixel has the
  // mean of the linear signal over its area.
  bool is_scaled = false;
  // What show() and show_later() return has the size of `camera`, whose picture stays as sharp as
  // it is: only what is added comes from the smaller rendering
  // (daemon/core/render/picture/enlarge.hpp).
  bool is_shown_whole = false;
};

// Returns the bits of a sample of the frame's plate, 8 where it has none. Throws previz::Error if
// the plate has another size than the lens's picture, or, where it is to be scaled, a smaller one.
int refuse_other_size(const FrameInput& input, const PinholeIntrinsics& lens);

}  // namespace previz::render
