// Takes the light of lamps that the set declares out of the light map, so that no lamp shines twice
// and a lamp that is dimmed or removed really takes its light along.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/lighting/bright_regions.hpp"
#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/lighting/sources.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::lighting {

// The directions that a declared lamp covers as seen from the light camera's place: a cone, or the
// outline of triangles. World axes.
struct Claim {
  std::string lamp;                 // its name, or that of its object
  glm::dvec3 centre{0};             // unit, towards the lamp's middle
  double cone_rad = 0;              // half angle of a cone about `centre`; 0: the outline counts
  std::vector<glm::dvec3> outline;  // three corners each, metres from the light camera's place
  bool has_size = true;             // false: the lamp may be wider than the cone

  // Returns whether a unit direction lies in the cone or the outline.
  bool covers(const glm::dvec3& direction) const;
};

// A measured outline is as exact as a tape measure and a model are; this much is added around it.
inline constexpr double outline_margin_rad = 0.0175;  // 1 degree

// A lamp whose size is not stated has the bright region at its middle, unless that is wider than a
// cone of this half angle.
inline constexpr double widest_unstated_rad = 0.1745;  // 10 degrees

// Returns the direction from the light camera's place of what the map shows in a direction; nothing
// where the camera cannot see that.
using FromCamera = std::function<std::optional<glm::dvec3>(const glm::dvec3& map_direction)>;

class Claims {
 public:
  Claims() = default;
  // `size` is the side of the maps in texels. Where claims overlap, the one that covers fewer
  // texels counts. An outline gets its margin, at least the two texels over which a lens blurs it.
  // A lamp that the light camera cannot see (from_camera) claims nothing.
  Claims(const std::vector<Claim>& claims, int size, const FromCamera& from_camera);

  bool empty() const { return claims_.empty(); }
  const std::vector<Claim>& all() const { return claims_; }

  // Takes the light of every claim out of the map and returns it as sources with Source::claim set;
  // one claim can have several, or none; none if there is no ring around it. Light is what exceeds
  // the mean of the ring around the claim, which also fills the hole: sources and map together keep
  // the flux. A bright region most of whose light lies within a claim belongs to it as a whole,
  // because a measured place is never quite the lamp's; so does the one at the middle of a lamp
  // without a size.
  std::vector<Source> take_out(EnvironmentMap& map, const set::LightSources& settings) const;

  // Marks the sources whose direction lies in a claim, for light that has no map: a recorded one.
  void mark(std::vector<Source>& sources) const;

 private:
  std::vector<BrightRegion> regions(const EnvironmentMap& map,
                                    const set::LightSources& settings) const;

  std::vector<Claim> claims_;
  FromCamera from_camera_;
  int size_ = 0;
  std::vector<std::uint32_t> labels_;  // the claim of every texel
};

}  // namespace previz::lighting
