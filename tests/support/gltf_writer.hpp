// Writes small glTF files for tests: JSON that a test can change at will, and one buffer.
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace previz::test {

class GltfWriter {
 public:
  using Json = nlohmann::json;
  // The buffer, which is the first, and its length are added when the file is saved.
  Json json = {{"asset", {{"version", "2.0"}}}};

  // Each returns the index of what it added.
  int add(const char* what, Json value);
  int view(const std::vector<unsigned char>& bytes, int stride = 0);
  int accessor(int view, int component_type, const char* type, std::size_t count,
               bool normalized = false, std::size_t offset = 0);
  // Adds an accessor of packed values; each element is one number, glm::vec2 or glm::vec3.
  template <typename Value>
  int values(int component_type, const char* type, const std::vector<Value>& values,
             bool normalized = false) {
    return accessor(view(bytes_of(values)), component_type, type, values.size(), normalized);
  }
  int positions(const std::vector<glm::vec3>& values) { return this->values(5126, "VEC3", values); }
  int normals(const std::vector<glm::vec3>& values) { return positions(values); }
  int uvs(const std::vector<glm::vec2>& values) { return this->values(5126, "VEC2", values); }
  int indices(const std::vector<std::uint32_t>& values) {
    return this->values(5125, "SCALAR", values);
  }
  int mesh(Json primitive, const char* name = "mesh") {
    return add("meshes", {{"name", name}, {"primitives", {std::move(primitive)}}});
  }
  // A mesh of one right triangle (0,0,0) (1,0,0) (0,1,0) without normals.
  int triangle_mesh(int material = -1);
  // An animation, without a name and not added, of one property of a node by an accessor's values.
  Json animation(int node, const char* path, const std::vector<float>& times_s, int output);
  // A node in scene 0; its "mesh" is left out where negative.
  int root(const char* name, int mesh = -1, Json more = Json::object());
  // An image of RGBA bytes, as PNG in the buffer; and a texture of it with the sampler given.
  int texture(int width, int height, const std::vector<unsigned char>& rgba,
              Json sampler = Json::object());

  // Text with a data URI, or binary where the file's name ends in .glb.
  void save(const std::filesystem::path& file) const;

  template <typename Value>
  static std::vector<unsigned char> bytes_of(const std::vector<Value>& values) {
    std::vector<unsigned char> bytes(values.size() * sizeof(Value));
    if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
    return bytes;
  }

 private:
  std::vector<unsigned char> buffer_;
};

std::string base64(const std::vector<unsigned char>& bytes);
std::vector<unsigned char> png(int width, int height, const std::vector<unsigned char>& rgba);

}  // namespace previz::test
