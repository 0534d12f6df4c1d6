// Measures the tracker on a ground truth set: every frame against exact poses and corners.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/core/tracking/apriltag_tracker.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "tests/truth/truth_set.hpp"

namespace previz::truth {

// An 8- or 16-bit picture file as a camera would have delivered it (rgb8, rgb16 or gray8). Throws
// previz::Error naming the file.
Frame read_frame(const std::filesystem::path& file);

// The set's tag map with the tracker's defaults.
set::Tracking tracking_settings(const TruthSet& set);

// One seen tag, its corners against the exact ones.
struct CornerError {
  int id = 0;
  std::string trouble;
  std::vector<glm::dvec2> error_px;  // measured - exact, four
  double chi_square = 0;             // of the error against the stated covariance, 8 degrees
};

struct TrackedFrame {
  int index = 0;
  tracking::Track track;
  std::vector<CornerError> corners;  // of every tag of the map that was detected
  // Only where tracked:
  double vertex_px = 0;  // mean over the virtual vertices in the picture, tracked against true
  double vertex_max_px = 0;
  double reprojection_px = 0;  // mean over the corners of the tags used, likewise
  double rotation_rad = 0, translation_m = 0;
  double error_squared = 0;  // normalised by the covariance: chi-square of 6 degrees
  // What a live picture shows; absent where it shows nothing.
  double held_s = 0;
  std::optional<double> shown_px;  // as vertex_px
  // How far the vertices' error (found or shown minus true place) is from the last frame's: mean
  // length.
  std::optional<double> jitter_px, shown_jitter_px;
};

std::vector<TrackedFrame> measure_tracking(const TruthSet& set, const set::Tracking& settings,
                                           tracking::Search search = tracking::Search::whole);

}  // namespace previz::truth
