#include "daemon/core/render/picture/neighbours.hpp"

namespace previz::render {

// The frames before come first, up to the one beside the last. From there it is two frames to the
// one on the other side, out over the odd ones and back over the even ones. If there are none
// before, those after come in one go.
std::vector<int> order_of_neighbours(int before, int after) {
  std::vector<int> order;
  for (int i = before; i > 0; --i) order.push_back(-i);
  if (before > 0)
    for (int i = 1; i <= after; i += 2) order.push_back(i);
  for (int i = after; i > 0; --i)
    if (before <= 0 || i % 2 == 0) order.push_back(i);
  order.push_back(0);
  return order;
}

}  // namespace previz::render
