#include "daemon/tools/model/scan_gltf.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <string>
#include <utility>

#include "daemon/core/scene/gltf_material.hpp"
#include "daemon/core/scene/gltf_mesh.hpp"
#include "daemon/core/scene/gltf_nodes.hpp"
#include "daemon/core/scene/gltf_read.hpp"
#include "daemon/core/scene/gltf_texture.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

constexpr scene::NameRules names_in_gltf{.may_lead_up = false, .is_uri = true};

class GltfScanReader {
 public:
  GltfScanReader(const std::filesystem::path& path, ScanTextures* textures)
      : path_(path.string()),
        textures_(textures),
        about_file_(path_),
        model_(scene::read_gltf(path, about_file_, names_in_gltf)),
        notes_(path_) {}

  FoundSurface read(ScanFile& file) {
    for (const scene::PlacedNode& placed : scene::place_nodes(model_, {}, path_, notes_)) {
      const tinygltf::Node& node = model_.nodes[static_cast<std::size_t>(placed.node)];
      if (node.mesh < 0) continue;
      const std::string where = path_ + ": " + scene::node_name(model_, placed.node);
      if (static_cast<std::size_t>(node.mesh) >= model_.meshes.size())
        throw Error(where + ": no mesh " + std::to_string(node.mesh));
      for (const glm::dmat4& copy : scene::node_from_copies(model_, node, where))
        append_mesh(node.mesh, placed.file_from_node * copy);
    }
    file.unit_m = 1;
    file.up = {0, 1, 0};
    for (std::string& note : about_file_.lines())
      if (note.find(": the extension \"") == std::string::npos)  // most are about looks
        file.notes.push_back(std::move(note));
    for (std::string& note : notes_.lines()) file.notes.push_back(std::move(note));
    return std::move(found_);
  }

 private:
  void append_mesh(int index, const glm::dmat4& to_file) {
    const tinygltf::Mesh& mesh = model_.meshes[static_cast<std::size_t>(index)];
    for (std::size_t i = 0; i < mesh.primitives.size(); ++i) {
      const tinygltf::Primitive& primitive = mesh.primitives[i];
      const std::string what = "mesh " + std::to_string(index) + ", primitive " + std::to_string(i);
      if (primitive.mode >= 0 && primitive.mode < TINYGLTF_MODE_TRIANGLES) {
        notes_.add(what + ": points and lines are not supported; skipped");
        continue;
      }
      append(primitive, to_file, what);
    }
  }

  void append(const tinygltf::Primitive& primitive, const glm::dmat4& to_file,
              const std::string& what) {
    const Look look = textures_ ? look_of(primitive.material, what) : Look{};
    scene::MeshSource source = scene::mesh_source(primitive, {look.mapping});
    source.normals = -1;
    if (!textures_) source.colors = source.uvs[0] = -1;
    const auto mesh = scene::read_shape(model_, source, path_ + ": " + what, what, notes_, budget_);
    if (!mesh) return;
    const auto first = static_cast<std::uint32_t>(found_.points.size());
    const auto first_uv = static_cast<std::uint32_t>(found_.uvs.size());
    double farthest = 0;
    for (const glm::vec3& p : mesh->positions) {
      found_.points.emplace_back(to_file * glm::dvec4(p, 1));
      for (glm::length_t k = 0; k < 3; ++k)
        if (std::isfinite(p[k])) farthest = std::max(farthest, std::abs(double{p[k]}));
    }
    for (int axis = 0; axis < 3; ++axis)
      found_.step = std::max(found_.step, single_step * farthest * glm::length(to_file[axis]));
    for (const glm::vec2& uv : mesh->uvs) found_.uvs.emplace_back(uv.x, 1 - uv.y);
    if (!mesh->colors.empty() || !found_.luma.empty()) found_.luma.resize(first);
    for (const glm::vec4& c : mesh->colors)
      found_.luma.push_back(luma_of({c.r, c.g, c.b}, true));  // glTF 2.0, 3.7.2
    if (!found_.luma.empty()) found_.luma.resize(found_.points.size());
    const bool is_mirrored = glm::determinant(to_file) < 0;  // glTF 2.0, 3.7.4
    for (const glm::uvec3& triangle : mesh->triangles) {
      for (const glm::length_t k : {0, is_mirrored ? 2 : 1, is_mirrored ? 1 : 2}) {
        found_.corners.push_back(first + triangle[k]);
        if (textures_)
          found_.corner_uvs.push_back(mesh->uvs.empty() ? no_index : first_uv + triangle[k]);
      }
      found_.end_face(look.source);
    }
  }

  struct Look {
    int source = colourless;
    scene::UvMapping mapping;
  };
  Look look_of(int material, const std::string& what) {
    if (material < 0) return {};
    if (static_cast<std::size_t>(material) >= model_.materials.size())
      throw Error(path_ + ": " + what + ": no material " + std::to_string(material));
    const scene::LookTexture used =
        scene::look_texture(model_.materials[static_cast<std::size_t>(material)], what, notes_);
    if (used.texture < 0) return {};
    return {picture(used.texture), used.mapping};
  }

  int picture(int texture) {
    const auto [image, missing] = scene::image_of(model_, texture, path_, names_in_gltf);
    if (const auto known = pictures_.find(image); known != pictures_.end()) return known->second;
    if (image < 0) {
      notes_.add(missing + "; the scan has no colours there");
      return colourless;
    }
    if (!missing.empty()) notes_.add(missing);
    const scene::EncodedImage encoded = scene::encoded_image(model_, image, path_, names_in_gltf);
    if (!encoded.note.empty()) notes_.add(encoded.note);
    return pictures_[image] = textures_->encoded(encoded.bytes, encoded.name);
  }

  std::string path_;
  ScanTextures* textures_;
  scene::Notes about_file_;
  tinygltf::Model model_;
  scene::Notes notes_;
  scene::Budget budget_;
  std::map<int, int> pictures_;  // of images
  FoundSurface found_;
};

}  // namespace

FoundSurface read_gltf_scan(const std::filesystem::path& path, ScanTextures* textures,
                            ScanFile& file) {
  return GltfScanReader(path, textures).read(file);
}

}  // namespace previz::model
