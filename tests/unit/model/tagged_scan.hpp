// A table with a box on it and printed tags on both, as photogrammetry would deliver it: a mesh
// whose texture is an atlas of strips that are cut through the tags.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "daemon/core/set/set.hpp"

namespace previz::test {

// A rectangle; its outside is where across x up comes from.
struct TaggedFace {
  glm::dvec3 origin{0}, across{1, 0, 0}, up{0, 1, 0};  // unit vectors
  double width_m = 0, height_m = 0;
  std::vector<set::Tag> tags = {};
};

// Returns a tag flat on a face, its centre so far across and up from the origin.
set::Tag tag_on(const TaggedFace& face, int id, double size_m, glm::dvec2 at, double turn_rad = 0);

// Returns a table of 0.6 m x 0.5 m, which has tags 3 and 5, and a box of 0.2 m x 0.15 m x 0.15 m,
// which has tag 7 on its side towards -Y. The box has no lower side.
std::vector<TaggedFace> table_with_box();
std::vector<set::Tag> tags_of(const std::vector<TaggedFace>& faces);

struct TaggedScan {
  std::vector<glm::vec3> positions;  // in the world, metres, until they are moved
  std::vector<glm::vec2> uvs;        // from the lower left
  std::vector<unsigned> indices;
  int width = 0, height = 0;       // of the atlas
  std::vector<std::uint8_t> luma;  // of the atlas; without one, of the vertices

  void move(const std::function<glm::dvec3(const glm::dvec3&)>& scan_from_world);
};

// Cuts each face into strips of about 50 mm, each turned another way in the atlas.
TaggedScan textured_scan(const std::vector<TaggedFace>& faces, double pixel_m);
// Colours the vertices of a grid on each face.
TaggedScan vertex_coloured_scan(const std::vector<TaggedFace>& faces, double step_m);

// Writes NAME.obj, whose coordinates are so far from the scan's, NAME.mtl and NAME.png.
void write_textured_obj(const std::filesystem::path& file, const TaggedScan& scan,
                        const glm::dvec3& offset = glm::dvec3(0));
// The texture is in the file, binary or text as its name says.
void write_textured_glb(const std::filesystem::path& file, const TaggedScan& scan);
void write_coloured_glb(const std::filesystem::path& file, const TaggedScan& scan);
void write_coloured_ply(const std::filesystem::path& file, const TaggedScan& scan);
std::vector<unsigned char> png_of(const TaggedScan& scan);

}  // namespace previz::test
