#include "daemon/model/scan_read.hpp"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"

namespace previz::model {
namespace {

constexpr unsigned out_of_range = std::numeric_limits<unsigned>::max();
constexpr std::array formats{".obj", ".ply", ".stl", ".fbx", ".gltf", ".glb"};

std::string extension_of(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

// Appends the triangles of a node and of those below it.
void append(const aiScene& scene, const aiNode& node, const aiMatrix4x4& parent, TriangleMesh& mesh,
            ColourReader* colours) {
  const aiMatrix4x4 to_file = parent * node.mTransformation;
  const bool is_mirrored = to_file.Determinant() < 0;  // glTF 2.0, 3.7.4
  for (unsigned m = 0; m < node.mNumMeshes; ++m) {
    const aiMesh& from = *scene.mMeshes[node.mMeshes[m]];
    const auto first = static_cast<unsigned>(mesh.positions.size());
    for (unsigned v = 0; v < from.mNumVertices; ++v) {
      const aiVector3D p = to_file * from.mVertices[v];
      mesh.positions.emplace_back(p.x, p.y, p.z);
    }
    const std::size_t before = mesh.triangles();
    for (unsigned f = 0; f < from.mNumFaces; ++f) {
      const aiFace& face = from.mFaces[f];
      // Indices are as the file has them; one that is out of range stays so.
      for (unsigned k = 0; face.mNumIndices == 3 && k < 3; ++k)
        mesh.indices.push_back(face.mIndices[k] < from.mNumVertices ? first + face.mIndices[k]
                                                                    : out_of_range);
      if (is_mirrored && face.mNumIndices == 3)
        std::swap(mesh.indices[mesh.indices.size() - 2], mesh.indices.back());
    }
    if (colours) colours->append(from, mesh.triangles() - before);
  }
  for (unsigned c = 0; c < node.mNumChildren; ++c)
    append(scene, *node.mChildren[c], to_file, mesh, colours);
}

// Releases of Assimp differ in the type.
std::optional<double> number_of(const aiMetadata& metadata, const std::string& key) {
  if (double value = 0; metadata.Get(key, value)) return value;
  if (float value = 0; metadata.Get(key, value)) return static_cast<double>(value);
  if (std::int32_t value = 0; metadata.Get(key, value)) return static_cast<double>(value);
  return {};
}

void read_fbx_units(const aiMetadata& metadata, ScanFile& file) {
  if (const auto cm = number_of(metadata, "UnitScaleFactor"); cm && *cm > 0)
    file.unit_m = 0.01 * *cm;
  const auto axis = number_of(metadata, "UpAxis");
  if (!axis || *axis < 0 || *axis > 2) return;
  glm::dvec3 up(0);
  up[static_cast<glm::length_t>(*axis)] =
      number_of(metadata, "UpAxisSign").value_or(1) < 0 ? -1 : 1;
  file.up = up;
}

void insist_on_triangles(const std::filesystem::path& path, const TriangleMesh& mesh) {
  if (mesh.indices.empty())
    throw Error(path.string() +
                ": has no triangles; export the scan as a mesh, not as points or lines");
  if (std::ranges::find(mesh.indices, out_of_range) != mesh.indices.end())
    throw Error(path.string() +
                ": has a face with a vertex that the file lacks; export the scan again");
  for (const glm::vec3& p : mesh.positions)
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      throw Error(path.string() +
                  ": has a vertex whose coordinates are not finite numbers; clean the mesh in the "
                  "program that made it, and export it again");
}

}  // namespace

ScanFile read_scan(const std::filesystem::path& path, Colouring colouring) {
  const std::string extension = extension_of(path);
  if (std::ranges::find(formats, extension) == formats.end())
    throw Error(path.string() + ": is not a scan; allowed: .obj, .ply, .stl, .fbx, .gltf, .glb");
  if (!std::filesystem::is_regular_file(path)) throw Error(path.string() + ": file not found");
  Assimp::Importer importer;
  const bool has_colours = colouring == Colouring::read;
  for (const char* look : {AI_CONFIG_IMPORT_FBX_READ_MATERIALS, AI_CONFIG_IMPORT_FBX_READ_TEXTURES})
    importer.SetPropertyBool(look, has_colours);
  for (const char* unneeded : {AI_CONFIG_IMPORT_FBX_READ_CAMERAS, AI_CONFIG_IMPORT_FBX_READ_LIGHTS,
                               AI_CONFIG_IMPORT_FBX_READ_ANIMATIONS})
    importer.SetPropertyBool(unneeded, false);
  const aiScene* const scene = importer.ReadFile(path.string(), aiProcess_Triangulate);
  if (!scene || !scene->mRootNode)
    throw Error(path.string() + ": cannot be read: " + printable(importer.GetErrorString()) +
                "; export it again, as binary PLY for example");
  ScanFile file;
  ColourReader reader(*scene, path);
  ColourReader* const colours = has_colours ? &reader : nullptr;
  if (extension == ".fbx") {
    // Some releases of Assimp turn and scale the root by what the metadata says, some do not.
    for (unsigned c = 0; c < scene->mRootNode->mNumChildren; ++c)
      append(*scene, *scene->mRootNode->mChildren[c], {}, file.mesh, colours);
    if (scene->mMetaData) read_fbx_units(*scene->mMetaData, file);
  } else {
    append(*scene, *scene->mRootNode, {}, file.mesh, colours);
  }
  if (extension == ".gltf" || extension == ".glb") {
    file.unit_m = 1;
    file.up = {0, 1, 0};
  }
  insist_on_triangles(path, file.mesh);
  file.colours = reader.take();
  return file;
}

}  // namespace previz::model
