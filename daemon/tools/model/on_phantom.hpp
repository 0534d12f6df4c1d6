// Puts tags onto the surface of a set's own phantoms, from which the plane of the tags themselves
// may be off by a millimetre: over a gap what is shown in place of a tag casts a shadow, and below
// the surface it is not seen.
#pragma once

#include <cstddef>
#include <optional>

#include "daemon/core/lighting/room.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/tools/model/scan_mesh.hpp"
#include "daemon/tools/model/shape.hpp"

namespace previz::model {

class PhantomSurface {
 public:
  // Takes the phantoms of a set that stand still, without their tags. `scene` is load_scene(set).
  PhantomSurface(const scene::Scene& scene, const set::Set& set);

  // Moves a mesh, which lies flat on `ground`, along the ground's normal, so that it has the same
  // height above the phantom. Returns the largest move, metres; nothing, and the mesh stays, if the
  // phantom has no surface within 20 mm of it.
  std::optional<double> put(NamedMesh& mesh, const Plane& ground) const;

 private:
  std::optional<lighting::Room> surface_;  // absent: the set has no phantom
};

}  // namespace previz::model
