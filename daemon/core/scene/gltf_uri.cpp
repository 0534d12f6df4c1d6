#include "daemon/core/scene/gltf_uri.hpp"

#include <algorithm>
#include <cstddef>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "daemon/core/session/files.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"
#include "drivers/letters.hpp"

namespace previz::scene {
namespace {

using Json = nlohmann::json;

constexpr std::string_view plain_data = "data:application/octet-stream;base64,";

bool is_space(char c) {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

// Returns the text of a member "uri" of an element of an array; null where there is none.
Json* uri_of(Json& element) {
  if (!element.is_object()) return nullptr;
  const auto uri = element.find("uri");
  return uri != element.end() && uri->is_string() && !uri->get_ref<const std::string&>().empty()
             ? &*uri
             : nullptr;
}

Json* array_of(GltfJson& json, const char* key) {
  const auto array = json.root.find(key);
  return array != json.root.end() && array->is_array() ? &*array : nullptr;
}

// Returns whether tinygltf decodes the URI as it is.
bool is_plain(std::string_view uri) {
  if (!uri.starts_with(plain_data)) return false;
  std::string_view code = uri.substr(plain_data.size());
  if (code.size() % 4 != 0) return false;
  for (int padding = 0; padding < 2 && code.ends_with('='); ++padding) code.remove_suffix(1);
  return std::ranges::all_of(code, [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '+' ||
           c == '/';
  });
}

// Returns a path as a URI that every reader decodes to the same bytes.
std::string escaped(const std::string& path) {
  constexpr std::string_view hex = "0123456789ABCDEF";
  std::string uri;
  for (const char c : path) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '%' || c == '+' || code <= ' ') {
      uri += '%';
      uri += hex[code >> 4u];
      uri += hex[code & 15u];
    } else {
      uri += c;
    }
  }
  return uri;
}

}  // namespace

bool is_data_uri(const std::string& uri) {
  constexpr std::string_view scheme = "data:";
  return uri.size() >= scheme.size() &&
         std::ranges::equal(scheme, std::string_view(uri).substr(0, scheme.size()), {}, {},
                            [](char c) { return lower_case(c); });
}

std::vector<unsigned char> data_of(const std::string& uri, const std::string& where) {
  const std::size_t comma = uri.find(',');
  if (comma == std::string::npos)
    throw Error(where + ": its data URI has no comma before its data; export the file again");
  std::string type = uri.substr(0, comma), data = uri.substr(comma + 1);
  std::erase_if(type, is_space);
  if (data.find('%') != std::string::npos) data = without_escapes(data);
  // The last parameter by the standard; some programs write a charset after it.
  if ((lower_case(type) + ';').find(";base64;") == std::string::npos)
    return {data.begin(), data.end()};
  std::erase_if(data, is_space);
  std::ranges::replace(data, '-', '+');  // the alphabet for URLs (RFC 4648, 5)
  std::ranges::replace(data, '_', '/');
  while (data.size() % 4 != 0 && !data.ends_with("==")) data += '=';
  try {
    const std::string bytes = session::from_base64(data);
    return {bytes.begin(), bytes.end()};
  } catch (const std::invalid_argument&) {
    throw Error(where + ": its data URI is not valid base64; export the file again");
  }
}

void mend_buffer_uris(GltfJson& json, const std::filesystem::path& file, NameRules rules,
                      Notes& notes) {
  Json* const buffers = array_of(json, "buffers");
  for (std::size_t i = 0; buffers && i < buffers->size(); ++i) {
    Json* const member = uri_of((*buffers)[i]);
    if (!member) continue;
    const auto& uri = member->get_ref<const std::string&>();
    std::string mended = uri;
    if (is_data_uri(uri)) {
      if (is_plain(uri)) continue;
      const auto bytes = data_of(uri, file.string() + ": buffer " + std::to_string(i));
      mended = plain_data;
      mended += session::base64(std::as_bytes(std::span(bytes)));
    } else {
      const auto found = find_named_file(file, uri, rules);
      if (!found)
        throw Error(file.string() + ": " + numbered("buffer", i, uri) +
                    ": not found; put it beside the file");
      if (const std::string note = note_of_other_name(*found, "buffer", uri); !note.empty())
        notes.add(note);
      const std::string name = found->path.lexically_relative(file.parent_path()).string();
      mended = escaped(name.empty() ? found->path.string() : name);
    }
    if (mended == uri) continue;
    *member = std::move(mended);
    json.is_changed = true;
  }
}

std::vector<std::string> take_out_image_uris(GltfJson& json) {
  std::vector<std::string> uris;
  Json* const images = array_of(json, "images");
  if (!images) return uris;
  for (Json& image : *images) {
    uris.emplace_back();
    Json* const member = uri_of(image);
    if (!member) continue;
    uris.back() = std::move(member->get_ref<std::string&>());
    *member = "data:image/png;base64,AA==";
    json.is_changed = true;
  }
  return uris;
}

void put_back(std::vector<std::string> image_uris, tinygltf::Model& model) {
  for (std::size_t i = 0; i < std::min(image_uris.size(), model.images.size()); ++i)
    model.images[i].uri = std::move(image_uris[i]);
}

}  // namespace previz::scene
