// Writes one frame as one multi-layer OpenEXR file with every layer of the render, linear, 32-bit
// float.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/mat4x4.hpp>
#include <optional>
#include <string>

#include "daemon/core/render/picture/layers.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/timecode.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::output {

// The contents of the file's header beside the picture. The attribute names are:
//   software (string), chromaticities (Rec. 709, D65),
//   previz.samples (int), previz.denoised (int: 1 where noise was taken out of composite, and
//   variance says what seems to be left; outliers beyond the sensor's white are then gone, too),
//   previz.exposure (double), previz.timestamp_ns (string; EXR has no 64-bit
//   integers), previz.set (string), previz.pose (string: "tracked", "lost" or "ambiguous";
//   "held" in a snapshot of a live picture that was shown with the expected pose),
//   previz.world_from_camera (m44d; element [row][column] as the matrix is written, it multiplies
//   column vectors; OpenCV camera axes, metres; absent unless the pose is tracked or held),
// and OpenEXR's own (ImfStandardAttributes.h): worldToCamera and worldToNDC (m44f, of row vectors;
//   the camera left-handed: right, up, forward; without lens distortion; absent like it),
//   expTime, aperture, focus, framesPerSecond and timeCode where they are known. From 31 to 60
//   frames a second timeCode counts pairs, and its field phase the second of each, as SMPTE ST
//   12-1 does; it has no place for more.
struct ExrMetadata {
  double exposure = 1;
  std::int64_t timestamp_ns = 0;
  std::string set_name;
  std::string pose = "tracked";
  glm::dmat4 world_from_camera{1.0};
  std::optional<PinholeIntrinsics> intrinsics;  // for the picture's size
  std::optional<ThinLens> lens;
  double exposure_s = 0;  // 0: not known
  double fps = 0;         // 0: not known
  std::optional<session::TimecodeDigits> timecode;
};

// Returns the metadata for a picture of these layers, which was rendered into `frame` with the pose
// of `track`.
ExrMetadata exr_metadata(const render::Layers& layers, const Frame& frame,
                         const tracking::Track& track, const set::Set& set);

// Writes the composite as R, G, B and an A of 1, which is what most programs look for, and the
// channels mixed.R/.G/.B, real.R/.G/.B, diff.R/.G/.B, mask.Y,
// depth.Z, normal.X/.Y/.Z and variance.R/.G/.B, 32-bit float, ZIP compressed. diff is the change
// that virtual things make to real pixels: (1 - mask) * (Lm - Lr), which is Lm - Lr where the mask
// is 0 and 0 where it is 1. The file appears whole or not at all; throws previz::Error naming the
// file on failure.
void write_exr(const std::filesystem::path& path, const render::Layers& layers,
               const ExrMetadata& metadata);

// Writes likewise, but does not yet put the file in place: whoever calls may give it another name.
session::Draft exr_draft(const std::filesystem::path& path, const render::Layers& layers,
                         const ExrMetadata& metadata);

// Reads the layers of a file that write_exr wrote, also before 2026-11-29, when the composite's
// channels were composite.R/.G/.B (diff comes back as written, multiplied by 1 -
// mask). Throws previz::Error naming the file and the channel that is missing.
render::Layers read_exr(const std::filesystem::path& path);

}  // namespace previz::output
