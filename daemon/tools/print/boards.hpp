// Draws the boards that `previz calibrate` looks for.
#pragma once

#include "daemon/tools/calibrate/lens/board.hpp"
#include "daemon/tools/print/drawing.hpp"

namespace previz::print {

// Draws a board with a white margin around it; its name is the board as a command line writes it.
// Throws previz::Error if its markers are not known.
Drawing draw_board(const calibrate::Board& board, const std::string& name);

}  // namespace previz::print
