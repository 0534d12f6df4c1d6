// Truth frames of a set that was written as a session, rendered as `previz render` would.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "daemon/tools/post/finished_frame.hpp"
#include "tests/truth/compare.hpp"
#include "tests/truth/truth_set.hpp"

namespace previz::truth {

struct RenderSettings {
  int samples = 256;
  bool adaptive = false, denoise = false;
  bool reference = false;  // by the reference CPU tracer
  int neighbours = 0;      // with denoise: frames on each side that a picture is averaged with
  std::optional<std::uint32_t> seed = {};  // absent: the set file's
  std::string device = {};                 // a part of its name; empty: the best there is
};

struct RenderedFrame {
  EstimatedFrame estimate;
  post::FinishedFrame record;
  std::optional<Chance> chance;  // of the reference tracer's picture, whose two halves tell it
};

// Renders a frame of directory/session (write_take) and leaves directory/NNNN.exr and NNNN.png by
// the set's own number of the frame. Throws previz::Error if the frame was not rendered.
RenderedFrame render_truth_frame(const TruthSet& set, int frame, const RenderSettings& settings,
                                 const std::filesystem::path& directory);

// Renders a frame by the reference CPU tracer: whether the truth and our material models are the
// same, without the renderer under test.
RenderedFrame trace_truth_frame(const TruthSet& set, int frame, int samples);

}  // namespace previz::truth
