// Finds by how much the rest of a model is off in a picture, where one of its parts is.
#pragma once

#include <optional>
#include <vector>

#include "daemon/core/fit/shift.hpp"

namespace previz::fit {

// A model that is farther off than this casts shadows that a viewer sees beside what casts them.
inline constexpr double most_off_px = 2;
// Fewer pieces of edges than this give no figure.
inline constexpr std::size_t least_pieces = 8;
// This share of the pieces that should agree on something must do so.
inline constexpr double most_of = 0.5;

struct ResidualShift {
  // All of the rest is shifted by this.
  glm::dvec2 common{0};
  // The part is shifted by this if the rest is not only shifted, but also turned and larger or
  // smaller in the picture, as it is where the camera is thought to be turned.
  glm::dvec2 turned{0};
};

// `rest` are the votes of `found` without those of the part. Returns nothing where the rest does
// not fit: it has too few pieces, or most of them do not agree on a shift of at most most_off_px.
// Without that the camera's pose or the whole model may be off, by more where the model is nearer.
std::optional<ResidualShift> residual_shift(std::size_t part, const Votes& rest,
                                            const std::vector<EdgeSample>& found);

}  // namespace previz::fit
