// Makes what a picture shows in place of a hidden printed tag: the surface that it lies on, in the
// colours around it.
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "daemon/tools/calibrate/sensor/surface_pixels.hpp"
#include "daemon/tools/model/glb.hpp"
#include "daemon/tools/model/scan_mesh.hpp"
#include "daemon/tools/model/solids.hpp"
#include "daemon/tools/model/start.hpp"
#include "drivers/calibration.hpp"

namespace previz::model {

// A model with colours, and the tags that lie on it.
struct TaggedModel {
  const std::string& family;
  const Parts& parts;
  const Layout& layout;
  const Shape& shape;
  const std::vector<Solid>& solids;  // without papers
  const Colours& colours;
};

struct UnderTag {
  int id = 0;
  NamedMesh mesh;          // "under tag 3"; no vertices where too few pixels show what is around
  std::size_t pixels = 0;  // that show the surface around the tag
};

// Returns what is under each tag that lies on a plane or a box: a piece of the face, a little
// larger than its paper, so that the paper's blurred edge is under it too. Each of its vertices has
// the albedo of the surface times what the plates have over what is rendered around the tag, nearer
// pixels counting more. `seen` is of the model with its papers and prints.
std::vector<UnderTag> under_tags(const TaggedModel& model, const calibrate::SurfacePixels& seen,
                                 const PinholeIntrinsics& lens);

}  // namespace previz::model
