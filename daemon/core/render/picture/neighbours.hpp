// Says in which order the frames around one are carried along to it (Renderer::show_among).
#pragma once

#include <vector>

namespace previz::render {

// Returns the places of the frames in time, from the frame whose picture is made, which is 0 and
// the last one: -before to after, each once. No two that follow one another are further apart than
// two frames, so that what one shows is still in the next. Both numbers are 0 or more; they are the
// frames that there are, which at a take's ends are fewer than elsewhere.
std::vector<int> order_of_neighbours(int before, int after);

}  // namespace previz::render
