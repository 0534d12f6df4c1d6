// Writes the sums of a range of a frame's samples as an OpenEXR file, and reads them back with the
// same bits.
#pragma once

#include <cstdint>
#include <filesystem>

#include "daemon/core/render/picture/sample_sums.hpp"

namespace previz::output {

struct RangeSums {
  std::uint64_t frame = 0;    // of the take
  render::SampleRange range;  // whose samples the sums have
  render::SampleSums sums;
};

// Writes 32-bit float channels, ZIP compressed, which loses nothing:
//   mixed.{high,low}.{R,G,B,mask}, difference.{high,low}.{R,G,B,depth},
//   uncovered.{high,low}.{R,G,B,differences}, square.{high,low}.{R,G,B,samples},
//   normal.{X,Y,Z,hits}, albedo.{R,G,B,A}, and, where there are photons, caustics.{R,G,B,variance}
// as gpu::GpuPixel (shaders/lib/render_shared.h) and render::PixelSums say; a sum is high + low.
// The attributes are software, previz.frame, previz.sample_range ("2/4"), previz.samples (of the
// range) and one for each counter of paths and samples, previz.rays and so on; all are strings, as
// OpenEXR has no 64-bit integers. The file
// appears whole or not at all; throws previz::Error naming the file on failure.
void write_sums_exr(const std::filesystem::path& path, const RangeSums& sums);

// Reads a file that write_sums_exr() wrote. Throws previz::Error naming the file, and the channel
// or attribute that is missing or cannot be understood.
RangeSums read_sums_exr(const std::filesystem::path& path,
                        const std::shared_ptr<render::Scratch>& scratch = {});

}  // namespace previz::output
