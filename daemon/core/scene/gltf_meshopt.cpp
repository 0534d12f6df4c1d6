#include "daemon/core/scene/gltf_meshopt.hpp"

#include <meshoptimizer.h>

#include <algorithm>
#include <span>

#include "daemon/core/scene/gltf_accessor.hpp"
#include "daemon/core/scene/gltf_value.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

// The extension's object of a buffer view.
struct Encoded {
  std::string mode, filter;
  std::uint64_t count = 0, stride = 0;
  std::span<const unsigned char> bytes;
};

std::string text_of(const tinygltf::Value& object, const char* key) {
  return object.Has(key) && object.Get(key).IsString() ? object.Get(key).Get<std::string>() : "";
}

std::uint64_t whole_of(const tinygltf::Value& object, const char* key) {
  return static_cast<std::uint64_t>(std::clamp(number(object, key, 0), 0.0, 9e15));
}

Encoded encoded_of(const tinygltf::Model& model, const tinygltf::Value& given,
                   const std::string& where) {
  Encoded encoded{text_of(given, "mode"),
                  text_of(given, "filter"),
                  whole_of(given, "count"),
                  whole_of(given, "byteStride"),
                  {}};
  if (encoded.filter.empty()) encoded.filter = "NONE";
  const double buffer = number(given, "buffer", -1);
  if (buffer < 0 || buffer >= static_cast<double>(model.buffers.size()))
    throw Error(where + ": no such buffer");
  const auto& data = model.buffers[static_cast<std::size_t>(buffer)].data;
  const std::uint64_t offset = whole_of(given, "byteOffset"), size = whole_of(given, "byteLength");
  if (offset > data.size() || size > data.size() - offset)
    throw Error(where + ": reaches outside its buffer of " + std::to_string(data.size()) +
                " bytes");
  encoded.bytes = std::span(data).subspan(offset, size);
  return encoded;
}

// The codecs keep at least these bytes: 2 bits for 16 bytes that do not change, one byte for a
// triangle and one for an index.
bool is_possible(const Encoded& encoded) {
  const std::uint64_t size = encoded.bytes.size();
  if (encoded.mode == "ATTRIBUTES") return encoded.count <= 64 * size / encoded.stride;
  return encoded.count <= (encoded.mode == "TRIANGLES" ? 3 * size : size);
}

void check(const Encoded& encoded, const std::string& where) {
  const std::uint64_t stride = encoded.stride;
  const bool is_vertices = encoded.mode == "ATTRIBUTES";
  if (!is_vertices && encoded.mode != "TRIANGLES" && encoded.mode != "INDICES")
    throw Error(where + ": its mode \"" + set::one_line(encoded.mode) +
                "\" is not ATTRIBUTES, TRIANGLES or INDICES");
  const bool fits =
      is_vertices ? stride > 0 && stride <= 256 && stride % 4 == 0 : stride == 2 || stride == 4;
  if (!fits || (encoded.mode == "TRIANGLES" && encoded.count % 3 != 0))
    throw Error(where + ": a stride of " + std::to_string(stride) + " bytes and a count of " +
                std::to_string(encoded.count) + " are not possible in mode " + encoded.mode);
  const bool is_filter_sound =
      encoded.filter == "NONE" ||
      (is_vertices &&
       ((encoded.filter == "OCTAHEDRAL" && (stride == 4 || stride == 8)) ||
        (encoded.filter == "QUATERNION" && stride == 8) || encoded.filter == "EXPONENTIAL"));
  if (!is_filter_sound)
    throw Error(where + ": its filter \"" + set::one_line(encoded.filter) +
                "\" is not supported with a stride of " + std::to_string(stride) +
                " bytes in mode " + encoded.mode +
                "; export the file with EXT_meshopt_compression, or without compression");
  if (!is_possible(encoded))
    throw Error(where + ": " + std::to_string(encoded.bytes.size()) + " bytes cannot hold its " +
                std::to_string(encoded.count) + " elements; the file is damaged");
}

// KHR_meshopt_compression has version 1 for vertices, which meshoptimizer decodes from 0.23 on.
constexpr unsigned int newest_vertex_codec = MESHOPTIMIZER_VERSION >= 230 ? 1 : 0;

// The first byte has the codec in its upper half and the codec's version in its lower half.
void check_version(const Encoded& encoded, const std::string& where) {
  const unsigned int codec = encoded.mode == "ATTRIBUTES"  ? 0xa0
                             : encoded.mode == "TRIANGLES" ? 0xe0
                                                           : 0xd0;
  const unsigned int newest = encoded.mode == "ATTRIBUTES" ? newest_vertex_codec : 1;
  const unsigned int head = encoded.bytes.empty() ? 0 : encoded.bytes[0];
  if ((head & 0xf0) != codec)
    throw Error(where + ": does not begin as compressed " + encoded.mode +
                " do; export the file again, or without compression");
  if ((head & 0x0f) > newest)
    throw Error(
        where + ": is compressed with version " + std::to_string(head & 0x0f) +
        " of the codec; up to " + std::to_string(newest) +
        " is supported; export the file with EXT_meshopt_compression (gltfpack -c), or without "
        "compression");
}

std::vector<unsigned char> decoded(const Encoded& encoded, const std::string& where) {
  std::vector<unsigned char> result(encoded.count * encoded.stride);
  const auto& bytes = encoded.bytes;
  const int error = encoded.count == 0 ? 0
                    : encoded.mode == "ATTRIBUTES"
                        ? meshopt_decodeVertexBuffer(result.data(), encoded.count, encoded.stride,
                                                     bytes.data(), bytes.size())
                    : encoded.mode == "TRIANGLES"
                        ? meshopt_decodeIndexBuffer(result.data(), encoded.count, encoded.stride,
                                                    bytes.data(), bytes.size())
                        : meshopt_decodeIndexSequence(result.data(), encoded.count, encoded.stride,
                                                      bytes.data(), bytes.size());
  if (error != 0)
    throw Error(where + ": its " + encoded.mode +
                " cannot be decoded; the file is damaged: export it again");
  if (encoded.filter == "OCTAHEDRAL")
    meshopt_decodeFilterOct(result.data(), encoded.count, encoded.stride);
  if (encoded.filter == "QUATERNION")
    meshopt_decodeFilterQuat(result.data(), encoded.count, encoded.stride);
  if (encoded.filter == "EXPONENTIAL")
    meshopt_decodeFilterExp(result.data(), encoded.count, encoded.stride);
  return result;
}

}  // namespace

void decode_meshopt(tinygltf::Model& model, const std::vector<bool>& is_empty,
                    const std::string& file, DecodingLimit& limit) {
  for (std::size_t i = 0; i < model.bufferViews.size(); ++i) {
    const auto buffer = static_cast<std::size_t>(model.bufferViews[i].buffer);
    if (buffer >= is_empty.size() || !is_empty[buffer]) continue;
    const std::string view = file + ": buffer view " + std::to_string(i);
    const auto* const name = std::ranges::find_if(meshopt_extensions, [&](const char* extension) {
      return model.bufferViews[i].extensions.contains(extension);
    });
    if (name == std::end(meshopt_extensions))
      throw Error(view + ": its buffer " + std::to_string(buffer) +
                  " has no data; it stands in for meshopt compression, which the view lacks");
    const std::string where = view + ", " + *name;
    const Encoded encoded =
        encoded_of(model, extension(model.bufferViews[i].extensions, *name), where);
    check(encoded, where);
    check_version(encoded, where);
    limit.add(encoded.bytes.size(), encoded.count * encoded.stride, where);
    std::vector<unsigned char> bytes = decoded(encoded, where);
    model.bufferViews[i].buffer = static_cast<int>(model.buffers.size());
    model.bufferViews[i].byteOffset = 0;
    model.bufferViews[i].byteLength = bytes.size();
    model.buffers.emplace_back().data = std::move(bytes);
  }
}

}  // namespace previz::scene
