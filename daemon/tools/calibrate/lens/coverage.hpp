// Says what a capture for a calibration lacks, in the words of the person who holds the board.
#pragma once

#include <numbers>
#include <string>
#include <vector>

#include "daemon/tools/calibrate/lens/fisheye.hpp"
#include "daemon/tools/calibrate/lens/observer.hpp"

namespace previz::calibrate {

// Returns which views are missing; empty if the capture is good enough. The rules, and why:
//   number    at least 5 views are used. A view of a plane fixes 2 of the unknowns that all views
//             share beyond its own pose (Zhang 2000, section 3.1), 9 with distortion: 5 views.
//   picture   a corner in each of 3 x 3 fields of the picture: beyond the outermost corner the
//             distortion is a polynomial extrapolated.
//   tilt      the boards' normals spread over at least 30 degrees about either axis of the picture.
//             Without tilt the distance of the board cannot be separated from the focal length
//             (Zhang 2000, section 4, and figure 4: the error falls until 45 degrees).
//   distance  at least 2 views show the board across a third of the picture's diagonal. Tilt is
//             told from size by how the scale changes across the board; across a small board it
//             hardly changes.
//   certainty over half of the picture the projection is certain to 1 px (one standard deviation),
//             whatever else was wrong with the views.
//   worst     and nowhere worse than to useless_px.
// The last rules are only checked if the others hold, because they depend on them.
std::vector<std::string> missing_views(const Views& views, const ObserverFit& observer);

// Returns what a lens that is taken may still be doubted for: a picture that is uncertain by more
// than doubtful_px somewhere; or whose outer third, towards its corners, no corner of a board was
// seen in, where a coefficient that was left at 0 counts as certain and is not. Empty: nothing.
std::vector<std::string> doubts_of(const ObserverFit& observer);

// Returns whether the rules `number` or `tilt` are broken: then not even the focal length can be
// told from the rest of the lens.
bool has_few_views(const Views& views, const ObserverFit& observer);

// Returns why a lens of few parameters cannot be taken even by force; empty if it can. Its focal
// length must be certain to a tenth, and more than one view must have been used: a deviation that
// follows from a single view trusts that the board was exactly flat.
std::string why_useless(const ObserverFit& by_few);

// missing_views() for a fisheye, whose wide field provides the tilt: boards in a circle around
// the lens are seen from many sides.
//   number    as above.
//   circle    corners at 60 degrees off axis or more in at least 5 of 8 directions around it: half
//             of a hemisphere's solid angle lies beyond 60 degrees, and the centre of the model is
//             determined only by comparing opposite sides of the picture.
//   certainty 1 px up to those 60 degrees.
inline constexpr double least_fisheye_reach_rad = std::numbers::pi / 3;
inline constexpr std::size_t least_fisheye_sectors = 5;
std::vector<std::string> missing_views(const Views& views, const FisheyeFit& fisheye);

}  // namespace previz::calibrate
