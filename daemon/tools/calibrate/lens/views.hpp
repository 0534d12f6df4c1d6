// Gathers the views of a board that a calibration uses.
#pragma once

#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <string>
#include <vector>

#include "daemon/tools/calibrate/lens/board.hpp"
#include "daemon/tools/calibrate/lens/board_finder.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"

namespace previz::calibrate {

// Points that are fixed relative to each other, seen in one picture.
struct View {
  std::string name;
  std::vector<glm::dvec3> points;  // metres
  std::vector<glm::dvec2> pixels;
};

struct Views {
  int width = 0, height = 0;  // of every picture
  std::vector<View> views;
  // A few of the pictures looked at, from the first on, ever farther apart.
  std::vector<std::shared_ptr<const Frame>> sampled = {};
};

struct GatherOptions {
  int every = 0;  // uses every n-th picture; 0: all of a folder, at most 150 of a stream or video
  int at_most = 50;             // views; a few dozen different ones are enough
  ResponseCurve response = {};  // the camera's, to say which board the pictures hold instead
};

// Looks for the board in the pictures of a source. A picture is left out if it shows fewer than 6
// corners, or nothing new: every corner lies within 2 % of the picture's diagonal of its place in a
// view already taken. `report` gets a line for every picture that is taken or shows no board, and
// one that counts the others. Throws previz::Error if the pictures differ in size or the board is
// nowhere, with what they hold instead (board_guess.hpp).
Views gather_views(PictureSource& source, BoardFinder& finder, const Board& board,
                   const GatherOptions& options,
                   const std::function<void(const std::string&)>& report);

}  // namespace previz::calibrate
