#include "daemon/model/scan_fbx.hpp"

#include <assimp/config.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"

namespace previz::model {
namespace {

glm::dmat4 matrix_of(const aiMatrix4x4& m) {
  return {m.a1, m.b1, m.c1, m.d1, m.a2, m.b2, m.c2, m.d2,
          m.a3, m.b3, m.c3, m.d3, m.a4, m.b4, m.c4, m.d4};
}

bool is_moved(const aiMaterial& material, aiTextureType type) {
  aiUVTransform on_faces;
  if (material.Get(AI_MATKEY_UVTRANSFORM(type, 0), on_faces) != aiReturn_SUCCESS) return false;
  const std::array off{on_faces.mTranslation.x, on_faces.mTranslation.y, on_faces.mScaling.x - 1,
                       on_faces.mScaling.y - 1, on_faces.mRotation};
  return std::ranges::any_of(off, [](float value) { return !(std::abs(value) < 1e-6f); });
}

class FbxReader {
 public:
  FbxReader(const std::filesystem::path& path, const aiScene& scene, ScanTextures* textures)
      : path_(path), scene_(scene), textures_(textures) {}

  // Appends the faces of a node and of those below it.
  void append(const aiNode& node, const glm::dmat4& parent) {
    const glm::dmat4 to_file = parent * matrix_of(node.mTransformation);
    for (unsigned m = 0; m < node.mNumMeshes; ++m)
      append(*scene_.mMeshes[node.mMeshes[m]], to_file);
    for (unsigned c = 0; c < node.mNumChildren; ++c) append(*node.mChildren[c], to_file);
  }

  FoundSurface take() {
    double farthest = 0;
    for (const glm::dvec3& p : found_.points)
      for (glm::length_t k = 0; k < 3; ++k)
        if (std::isfinite(p[k])) farthest = std::max(farthest, std::abs(p[k]));
    found_.step = single_step * farthest;
    return std::move(found_);
  }

 private:
  struct Texture {
    int source = colourless;
    unsigned uv_channel = 0;
  };

  void append(const aiMesh& mesh, const glm::dmat4& to_file) {
    const auto first = static_cast<std::uint32_t>(found_.points.size());
    const auto first_uv = static_cast<std::uint32_t>(found_.uvs.size());
    const Texture texture = textures_ ? texture_of(mesh) : Texture{};
    const bool has_uvs = textures_ && mesh.HasTextureCoords(texture.uv_channel);
    const bool has_colours = textures_ && mesh.HasVertexColors(0);
    for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
      const aiVector3D& p = mesh.mVertices[v];
      found_.points.emplace_back(to_file * glm::dvec4(p.x, p.y, p.z, 1));
      if (has_uvs)
        found_.uvs.emplace_back(mesh.mTextureCoords[texture.uv_channel][v].x,
                                mesh.mTextureCoords[texture.uv_channel][v].y);
      if (has_colours || !found_.luma.empty()) found_.luma.resize(found_.points.size());
      if (!has_colours) continue;
      const aiColor4D& c = mesh.mColors[0][v];
      found_.luma.back() = luma_of({c.r, c.g, c.b}, false);
    }
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      for (unsigned k = 0; k < face.mNumIndices; ++k) {
        const unsigned index = face.mIndices[k];
        const bool is_there = index < mesh.mNumVertices;
        found_.corners.push_back(is_there ? first + index : no_index);
        found_.corner_uvs.push_back(is_there && has_uvs ? first_uv + index : no_index);
      }
      found_.end_face(texture.source);
    }
  }

  Texture texture_of(const aiMesh& mesh) {
    Texture found;
    if (mesh.mMaterialIndex >= scene_.mNumMaterials) return found;
    const aiMaterial& material = *scene_.mMaterials[mesh.mMaterialIndex];
    for (const aiTextureType type :
         {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE, aiTextureType_EMISSIVE}) {
      aiString path;
      unsigned channel = 0;
      if (material.GetTexture(type, 0, &path, nullptr, &channel) != aiReturn_SUCCESS ||
          path.length == 0)
        continue;
      if (is_moved(material, type))
        throw Error(
            fmt::format("{}: its texture \"{}\" is moved, turned or scaled on its faces; export "
                        "the scan without that",
                        path_.string(), printable(path.C_Str())));
      if (channel < AI_MAX_NUMBER_OF_TEXTURECOORDS) found.uv_channel = channel;
      found.source = picture(path.C_Str());
      break;
    }
    return found;
  }

  int picture(const std::string& path) {
    const aiTexture* const embedded = scene_.GetEmbeddedTexture(path.c_str());
    if (!embedded) return textures_->named(path);
    if (const auto known = embedded_.find(embedded); known != embedded_.end()) return known->second;
    if (embedded->mHeight != 0)
      throw Error(fmt::format("{}: its texture \"{}\" is not compressed; export it as PNG or JPEG",
                              path_.string(), printable(path)));
    return embedded_[embedded] = textures_->encoded(
               {reinterpret_cast<const unsigned char*>(embedded->pcData), embedded->mWidth}, path);
  }

  const std::filesystem::path& path_;
  const aiScene& scene_;
  ScanTextures* textures_;
  std::map<const aiTexture*, int> embedded_;  // indices of their pictures
  FoundSurface found_;
};

// Releases of Assimp differ in the type.
std::optional<double> number_of(const aiMetadata& metadata, const std::string& key) {
  if (double value = 0; metadata.Get(key, value)) return value;
  if (float value = 0; metadata.Get(key, value)) return static_cast<double>(value);
  if (std::int32_t value = 0; metadata.Get(key, value)) return static_cast<double>(value);
  return {};
}

void read_units(const aiMetadata& metadata, ScanFile& file) {
  if (const auto cm = number_of(metadata, "UnitScaleFactor"); cm && *cm > 0)
    file.unit_m = 0.01 * *cm;
  const auto axis = number_of(metadata, "UpAxis");
  if (!axis || *axis < 0 || *axis > 2) return;
  glm::dvec3 up(0);
  up[static_cast<glm::length_t>(*axis)] =
      number_of(metadata, "UpAxisSign").value_or(1) < 0 ? -1 : 1;
  file.up = up;
}

}  // namespace

FoundSurface read_fbx(const std::filesystem::path& path, ScanTextures* textures, ScanFile& file) {
  Assimp::Importer importer;
  for (const char* look : {AI_CONFIG_IMPORT_FBX_READ_MATERIALS, AI_CONFIG_IMPORT_FBX_READ_TEXTURES})
    importer.SetPropertyBool(look, textures != nullptr);
  for (const char* unneeded : {AI_CONFIG_IMPORT_FBX_READ_CAMERAS, AI_CONFIG_IMPORT_FBX_READ_LIGHTS,
                               AI_CONFIG_IMPORT_FBX_READ_ANIMATIONS})
    importer.SetPropertyBool(unneeded, false);
  const aiScene* const scene = importer.ReadFile(path.string(), 0);
  if (!scene || !scene->mRootNode)
    throw Error(path.string() + ": cannot be read: " + printable(importer.GetErrorString()) +
                "; export it again, as binary PLY for example");
  FbxReader reader(path, *scene, textures);
  // Some releases of Assimp turn and scale the root by what the metadata says, some do not.
  for (unsigned c = 0; c < scene->mRootNode->mNumChildren; ++c)
    reader.append(*scene->mRootNode->mChildren[c], glm::dmat4(1));
  if (scene->mMetaData) read_units(*scene->mMetaData, file);
  return reader.take();
}

}  // namespace previz::model
