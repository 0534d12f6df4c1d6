// The colours of a scan: its textures, or the colours of its vertices, as grey pictures.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec2.hpp>
#include <map>
#include <string>
#include <vector>

struct aiMesh;
struct aiScene;

namespace previz::model {

struct ScanPicture {
  std::string name;
  int width = 0, height = 0;
  std::vector<std::uint8_t> luma;  // sRGB-encoded, row-major from the top
};

// The source of a triangle's colour is the index of a picture, or one of these.
inline constexpr int from_vertices = -1, colourless = -2;

struct ScanColours {
  std::vector<ScanPicture> pictures;
  std::vector<glm::vec2> uvs;      // of each vertex; (0, 0) is the lower left of the picture
  std::vector<std::uint8_t> luma;  // of each vertex, sRGB-encoded
  std::vector<int> sources;        // of each triangle
};

// Collects the colours of meshes while they are appended to one another.
class ColourReader {
 public:
  // `file` is the scan's; textures are in it, or in its folder. No path leads out of that folder.
  ColourReader(const aiScene& scene, std::filesystem::path file);

  // Appends the vertices of a mesh, and the sources of so many triangles. Throws previz::Error
  // naming the scan and its texture: it is missing, is no PNG or JPEG, is damaged, is too large,
  // or is moved, turned or scaled on its faces.
  void append(const aiMesh& mesh, std::size_t triangles);
  ScanColours take() { return std::move(colours_); }

 private:
  struct Material {
    int source = colourless;
    unsigned uv_channel = 0;
  };
  Material material_of(const aiMesh& mesh);
  int picture(const std::string& path);
  int decoded(const std::vector<unsigned char>& bytes, const std::string& name);
  std::vector<unsigned char> bytes_of(const std::string& path) const;

  const aiScene& scene_;
  std::filesystem::path file_;
  bool is_linear_ = false;           // of vertex colours: glTF 2.0, 3.7.2
  std::map<std::string, int> used_;  // indices of pictures by their paths
  std::size_t texels_ = 0;
  ScanColours colours_;
};

}  // namespace previz::model
