#include "daemon/core/scene/gltf_read.hpp"

#include <algorithm>
#include <cstring>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/core/scene/gltf_components.hpp"
#include "daemon/core/scene/gltf_compression.hpp"
#include "daemon/core/scene/gltf_extensions.hpp"
#include "daemon/core/scene/gltf_json.hpp"
#include "daemon/core/scene/gltf_uri.hpp"
#include "daemon/core/scene/named_file.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/box/reading.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

namespace fs = std::filesystem;

// Joins the lines of a tinygltf message.
std::string joined(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos;)
    text.replace(at, 1, "; ");
  return set::one_line(text);
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
  const std::string wrong = read_regular_file(path, *bytes);
  if (!wrong.empty() && error) *error = wrong;
  return wrong.empty();
}
bool write_nothing(std::string*, const std::string&, const std::vector<unsigned char>&, void*) {
  return false;
}

// Later versions (2.9, Debian 13) also ask for the size of a file, and refuse all of these without
// it.
template <typename Reader, typename Files = tinygltf::FsCallbacks>
void read_by_own_functions(Reader& reader) {
  Files files{};
  files.FileExists = file_exists;
  files.ExpandFilePath = same_path;
  files.ReadWholeFile = read_whole_file;
  files.WriteWholeFile = write_nothing;
  if constexpr (requires { reader.SetMaxExternalFileSize(max_file_bytes); }) {
    files.GetFileSizeInBytes = [](std::size_t* size, std::string*, const std::string& path, void*) {
      std::error_code error;
      *size = fs::file_size(path, error);
      return !error;
    };
    reader.SetMaxExternalFileSize(max_file_bytes);
  }
  reader.SetFsCallbacks(files);
}

// Images are decoded later, by readers of our own (picture_bytes.hpp).
bool keep_encoded(tinygltf::Image* image, int, std::string*, std::string*, int, int,
                  const unsigned char*, int, void*) {
  image->as_is = true;
  return true;
}

std::uint32_t little_endian(const std::vector<unsigned char>& bytes, std::size_t at) {
  return bytes[at] | bytes[at + 1] << 8u | bytes[at + 2] << 16u |
         static_cast<std::uint32_t>(bytes[at + 3]) << 24u;
}

// Returns the JSON of a binary file of version 2; checks that every chunk lies within the file
// (glTF 2.0, 4.4).
std::string_view binary_json(const std::vector<unsigned char>& bytes, const std::string& file) {
  if (bytes.size() < 20) throw Error(file + ": a binary glTF file has at least 20 bytes");
  const std::uint32_t version = little_endian(bytes, 4);
  if (version != 2) refuse_version(std::to_string(version) + ".0", file);
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

// Returns a binary file with another JSON, and its other chunks as they are.
std::vector<unsigned char> with_json(const std::vector<unsigned char>& bytes, std::string json,
                                     const std::string& file) {
  const std::size_t end = std::min<std::size_t>(little_endian(bytes, 8), bytes.size());
  const std::size_t rest = std::min<std::size_t>(20ull + little_endian(bytes, 12), end);
  while (json.size() % 4 != 0) json.push_back(' ');
  const std::uint64_t size = 20 + json.size() + (end - rest);
  if (size > max_file_bytes) throw Error(file + ": is larger than 4 GiB");
  std::vector<unsigned char> result(bytes.begin(), bytes.begin() + 20);
  for (unsigned int i = 0; i < 4; ++i) {
    result[8 + i] = static_cast<unsigned char>(size >> 8 * i);
    result[12 + i] = static_cast<unsigned char>(json.size() >> 8 * i);
  }
  result.reserve(size);
  result.insert(result.end(), json.begin(), json.end());
  result.insert(result.end(), bytes.begin() + static_cast<std::ptrdiff_t>(rest),
                bytes.begin() + static_cast<std::ptrdiff_t>(end));
  return result;
}

}  // namespace

tinygltf::Model read_gltf(const fs::path& path, Notes& notes, NameRules rules) {
  const box::Reading reading(path);
  const std::string file = path.string();
  std::vector<unsigned char> bytes;
  if (const std::string wrong = read_regular_file(path, bytes); !wrong.empty())
    throw Error(file + ": cannot be opened: " + wrong);

  const bool is_binary = bytes.size() >= 4 && std::memcmp(bytes.data(), "glTF", 4) == 0;
  const std::string_view text =
      is_binary ? binary_json(bytes, file)
                : std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  GltfJson json = checked_json(text, file);
  for (const std::string& note : json.notes) notes.add(note);
  mend_buffer_uris(json, path, rules, notes);
  std::vector<std::string> image_uris = take_out_image_uris(json);
  const TakenOut taken_out = take_out_compression(json, is_binary);
  if (json.is_changed) {
    const std::string changed = json.root.dump();
    bytes = is_binary ? with_json(bytes, changed, file)
                      : std::vector<unsigned char>(changed.begin(), changed.end());
  }

  tinygltf::TinyGLTF reader;
  read_by_own_functions(reader);
  reader.SetImageLoader(keep_encoded, nullptr);
  tinygltf::Model model;
  std::string errors, warnings;
  bool read = false;
  const std::string directory = fs::absolute(path).parent_path().string();
  const auto size = static_cast<unsigned int>(bytes.size());
  try {
    read = is_binary ? reader.LoadBinaryFromMemory(&model, &errors, &warnings, bytes.data(), size,
                                                   directory)
                     : reader.LoadASCIIFromString(&model, &errors, &warnings,
                                                  reinterpret_cast<const char*>(bytes.data()), size,
                                                  directory);
  } catch (const std::exception& error) {
    errors += error.what();
  }
  if (!read) throw Error(file + ": is not a valid glTF file: " + joined(errors));
  put_back(std::move(image_uris), model);
  decompress(model, taken_out, file);
  if (!errors.empty()) notes.add(joined(errors));
  if (!warnings.empty()) notes.add(joined(warnings));
  note_extensions(model, notes);
  note_component_types(model, notes);
  return model;
}

}  // namespace previz::scene
