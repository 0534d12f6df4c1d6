// The numbers of a model that are adjusted.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "daemon/tools/model/start.hpp"

namespace previz::model {

// One number, by what it does to the shape: `by` is in metres or radians.
struct Unknown {
  std::string part;  // for messages
  std::function<void(Shape&, double by)> move;
};

// Returns those of all planes, boxes, cylinders, free points and cameras. What stands on a plane
// has none that would take it off; sizes that are known are none. They refer to nothing of `start`.
std::vector<Unknown> unknowns_of(const Parts& parts, const Start& start);

}  // namespace previz::model
