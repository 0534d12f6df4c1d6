// Makes the mesh of a scan of what a reader of its format found: faces become triangles, vertices
// are split where the texture has seams, and coordinates far from the origin are brought near it
// before they are rounded to single precision.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <vector>

#include "daemon/tools/model/scan_file.hpp"

namespace previz::model {

// A coordinate times this is the distance of the next one in single precision, at most.
inline constexpr double single_step = 0x1p-23;
inline constexpr std::uint32_t no_index = std::numeric_limits<std::uint32_t>::max();

// Faces have their corners one after the other.
struct FoundSurface {
  std::vector<glm::dvec3> points;         // in the file's coordinates
  std::vector<std::uint8_t> luma;         // of each point, sRGB-encoded; empty: they have no colour
  std::vector<glm::vec2> uvs;             // from the lower left
  std::vector<std::uint32_t> corners;     // indices of points
  std::vector<std::uint32_t> corner_uvs;  // indices of uvs, or no_index; empty: no corner has any
  std::vector<std::uint32_t> ends;        // of faces among the corners; empty: all are triangles
  std::vector<int> sources;               // of faces (ScanColours); empty: they have no texture
  double step = 0;                        // as ScanFile::step
  bool is_step_of_text = false;           // likewise

  // Ends a face of the corners that were added since the last one.
  void end_face(int source);
};

// Puts mesh, colours, origin and step into the file. Throws previz::Error beginning with `path`: it
// has no face, a face lacks a point, a coordinate is not finite or beyond 1e15, or a face has too
// many corners.
void take_surface(const std::filesystem::path& path, const FoundSurface& found, Colouring colouring,
                  ScanFile& file);

// Returns the luma of a linear or encoded colour, 0 to 1, as sRGB encodes it.
std::uint8_t luma_of(const glm::dvec3& colour, bool is_linear);

// Encoded colours of vertices as floats: from 0 to 1, or to 255 where one of them is larger. What
// is not a number is black.
class FloatColours {
 public:
  void add(const glm::dvec3& colour);
  void finish(std::vector<std::uint8_t>& luma) const;  // appends the luma of all

 private:
  std::vector<glm::vec3> colours_;
  double largest_ = 1;
};

}  // namespace previz::model
