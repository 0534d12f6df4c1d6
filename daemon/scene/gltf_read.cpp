#include "daemon/scene/gltf_read.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <string_view>

#include "daemon/scene/scene.hpp"
#include "daemon/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

namespace fs = std::filesystem;

constexpr std::array known_extensions = {"EXT_mesh_gpu_instancing",
                                         "KHR_lights_punctual",
                                         "KHR_materials_anisotropy",
                                         "KHR_materials_clearcoat",
                                         "KHR_materials_emissive_strength",
                                         "KHR_materials_ior",
                                         "KHR_materials_sheen",
                                         "KHR_materials_specular",
                                         "KHR_materials_transmission",
                                         "KHR_materials_variants",
                                         "KHR_materials_volume",
                                         "KHR_mesh_quantization",
                                         "KHR_texture_transform"};

// An extension of materials that is ignored, and what will look different for it.
struct Ignored {
  std::string_view extension;
  std::string_view difference;
};
constexpr std::array ignored_extensions = {
    Ignored{"KHR_materials_diffuse_transmission",
            "leaves, paper and lampshades are dark where light comes from behind them"},
    Ignored{"KHR_materials_dispersion", "glass does not split light into its colours"},
    Ignored{"KHR_materials_iridescence",
            "soap bubbles and films of oil do not change colour with the angle of view"},
    Ignored{"KHR_materials_pbrSpecularGlossiness",
            "colours and gloss are those of the material without it"},
    Ignored{"KHR_materials_unlit",
            "what should have one colour in any light is lit like all else"}};
constexpr int max_json_depth = 128;

// Joins the lines of a tinygltf message.
std::string one_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos;)
    text.replace(at, 1, "; ");
  return set::printable(text);
}

// Reads a regular file of at most max_file_bytes; returns what is wrong, or "".
std::string read_file(const fs::path& file, std::vector<unsigned char>& bytes) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) return "there is no such file";
  if (!fs::is_regular_file(status)) return "it is not a regular file";
  const std::uint64_t size = fs::file_size(file, error);
  if (error) return "its size cannot be read";
  if (size > max_file_bytes) return "it is larger than 4 GiB";
  std::ifstream stream(file, std::ios::binary);
  bytes.resize(size);
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  return stream.good() || size == 0 ? "" : "it cannot be read";
}

// tinygltf looks for external files beside the glTF file, whose directory we give as absolute, and
// then in the working directory, where no file may be taken from.
bool file_exists(const std::string& path, void*) {
  std::error_code error;
  return fs::path(path).is_absolute() && fs::is_regular_file(path, error);
}
std::string same_path(const std::string& path, void*) {
  return path;
}
bool read_whole_file(std::vector<unsigned char>* bytes, std::string* error, const std::string& path,
                     void*) {
  const std::string wrong = read_file(path, *bytes);
  if (!wrong.empty() && error) *error = wrong;
  return wrong.empty();
}
bool write_nothing(std::string*, const std::string&, const std::vector<unsigned char>&, void*) {
  return false;
}

// tinygltf does not check the pointer of images in a buffer view, which are therefore decoded
// later.
bool keep_encoded(tinygltf::Image* image, int, std::string*, std::string*, int, int,
                  const unsigned char* bytes, int size, void*) {
  if (image->bufferView < 0 && size > 0) image->image.assign(bytes, bytes + size);
  image->as_is = true;
  return true;
}

int nesting_depth(std::string_view json) {
  int depth = 0, deepest = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      deepest = std::max(deepest, ++depth);
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return deepest;
}

std::uint32_t little_endian(const std::vector<unsigned char>& bytes, std::size_t at) {
  return bytes[at] | bytes[at + 1] << 8u | bytes[at + 2] << 16u |
         static_cast<std::uint32_t>(bytes[at + 3]) << 24u;
}

// Returns the JSON of a binary file; checks that every chunk lies within the file (glTF 2.0, 4.4).
std::string_view binary_json(const std::vector<unsigned char>& bytes, const std::string& file) {
  if (bytes.size() < 20) throw Error(file + ": a binary glTF file has at least 20 bytes");
  const std::uint64_t length = little_endian(bytes, 8);
  if (length > bytes.size())
    throw Error(file + ": is cut short: it has " + std::to_string(bytes.size()) + " of " +
                std::to_string(length) + " bytes");
  const std::uint64_t json_length = little_endian(bytes, 12);
  for (std::uint64_t chunk = 12; chunk < length;) {
    if (length - chunk < 8 || little_endian(bytes, chunk) > length - chunk - 8)
      throw Error(file + ": its chunk at byte " + std::to_string(chunk) +
                  " runs past the end of the file");
    chunk += 8ull + little_endian(bytes, chunk);
  }
  return {reinterpret_cast<const char*>(bytes.data()) + 20,
          static_cast<std::size_t>(std::min<std::uint64_t>(json_length, bytes.size() - 20))};
}

// Returns what a user can do about an extension that cannot be read.
std::string remedy_for(const std::string& name) {
  if (name == "KHR_draco_mesh_compression" || name == "EXT_meshopt_compression" ||
      name == "KHR_meshopt_compression")
    return "; export the file without compression of meshes, or decompress it: gltf-transform copy "
           "IN OUT";
  if (name == "KHR_texture_basisu" || name == "EXT_texture_webp")
    return "; export the file with textures in PNG or JPEG";
  return "";
}

// Returns what looks different without an extension, and on which materials; "" if that is not
// known.
std::string difference_without(const std::string& extension, const tinygltf::Model& model) {
  constexpr std::size_t most_named = 3;
  std::string result, materials;
  const auto* const known = std::ranges::find(ignored_extensions, extension, &Ignored::extension);
  if (known != ignored_extensions.end()) result.append(": ").append(known->difference);
  std::size_t count = 0;
  for (const tinygltf::Material& material : model.materials) {
    if (!material.extensions.contains(extension) || ++count > most_named) continue;
    materials += (count > 1 ? ", \"" : "\"") + set::printable(material.name) + '"';
  }
  if (count > most_named) materials += " and " + std::to_string(count - most_named) + " more";
  return count > 0 ? result + " (materials: " + materials + ")" : result;
}

void check_extensions(const tinygltf::Model& model, const std::string& file, Notes& notes) {
  const auto is_known = [](const std::string& name) {
    return std::find(known_extensions.begin(), known_extensions.end(), name) !=
           known_extensions.end();
  };
  for (const std::string& name : model.extensionsRequired)
    if (!is_known(name))
      throw Error(file + ": requires the extension \"" + set::printable(name) +
                  "\", which is not supported" + remedy_for(name));
  for (const std::string& name : model.extensionsUsed)
    if (!is_known(name))
      notes.add("the extension \"" + set::printable(name) + "\" is not supported; ignored" +
                difference_without(name, model));
}

}  // namespace

tinygltf::Model read_gltf(const fs::path& path, Notes& notes) {
  const std::string file = path.string();
  std::vector<unsigned char> bytes;
  if (const std::string wrong = read_file(path, bytes); !wrong.empty())
    throw Error(file + ": cannot be opened: " + wrong);

  const bool is_binary = bytes.size() >= 4 && std::memcmp(bytes.data(), "glTF", 4) == 0;
  const std::string_view json =
      is_binary ? binary_json(bytes, file)
                : std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (nesting_depth(json) > max_json_depth)
    throw Error(file + ": its JSON is nested more than " + std::to_string(max_json_depth) +
                " levels deep");

  tinygltf::TinyGLTF reader;
  reader.SetFsCallbacks({file_exists, same_path, read_whole_file, write_nothing, nullptr});
  reader.SetImageLoader(keep_encoded, nullptr);
  tinygltf::Model model;
  std::string errors, warnings;
  bool read = false;
  const std::string directory = fs::absolute(path).parent_path().string();
  const auto size = static_cast<unsigned int>(bytes.size());
  try {
    read =
        is_binary
            ? reader.LoadBinaryFromMemory(&model, &errors, &warnings, bytes.data(), size, directory)
            : reader.LoadASCIIFromString(&model, &errors, &warnings, json.data(), size, directory);
  } catch (const std::exception& error) {
    errors += error.what();
  }
  if (!read) throw Error(file + ": is not a valid glTF file: " + one_line(errors));
  if (!model.asset.version.starts_with("2."))
    throw Error(file + ": is glTF " + set::printable(model.asset.version) +
                "; only version 2 is supported");
  if (!errors.empty()) notes.add(one_line(errors));
  if (!warnings.empty()) notes.add(one_line(warnings));
  check_extensions(model, file, notes);
  return model;
}

}  // namespace previz::scene
