// Defines the light around the set: radiance over all directions, at infinity, as an equal-area
// octahedral map (shaders/README.md, "Light").
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace previz::lighting {

// Texel (i, j) covers the square [-1 + 2 i/size, -1 + 2 (i+1)/size] x (same for j) of
// shaders/lib/octahedral.h; every texel has solid angle 4 pi / size^2. World directions, Z up.
// radiance[j * size + i] is the mean linear Rec. 709 radiance over the texel.
struct EnvironmentMap {
  int size = 0;  // texels a side, a power of two
  std::vector<glm::vec3> radiance;
};

// A light source in the image (sources.hpp). It is represented by an even disc of radiance flux /
// solid_angle_sr.
struct Source {
  int id = 0;                     // the same in every frame, from 1; 0: none yet
  glm::dvec3 direction{0, 0, 1};  // unit, to the centre of gravity of its luminance
  double solid_angle_sr = 0;      // luminous flux / the luminance that half of it comes from above
  glm::dvec3 flux{0};             // integral of radiance over solid angle, above the ring around it
  int claim = -1;   // index of the declared lamp that it belongs to (claims.hpp); -1: none
  int region = -1;  // index of its region (Extraction::regions); -1: none

  friend bool operator==(const Source&, const Source&) = default;
};

// How the map was made; the report is printed, and recorded with the frame.
struct EnvironmentReport {
  double seen_sr = 0;          // solid angle measured by the camera
  double filled_sr = 0;        // filled by the unseen rule
  double overexposed_sr = 0;   // clipped in every exposure; radiance there is a lower bound
  double underexposed_sr = 0;  // black in every exposure
  double moved_sr = 0;         // changed between the exposures, so that the newest counted
  double dropped_share = 0;    // share of all luminous flux; 0 except with residual = "dropped"
  std::vector<std::string> notes;
};

// The light of the image that the camera saw or a file gave. Depending on the set's lighting.mode,
// `environment` is the whole image or what is left without its sources.
struct Lighting {
  EnvironmentMap environment{1, {glm::vec3(0)}};
  std::vector<Source> sources;
  EnvironmentReport report;
};

inline constexpr int max_resolution = 4096;
inline constexpr int max_chosen_resolution = 2048;  // where the set does not state one

// Returns the side, in texels, of the smallest map whose texels are not larger than `pixel_sr`, at
// most max_chosen_resolution.
int resolution_for(double pixel_sr);
// Returns the set's lighting.resolution, where 0 stands for resolution_for(pixel_sr). Throws
// previz::Error if it is not a power of two up to max_resolution.
int chosen_resolution(int setting, double pixel_sr);

double texel_sr(int size);
// Describes a solid angle: "an area 4.0 degrees wide", the width of a disc of that size, or "an
// area of 31 % of all directions" if the disc were wider than 90 degrees.
std::string area_words(double solid_angle_sr);
// Returns the unit direction of a texel's centre.
glm::vec3 texel_direction(int size, int i, int j);
// Returns the index into `radiance` of the texel that contains a unit direction.
std::size_t texel_index(int size, const glm::vec3& direction);

// Returns the index of texel (i, j) for i and j from -1 to size: past an edge of the square the
// sphere continues mirrored along that edge.
std::size_t wrapped_texel(int size, int i, int j);

// Returns the integral of radiance over all directions, per channel.
glm::dvec3 total_flux(const EnvironmentMap& map);

}  // namespace previz::lighting
