// Adjusts a model to everything that was observed of it: marks in pictures, tags that lie flat on
// it, and the tags that placed each picture's camera.
#pragma once

#include <string>
#include <vector>

#include "daemon/tools/model/edges.hpp"
#include "daemon/tools/model/start.hpp"

namespace previz::model {

// One mark, after the adjustment.
struct MarkResidual {
  std::string picture, point;
  double off_px = 0;
};

// A face may be off along its normal by this where it is worst (one standard deviation, metres).
struct FaceAccuracy {
  std::string part, face;
  double sigma_m = 0;
};

struct Fit {
  Shape shape;
  std::vector<MarkResidual> marks;
  double rms_px = 0;        // of the marks' distances
  double mark_factor = 1;   // by which marks are farther off than their accuracy
  double noise_factor = 1;  // the same of all that was observed, or of the marks; at least 1
  std::vector<FaceAccuracy> faces;
  std::vector<double> edges_off_px;  // of each piece, the mean of both ends
};

// Least squares by Levenberg-Marquardt (daemon/core/tracking/least_squares.hpp). Unknown are the
// planes, boxes, cylinders and free points, and how far each camera is off what its tags say, with
// the covariance of that pose. Marks count by parts.mark_px, tags by tag_sigma_m, edges of light by
// their variance and edge_sigma_px. What stands on a
// plane stays on it. The accuracy of a face is propagated from the unknowns' covariance, which is
// larger by the square of noise_factor. Throws previz::Error naming the point and picture where
// marks contradict each other by more than most_off, and the part that nothing determines.
Fit adjust(const Parts& parts, const Views& views, const Start& start,
           const std::vector<EdgePiece>& edges = {});

// Adjusts to the marks, then to the edges that the pictures have where the model has them
// (find_edges), until they are the same: what is off by more than the others is no edge of the
// model. Without edges the marks decide.
Fit adjust_to_edges(const Parts& parts, const Views& views, const Start& start,
                    const ResponseCurve& response);

// An edge of light is where the edge of the thing is to so much: paint and paper are not sharp.
inline constexpr double edge_sigma_px = 0.15;

// A tag lies flat, and is where the map of tags has it, to so much (standard deviation of a
// corner).
inline constexpr double tag_sigma_m = 5e-4;
// Times the standard deviation of a mark; then it is a mistake.
inline constexpr double most_off = 8;

}  // namespace previz::model
