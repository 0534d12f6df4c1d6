#include "daemon/tools/model/scan_fbx.hpp"

#include <assimp/config.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "drivers/box/in_child.hpp"
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

// A texture by its path, or as it is stored in the file.
struct FbxTexture {
  std::string path, bytes;
};

// A file's content, as another process reads it. The surface's sources are indices of `textures`.
struct FbxContent {
  FoundSurface found;
  std::vector<FbxTexture> textures;
  std::optional<double> unit_m;
  std::optional<glm::dvec3> up;
};

// Writes and reads the parts of a FbxContent one after the other.
class Packer {
 public:
  std::string bytes;

  template <typename T>
  void operator()(T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  template <typename T>
  void list(T& values) {
    std::uint64_t count = values.size();
    (*this)(count);
    bytes.append(reinterpret_cast<const char*>(values.data()), count * sizeof(values[0]));
  }
};

class Unpacker {
 public:
  explicit Unpacker(std::string_view bytes) : rest_(bytes) {}

  template <typename T>
  void operator()(T& value) {
    take(&value, sizeof value);
  }
  template <typename T>
  void list(T& values) {
    std::uint64_t count = 0;
    (*this)(count);
    if (count > rest_.size() / sizeof(values[0])) fail();
    values.resize(count);
    take(values.data(), count * sizeof(values[0]));
  }

 private:
  [[noreturn]] static void fail() { throw Error("the process that reads FBX was cut short"); }
  void take(void* to, std::size_t size) {
    if (size > rest_.size()) fail();
    if (size > 0) std::memcpy(to, rest_.data(), size);
    rest_.remove_prefix(size);
  }
  std::string_view rest_;
};

template <typename Through>
void pass(FbxContent& content, Through& through) {
  FoundSurface& found = content.found;
  through.list(found.points);
  through.list(found.luma);
  through.list(found.uvs);
  through.list(found.corners);
  through.list(found.corner_uvs);
  through.list(found.ends);
  through.list(found.sources);
  through(found.step);
  through(content.unit_m);
  through(content.up);
  std::uint64_t count = content.textures.size();
  through(count);
  content.textures.resize(count);
  for (FbxTexture& texture : content.textures) {
    through.list(texture.path);
    through.list(texture.bytes);
  }
}

class FbxReader {
 public:
  FbxReader(const std::filesystem::path& path, const aiScene& scene, bool has_colours)
      : path_(path), scene_(scene), has_colours_(has_colours) {}

  // Appends the faces of a node and of those below it.
  void append(const aiNode& node, const glm::dmat4& parent) {
    const glm::dmat4 to_file = parent * matrix_of(node.mTransformation);
    for (unsigned m = 0; m < node.mNumMeshes; ++m)
      append(*scene_.mMeshes[node.mMeshes[m]], to_file);
    for (unsigned c = 0; c < node.mNumChildren; ++c) append(*node.mChildren[c], to_file);
  }

  FbxContent take() {
    double farthest = 0;
    for (const glm::dvec3& p : found_.points)
      for (glm::length_t k = 0; k < 3; ++k)
        if (std::isfinite(p[k])) farthest = std::max(farthest, std::abs(p[k]));
    found_.step = single_step * farthest;
    return {std::move(found_), std::move(used_), {}, {}};
  }

 private:
  struct Texture {
    int source = colourless;
    unsigned uv_channel = 0;
  };

  void append(const aiMesh& mesh, const glm::dmat4& to_file) {
    const auto first = static_cast<std::uint32_t>(found_.points.size());
    const auto first_uv = static_cast<std::uint32_t>(found_.uvs.size());
    const Texture texture = has_colours_ ? texture_of(mesh) : Texture{};
    const bool has_uvs = has_colours_ && mesh.HasTextureCoords(texture.uv_channel);
    const bool has_colours = has_colours_ && mesh.HasVertexColors(0);
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
    const bool is_mirrored = glm::determinant(to_file) < 0;  // then faces are turned
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      for (unsigned k = 0; k < face.mNumIndices; ++k) {
        const unsigned index = face.mIndices[is_mirrored ? face.mNumIndices - 1 - k : k];
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
    if (embedded && embedded->mHeight != 0)
      throw Error(fmt::format("{}: its texture \"{}\" is not compressed; export it as PNG or JPEG",
                              path_.string(), printable(path)));
    const auto known = std::ranges::find(used_, path, &FbxTexture::path);
    if (known == used_.end()) {
      used_.push_back({path, {}});
      if (embedded)
        used_.back().bytes.assign(reinterpret_cast<const char*>(embedded->pcData),
                                  embedded->mWidth);
      return static_cast<int>(used_.size() - 1);
    }
    return static_cast<int>(known - used_.begin());
  }

  const std::filesystem::path& path_;
  const aiScene& scene_;
  bool has_colours_;
  std::vector<FbxTexture> used_;
  FoundSurface found_;
};

// Releases of Assimp differ in the type.
std::optional<double> number_of(const aiMetadata& metadata, const std::string& key) {
  if (double value = 0; metadata.Get(key, value)) return value;
  if (float value = 0; metadata.Get(key, value)) return static_cast<double>(value);
  if (std::int32_t value = 0; metadata.Get(key, value)) return static_cast<double>(value);
  return {};
}

void read_units(const aiMetadata& metadata, FbxContent& content) {
  if (const auto cm = number_of(metadata, "UnitScaleFactor"); cm && *cm > 0)
    content.unit_m = 0.01 * *cm;
  const auto axis = number_of(metadata, "UpAxis");
  if (!axis || *axis < 0 || *axis > 2) return;
  glm::dvec3 up(0);
  up[static_cast<glm::length_t>(*axis)] =
      number_of(metadata, "UpAxisSign").value_or(1) < 0 ? -1 : 1;
  content.up = up;
}

FbxContent content_of(const std::filesystem::path& path, const std::string& bytes,
                      bool has_colours) {
  Assimp::Importer importer;
  for (const char* look : {AI_CONFIG_IMPORT_FBX_READ_MATERIALS, AI_CONFIG_IMPORT_FBX_READ_TEXTURES})
    importer.SetPropertyBool(look, has_colours);
  for (const char* unneeded : {AI_CONFIG_IMPORT_FBX_READ_CAMERAS, AI_CONFIG_IMPORT_FBX_READ_LIGHTS,
                               AI_CONFIG_IMPORT_FBX_READ_ANIMATIONS})
    importer.SetPropertyBool(unneeded, false);
  const aiScene* const scene = importer.ReadFileFromMemory(bytes.data(), bytes.size(), 0, "fbx");
  if (!scene || !scene->mRootNode)
    throw Error(path.string() + ": cannot be read: " + printable(importer.GetErrorString()) +
                "; export it again, as binary PLY for example");
  FbxReader reader(path, *scene, has_colours);
  // Some releases of Assimp turn and scale the root by what the metadata says, some do not.
  for (unsigned c = 0; c < scene->mRootNode->mNumChildren; ++c)
    reader.append(*scene->mRootNode->mChildren[c], glm::dmat4(1));
  FbxContent content = reader.take();
  if (scene->mMetaData) read_units(*scene->mMetaData, content);
  return content;
}

}  // namespace

FoundSurface read_fbx(const std::filesystem::path& path, ScanTextures* textures, ScanFile& file) {
  const std::string file_bytes = scan_bytes(path);
  const std::string packed = box::in_child(path.string(), [&] {
    FbxContent content = content_of(path, file_bytes, textures != nullptr);
    Packer packer;
    pass(content, packer);
    return std::move(packer.bytes);
  });
  FbxContent content;
  Unpacker unpacker(packed);
  pass(content, unpacker);
  file.unit_m = content.unit_m;
  file.up = content.up;
  std::vector<int> pictures;
  for (const FbxTexture& texture : content.textures) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(texture.bytes.data());
    pictures.push_back(texture.bytes.empty()
                           ? textures->named(texture.path)
                           : textures->encoded({bytes, texture.bytes.size()}, texture.path));
  }
  for (int& source : content.found.sources)
    if (source >= 0) source = pictures.at(static_cast<std::size_t>(source));
  return std::move(content.found);
}

}  // namespace previz::model
