#include "daemon/core/scene/gltf_draco.hpp"

#include <draco/compression/decode.h>
#include <draco/compression/point_cloud/point_cloud_decoder.h>
#include <draco/core/varint_decoding.h>
#include <draco/metadata/metadata_decoder.h>

#include <cstring>
#include <memory>
#include <new>
#include <span>

#include "daemon/core/scene/gltf_accessor.hpp"
#include "daemon/core/scene/gltf_value.hpp"
#include "daemon/core/scene/load_log.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

constexpr const char* extension_name = "KHR_draco_mesh_compression";

// Encoders stay well below this. The library at its slowest keeps 523 triangles a byte of a flat
// grid of 1025 by 1025 vertices that lie on its steps, and 21 of one of 500 by 500 that do not.
constexpr std::uint64_t most_triangles_per_byte = 2000;

constexpr const char* remedy = "; export the file again, or without compression";

// Returns what the library says, without its full stop.
std::string in_words(const draco::Status& status) {
  std::string words = set::one_line(status.error_msg_string());
  if (words.ends_with('.')) words.pop_back();
  return words;
}

tinygltf::Accessor& accessor_of(tinygltf::Model& model, int index, const std::string& where) {
  if (index < 0 || static_cast<std::size_t>(index) >= model.accessors.size())
    throw Error(where + ": no accessor " + std::to_string(index));
  return model.accessors[static_cast<std::size_t>(index)];
}

draco::DecoderBuffer buffer_of(std::span<const unsigned char> bytes) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return buffer;
}

// Reads the number of triangles from the head of the data (Draco bitstream 2.2, 4 to 6), before the
// library makes room for them.
std::uint64_t triangles_of(std::span<const unsigned char> bytes, const std::string& where) {
  draco::DecoderBuffer buffer = buffer_of(bytes);
  draco::DracoHeader header;
  if (const draco::Status status = draco::PointCloudDecoder::DecodeHeader(&buffer, &header);
      !status.ok())
    throw Error(where + ": is not Draco data: " + in_words(status) + remedy);
  if (header.encoder_type != draco::TRIANGULAR_MESH)
    throw Error(where + ": its Draco data is not a triangle mesh" + remedy);
  if (header.version_major != 2 || header.version_minor != 2)
    throw Error(where + ": its Draco data is of version " + std::to_string(header.version_major) +
                "." + std::to_string(header.version_minor) + "; glTF has version 2.2" + remedy);
  buffer.set_bitstream_version(DRACO_BITSTREAM_VERSION(2, 2));
  draco::GeometryMetadata metadata;
  bool is_read = (header.flags & METADATA_FLAG_MASK) == 0 ||
                 draco::MetadataDecoder().DecodeGeometryMetadata(&buffer, &metadata);
  std::uint32_t vertices = 0, triangles = 0;
  if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING) {
    std::uint8_t traversal = 0;
    is_read = is_read && buffer.Decode(&traversal) && draco::DecodeVarint(&vertices, &buffer) &&
              draco::DecodeVarint(&triangles, &buffer);
  } else {
    is_read = is_read && draco::DecodeVarint(&triangles, &buffer) &&
              draco::DecodeVarint(&vertices, &buffer);
  }
  if (!is_read) throw Error(where + ": its Draco data is cut short" + remedy);
  if (vertices > 3ull * triangles)
    throw Error(where + ": its Draco data has vertices without triangles" + remedy);
  return triangles;
}

// Copies the values of every point, as the accessor's component type.
template <typename T>
bool copy_values(const draco::PointAttribute& attribute, std::size_t components,
                 std::vector<unsigned char>& bytes) {
  std::vector<T> value(components);
  const std::size_t size = components * sizeof(T), count = bytes.size() / size;
  for (std::size_t i = 0; i < count; ++i) {
    const auto point = draco::PointIndex(static_cast<std::uint32_t>(i));
    if (!attribute.ConvertValue<T>(attribute.mapped_index(point),
                                   static_cast<std::int8_t>(components), value.data()))
      return false;
    std::memcpy(bytes.data() + i * size, value.data(), size);
  }
  return true;
}

bool copy_values(const draco::PointAttribute& attribute, int component_type, std::size_t components,
                 std::vector<unsigned char>& bytes) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return copy_values<std::int8_t>(attribute, components, bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return copy_values<std::uint8_t>(attribute, components, bytes);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return copy_values<std::int16_t>(attribute, components, bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return copy_values<std::uint16_t>(attribute, components, bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return copy_values<std::uint32_t>(attribute, components, bytes);
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return copy_values<float>(attribute, components, bytes);
    default:
      return false;
  }
}

class DracoDecoder {
 public:
  DracoDecoder(tinygltf::Model& model, DecodingLimit& limit) : model_(model), limit_(limit) {}

  void decode(tinygltf::Primitive& primitive, const std::string& where) {
    const tinygltf::Value given = extension(primitive.extensions, extension_name);
    const tinygltf::Value attributes =
        given.Has("attributes") ? given.Get("attributes") : tinygltf::Value();
    if (!attributes.IsObject()) throw Error(where + ": lists no attributes" + remedy);
    if (!is_needed(primitive, attributes, where)) return;
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES && primitive.mode != -1)
      throw Error(where + ": only lists of triangles can be decompressed" + remedy);
    const auto bytes = view_bytes(model_, static_cast<int>(number(given, "bufferView", -1)), where);
    check_size(primitive, bytes, where);

    draco::DecoderBuffer buffer = buffer_of(bytes);
    auto decoded = draco::Decoder().DecodeMeshFromBuffer(&buffer);
    if (!decoded.ok())
      throw Error(where + ": cannot be decoded: " + in_words(decoded.status()) + remedy);
    const std::unique_ptr<draco::Mesh> mesh = std::move(decoded).value();
    for (const std::string& name : attributes.Keys())
      if (primitive.attributes.contains(name))
        take_attribute(*mesh, primitive.attributes[name], attributes.Get(name),
                       where + ", " + name);
    take_indices(*mesh, primitive, where);
  }

 private:
  // Returns whether an accessor lacks data. Those that have data are uncompressed, or were decoded
  // with another primitive.
  bool is_needed(const tinygltf::Primitive& primitive, const tinygltf::Value& attributes,
                 const std::string& where) {
    bool is_needed =
        primitive.indices < 0 || accessor_of(model_, primitive.indices, where).bufferView < 0;
    for (const std::string& name : attributes.Keys())
      if (const auto at = primitive.attributes.find(name); at != primitive.attributes.end())
        is_needed |= accessor_of(model_, at->second, where + ", " + name).bufferView < 0;
    return is_needed;
  }

  void check_size(const tinygltf::Primitive& primitive, std::span<const unsigned char> bytes,
                  const std::string& where) {
    const std::uint64_t triangles = triangles_of(bytes, where);
    if (primitive.indices >= 0) {
      const std::uint64_t indices = accessor_of(model_, primitive.indices, where).count;
      if (3 * triangles != indices)
        throw Error(where + ": has " + std::to_string(triangles) +
                    " compressed triangles where its indices are " + std::to_string(indices) +
                    remedy);
    }
    if (triangles > most_triangles_per_byte * bytes.size())
      throw Error(where + ": " + std::to_string(bytes.size()) + " bytes cannot hold " +
                  std::to_string(triangles) + " triangles; the file is damaged");
    budget_.add_triangles(triangles, where);
    limit_.add(bytes.size(), 3 * sizeof(std::uint32_t) * triangles, where);
  }

  void take_attribute(const draco::Mesh& mesh, int index, const tinygltf::Value& id,
                      const std::string& where) {
    tinygltf::Accessor& accessor = accessor_of(model_, index, where);
    if (accessor.bufferView >= 0) return;
    const draco::PointAttribute* const attribute =
        id.IsNumber() ? mesh.GetAttributeByUniqueId(static_cast<std::uint32_t>(id.GetNumberAsInt()))
                      : nullptr;
    if (!attribute) throw Error(where + ": its Draco data has no such attribute" + remedy);
    if (accessor.count != mesh.num_points())
      throw Error(where + ": has " + std::to_string(mesh.num_points()) +
                  " compressed vertices where its accessor has " + std::to_string(accessor.count) +
                  remedy);
    const int components =
        tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor.type));
    const int size =
        tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(accessor.componentType));
    if (components != attribute->num_components() || size <= 0)
      throw Error(where + ": has " + std::to_string(attribute->num_components()) +
                  " compressed components where its accessor has " + std::to_string(components) +
                  remedy);
    const std::uint64_t length = accessor.count * static_cast<std::uint64_t>(components * size);
    limit_.add(0, length, where);
    std::vector<unsigned char> bytes(length);
    if (!copy_values(*attribute, accessor.componentType, static_cast<std::size_t>(components),
                     bytes))
      throw Error(where + ": its compressed numbers do not fit its accessor's type" + remedy);
    accessor.bufferView = add_view(model_, std::move(bytes));
    accessor.byteOffset = 0;
  }

  void take_indices(const draco::Mesh& mesh, tinygltf::Primitive& primitive,
                    const std::string& where) {
    if (primitive.indices < 0) {
      primitive.indices = static_cast<int>(model_.accessors.size());
      tinygltf::Accessor& added = model_.accessors.emplace_back();
      added.type = TINYGLTF_TYPE_SCALAR;
      added.count = 3ull * mesh.num_faces();
    }
    tinygltf::Accessor& accessor = accessor_of(model_, primitive.indices, where);
    if (accessor.bufferView >= 0) return;
    std::vector<unsigned char> bytes;
    bytes.reserve(3 * sizeof(std::uint32_t) * mesh.num_faces());
    for (std::uint32_t i = 0; i < mesh.num_faces(); ++i)
      for (const draco::PointIndex& point : mesh.face(draco::FaceIndex(i))) {
        const std::uint32_t index = point.value();
        const auto* const begin = reinterpret_cast<const unsigned char*>(&index);
        bytes.insert(bytes.end(), begin, begin + sizeof index);
      }
    accessor.bufferView = add_view(model_, std::move(bytes));
    accessor.byteOffset = 0;
    accessor.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
  }

  tinygltf::Model& model_;
  DecodingLimit& limit_;
  Budget budget_;  // of this file alone; the scene counts what it takes of it
};

}  // namespace

void decode_draco(tinygltf::Model& model, const std::string& file, DecodingLimit& limit) {
  DracoDecoder decoder(model, limit);
  for (std::size_t mesh = 0; mesh < model.meshes.size(); ++mesh)
    for (std::size_t i = 0; i < model.meshes[mesh].primitives.size(); ++i) {
      tinygltf::Primitive& primitive = model.meshes[mesh].primitives[i];
      if (!primitive.extensions.contains(extension_name)) continue;
      const std::string where = file + ": mesh " + std::to_string(mesh) + ", primitive " +
                                std::to_string(i) + ", " + extension_name;
      try {
        decoder.decode(primitive, where);
      } catch (const std::bad_alloc&) {
        throw Error(where + ": its Draco data asks for more memory than there is" + remedy);
      }
    }
}

}  // namespace previz::scene
