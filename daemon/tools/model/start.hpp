// Finds a first guess at a model, and how its parts, points and tags hang together.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/tools/model/parts.hpp"
#include "daemon/tools/model/shape.hpp"
#include "daemon/tools/model/views.hpp"

namespace previz::model {

// A named point is a free point, a corner of a box, or one of those on a cylinder's rim.
struct Place {
  enum class Kind { free, box_corner, upper_rim, lower_rim } kind = Kind::free;
  std::size_t part = 0;    // index of box, cylinder or free point
  std::size_t corner = 0;  // of the box, as corner() counts them
};

// A tag that lies flat on a plane or on a side of a box.
struct FlatTag {
  const set::Tag* tag = nullptr;
  double thickness_m = 0;
  std::size_t part = 0;  // index of plane or box
  bool is_on_box = false;
  // If it is on a box: the box's axis that its side is at right angles to, and whether it is the
  // side at the far end of that axis.
  std::size_t axis = 0;
  bool is_far = false;
};

struct Layout {
  std::map<std::string, Place> places;                       // of all points that are used
  std::vector<std::string> free_points;                      // names, in the order of Shape::points
  std::vector<std::string> unused_points;                    // are marked and belong to no part
  std::vector<std::optional<std::size_t>> plane_on, box_on;  // index of a plane, for each part
  std::vector<std::size_t> cylinder_on;
  // Whether the box's corners are marked clockwise, seen from above. Its length is then from the
  // first corner to the fourth.
  std::vector<bool> is_clockwise;
  std::vector<FlatTag> tags;
};

struct Start {
  Layout layout;
  Shape shape;
};

// Throws previz::Error naming a tag that the set does not have, a point whose rays do not show
// where it is, and a part whose points, tags and sizes do not determine it.
Start first_guess(const Parts& parts, const Views& views, const std::vector<set::Tag>& tags);

// Returns where a free point or a corner of a box is: a place that is the same in all pictures.
glm::dvec3 place_of(const Shape& shape, const Place& place);

// Returns a tag's corners in the world, as its map has them.
std::array<glm::dvec3, 4> corners_of(const set::Tag& tag);

// Returns the plane that a tag lies on.
Plane ground_of(const FlatTag& flat, const Shape& shape);

// Moves what stands on a plane onto it, upright.
void settle(const Layout& layout, Shape& shape);

// Returns the known sizes of a box, in the order of Box::size.
std::array<std::optional<double>, 3> known_sizes(const BoxPart& part, bool is_clockwise);

}  // namespace previz::model
