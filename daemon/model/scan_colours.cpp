#include "daemon/model/scan_colours.hpp"

#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <optional>
#include <utility>

#include "daemon/scene/named_file.hpp"
#include "daemon/scene/picture_bytes.hpp"
#include "daemon/tracking/photometry.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"

namespace previz::model {
namespace {

// All pictures of a scan together: 64 of 4096 x 4096.
constexpr std::size_t most_texels = std::size_t{1} << 30;
constexpr std::uintmax_t most_texture_bytes = std::uintmax_t{1} << 30;

std::uint8_t luma_of(const aiColor4D& colour, bool is_linear) {
  double luma = 0.2126 * static_cast<double>(colour.r) + 0.7152 * static_cast<double>(colour.g) +
                0.0722 * static_cast<double>(colour.b);
  if (!std::isfinite(luma)) return 0;
  if (is_linear) luma = tracking::srgb_encode(luma);
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(luma, 0.0, 1.0)));
}

bool is_moved(const aiMaterial& material, aiTextureType type) {
  aiUVTransform on_faces;
  if (material.Get(AI_MATKEY_UVTRANSFORM(type, 0), on_faces) != aiReturn_SUCCESS) return false;
  const std::array off{on_faces.mTranslation.x, on_faces.mTranslation.y, on_faces.mScaling.x - 1,
                       on_faces.mScaling.y - 1, on_faces.mRotation};
  return std::ranges::any_of(off, [](float value) { return !(std::abs(value) < 1e-6f); });
}

struct TextureUse {
  std::string path;  // empty: the material has none
  unsigned uv_channel = 0;
  bool is_moved = false;  // by a transform of the texture coordinates
};

TextureUse texture_of(const aiMaterial& material) {
  for (const aiTextureType type :
       {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE, aiTextureType_EMISSIVE}) {
    aiString path;
    TextureUse use;
    if (material.GetTexture(type, 0, &path, nullptr, &use.uv_channel) != aiReturn_SUCCESS ||
        path.length == 0)
      continue;
    use.path = path.C_Str();
    use.is_moved = is_moved(material, type);
    return use;
  }
  return {};
}

}  // namespace

ColourReader::ColourReader(const aiScene& scene, std::filesystem::path file)
    : scene_(scene), file_(std::move(file)) {
  const std::string extension = file_.extension().string();
  is_linear_ =
      extension.size() > 1 && std::tolower(static_cast<unsigned char>(extension[1])) == 'g';
}

void ColourReader::append(const aiMesh& mesh, std::size_t triangles) {
  const Material material = material_of(mesh);
  const bool has_uvs = mesh.HasTextureCoords(material.uv_channel);
  const bool has_colours = mesh.HasVertexColors(0);
  int source = material.source;
  if (source < 0 || !has_uvs) source = has_colours ? from_vertices : colourless;
  for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
    const aiVector3D uv = has_uvs ? mesh.mTextureCoords[material.uv_channel][v] : aiVector3D();
    colours_.uvs.emplace_back(uv.x, uv.y);
    colours_.luma.push_back(has_colours ? luma_of(mesh.mColors[0][v], is_linear_) : 0);
  }
  colours_.sources.insert(colours_.sources.end(), triangles, source);
}

ColourReader::Material ColourReader::material_of(const aiMesh& mesh) {
  Material found;
  if (mesh.mMaterialIndex >= scene_.mNumMaterials) return found;
  const TextureUse use = texture_of(*scene_.mMaterials[mesh.mMaterialIndex]);
  if (use.path.empty()) return found;
  if (use.is_moved)
    throw Error(
        fmt::format("{}: its texture \"{}\" is moved, turned or scaled on its faces "
                    "(KHR_texture_transform); export the scan without that",
                    file_.string(), printable(use.path)));
  if (use.uv_channel < AI_MAX_NUMBER_OF_TEXTURECOORDS) found.uv_channel = use.uv_channel;
  found.source = picture(use.path);
  return found;
}

int ColourReader::picture(const std::string& path) {
  if (const auto known = used_.find(path); known != used_.end()) return known->second;
  const int index = decoded(bytes_of(path), path);
  used_[path] = index;
  return index;
}

// Adds the picture and returns its index.
int ColourReader::decoded(const std::vector<unsigned char>& bytes, const std::string& name) {
  const std::string where = fmt::format("{}: its texture \"{}\"", file_.string(), printable(name));
  const scene::PictureSize size = scene::checked_picture_size(bytes, where);
  texels_ += static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height);
  if (texels_ > most_texels)
    throw Error(
        fmt::format("{}: its textures have more than {} pixels together; export the scan "
                    "with smaller ones",
                    file_.string(), most_texels));
  colours_.pictures.push_back(
      {name, size.width, size.height, scene::decoded_luma(bytes, size, where)});
  return static_cast<int>(colours_.pictures.size() - 1);
}

std::vector<unsigned char> ColourReader::bytes_of(const std::string& path) const {
  if (const aiTexture* embedded = scene_.GetEmbeddedTexture(path.c_str())) {
    if (embedded->mHeight != 0)
      throw Error(fmt::format("{}: its texture \"{}\" is not compressed; export it as PNG or JPEG",
                              file_.string(), printable(path)));
    const auto* first = reinterpret_cast<const unsigned char*>(embedded->pcData);
    return {first, first + embedded->mWidth};
  }
  if (const auto found = scene::find_named_file(file_, path, scene::names_in_scans)) {
    std::error_code ignored;
    if (std::filesystem::file_size(found->path, ignored) > most_texture_bytes)
      throw Error(found->path.string() +
                  ": is larger than 1 GiB; export the scan with smaller textures");
    std::vector<unsigned char> bytes;
    if (const std::string wrong = scene::read_regular_file(found->path, bytes); !wrong.empty())
      throw Error(found->path.string() + ": cannot be read: " + wrong);
    return bytes;
  }
  throw Error(
      fmt::format("{}: its texture \"{}\" is missing; put it beside the scan, or place the "
                  "scan by three or more points, under [scan.points]",
                  file_.string(), printable(path)));
}

}  // namespace previz::model
