// The printed tags that lie on a model: their paper and print, and what colour these have.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <string>
#include <vector>

#include "daemon/core/tracking/tag_family.hpp"
#include "daemon/tools/model/colours.hpp"
#include "daemon/tools/model/solids.hpp"
#include "daemon/tools/model/views.hpp"
#include "drivers/calibration.hpp"

namespace previz::model {

// Returns the point (metres) of a tag's axes in the world, moved to this height above what the tag
// lies on.
glm::dvec3 above_ground(const FlatTag& flat, const Plane& ground, const glm::dvec2& in_tag,
                        double height_m);

// Returns half of the width and of the height (metres) of a tag's paper, which is not smaller than
// the tag with its white border.
glm::dvec2 half_paper(const FlatTag& flat, const tracking::TagCells& cells, const Parts& parts);

// What a tag lies on; null if no solid has a face there.
struct FaceBelow {
  const Solid* solid = nullptr;
  const Face* face = nullptr;
};
FaceBelow face_below(const FlatTag& flat, const Plane& ground, const std::vector<Solid>& solids);

// Returns two solids for each tag that lies on a plane or a box, "tag 3 paper" and "tag 3 print":
// what the family has in white and in black, as thin as paper, so that nothing lies between it and
// what it lies on.
std::vector<Solid> tag_solids(const std::string& family, const Layout& layout, const Parts& parts,
                              const Shape& shape);

// Returns the colours of papers and prints, from what the plates have in their cells over what they
// have beside the tag, where the light is the same, times the albedo of what the tag lies on.
// Cells that are less than 3 px wide are too blurred to show it; tags without others are not
// listed, nor are tags that face away or that `solids`, the model without tags, hide.
std::map<std::string, Colour> tag_colours(const std::string& family, const Layout& layout,
                                          const Views& views, const Shape& shape,
                                          const std::vector<Solid>& solids,
                                          const ResponseCurve& response,
                                          const std::map<std::string, Colour>& surfaces);

// Returns what papers and prints of tags usually have, for those of which no picture shows it.
std::map<std::string, glm::dvec3> usual_tag_colours(const Layout& layout);

}  // namespace previz::model
