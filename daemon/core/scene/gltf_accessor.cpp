#include "daemon/core/scene/gltf_accessor.hpp"

#include <algorithm>
#include <cstring>
#include <glm/ext/vector_float1.hpp>
#include <limits>

#include "drivers/error.hpp"

namespace previz::scene {
namespace {

// An accessor without data is all zeros (glTF 2.0, 3.6.2.3); nothing else bounds its count.
constexpr std::uint64_t max_zeros = 1u << 22;

std::size_t component_size(int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;
  }
}

template <typename T>
T load(const unsigned char* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

template <typename T>
float load_integer(const unsigned char* at, bool normalized) {
  const auto value = static_cast<double>(load<T>(at));
  if (!normalized) return static_cast<float>(value);
  return static_cast<float>(
      std::max(value / static_cast<double>(std::numeric_limits<T>::max()), -1.0));
}

float load_float(const unsigned char* at, int type, bool normalized) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return load_integer<std::int8_t>(at, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load_integer<std::uint8_t>(at, normalized);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return load_integer<std::int16_t>(at, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load_integer<std::uint16_t>(at, normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return load_integer<std::uint32_t>(at, normalized);
    default:
      return load<float>(at);
  }
}

std::uint32_t load_index(const unsigned char* at, int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return *at;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<std::uint16_t>(at);
    default:
      return load<std::uint32_t>(at);
  }
}

bool is_index_type(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

const tinygltf::Accessor& checked(const tinygltf::Model& model, int index,
                                  const std::string& where) {
  if (index < 0 || static_cast<std::size_t>(index) >= model.accessors.size())
    throw Error(where + ": no accessor " + std::to_string(index));
  return model.accessors[static_cast<std::size_t>(index)];
}

// Returns the part of a view that holds `count` elements of `size` bytes, `stride` apart.
const unsigned char* elements(std::span<const unsigned char> bytes, std::uint64_t offset,
                              std::uint64_t count, std::size_t size, std::size_t stride,
                              const std::string& where) {
  if (count > 0 && (offset > bytes.size() || bytes.size() - offset < size ||
                    (bytes.size() - offset - size) / stride < count - 1))
    throw Error(where + ": " + std::to_string(count) + " elements do not fit into a view of " +
                std::to_string(bytes.size()) + " bytes");
  return bytes.data() + (count > 0 ? offset : 0);
}

// Calls read(element, bytes) for every element that is not zero, sparse replacements last.
template <typename Read>
void read_elements(const tinygltf::Model& model, const tinygltf::Accessor& accessor,
                   std::size_t components, const std::string& where, const Read& read) {
  const std::size_t size = components * component_size(accessor.componentType);
  if (size == 0)
    throw Error(where + ": component type " + std::to_string(accessor.componentType) +
                " is not one of glTF's");
  if (accessor.bufferView >= 0) {
    const auto bytes = view_bytes(model, accessor.bufferView, where);
    const auto& view = model.bufferViews[static_cast<std::size_t>(accessor.bufferView)];
    const std::size_t stride = view.byteStride == 0 ? size : view.byteStride;
    if (stride < size)
      throw Error(where + ": a stride of " + std::to_string(stride) +
                  " bytes is less than an element");
    const unsigned char* at =
        elements(bytes, accessor.byteOffset, accessor.count, size, stride, where);
    for (std::size_t i = 0; i < accessor.count; ++i) read(i, at + i * stride);
  }
  if (!accessor.sparse.isSparse) return;

  const auto& sparse = accessor.sparse;
  if (sparse.count < 0 || static_cast<std::size_t>(sparse.count) > accessor.count ||
      sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0 ||
      !is_index_type(sparse.indices.componentType))
    throw Error(where + ": its sparse part has a bad count, offset or index type");
  const auto count = static_cast<std::size_t>(sparse.count);
  const std::size_t index_size = component_size(sparse.indices.componentType);
  const unsigned char* indices =
      elements(view_bytes(model, sparse.indices.bufferView, where),
               static_cast<std::uint64_t>(sparse.indices.byteOffset), count, index_size, index_size,
               where + ", sparse indices");
  const unsigned char* values = elements(view_bytes(model, sparse.values.bufferView, where),
                                         static_cast<std::uint64_t>(sparse.values.byteOffset),
                                         count, size, size, where + ", sparse values");
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t element =
        load_index(indices + i * index_size, sparse.indices.componentType);
    if (element >= accessor.count)
      throw Error(where + ": sparse index " + std::to_string(element) + " is outside its " +
                  std::to_string(accessor.count) + " elements");
    read(element, values + i * size);
  }
}

template <typename Vector>
std::vector<Vector> read_vectors(const tinygltf::Model& model, int index, int type,
                                 const std::string& where, Components use) {
  const tinygltf::Accessor& accessor = checked(model, index, where);
  if (accessor.type != type)
    throw Error(where + ": must have " + std::to_string(Vector::length()) +
                " components an element");
  check_components(accessor, use, where);
  std::vector<Vector> values(element_count(model, index, where), Vector(0));
  const std::size_t size = component_size(accessor.componentType);
  const bool normalized = are_normalized(accessor, use);
  read_elements(model, accessor, Vector::length(), where,
                [&](std::size_t element, const unsigned char* at) {
                  for (int i = 0; i < Vector::length(); ++i)
                    values[element][i] = load_float(at + static_cast<std::size_t>(i) * size,
                                                    accessor.componentType, normalized);
                });
  return values;
}

}  // namespace

std::vector<glm::vec2> read_vec2s(const tinygltf::Model& model, int accessor,
                                  const std::string& where, Components use) {
  return read_vectors<glm::vec2>(model, accessor, TINYGLTF_TYPE_VEC2, where, use);
}

std::vector<glm::vec3> read_vec3s(const tinygltf::Model& model, int accessor,
                                  const std::string& where, Components use) {
  return read_vectors<glm::vec3>(model, accessor, TINYGLTF_TYPE_VEC3, where, use);
}

std::vector<glm::vec4> read_vec4s(const tinygltf::Model& model, int accessor,
                                  const std::string& where, Components use) {
  return read_vectors<glm::vec4>(model, accessor, TINYGLTF_TYPE_VEC4, where, use);
}

std::vector<glm::vec4> read_colors(const tinygltf::Model& model, int accessor,
                                   const std::string& where) {
  if (checked(model, accessor, where).type == TINYGLTF_TYPE_VEC4)
    return read_vec4s(model, accessor, where, Components::colors);
  std::vector<glm::vec4> colors;
  for (const glm::vec3& color : read_vec3s(model, accessor, where, Components::colors))
    colors.emplace_back(color, 1);
  return colors;
}

// Matrices of floats have no padding between their columns (glTF 2.0, 3.6.2.4).
std::vector<glm::dmat4> read_mat4s(const tinygltf::Model& model, int index,
                                   const std::string& where) {
  const tinygltf::Accessor& accessor = checked(model, index, where);
  if (accessor.type != TINYGLTF_TYPE_MAT4 ||
      accessor.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT)
    throw Error(where + ": must have 4 by 4 floats an element");
  std::vector<glm::dmat4> values(element_count(model, index, where), glm::dmat4(0));
  read_elements(model, accessor, 16, where, [&](std::size_t element, const unsigned char* at) {
    for (int i = 0; i < 16; ++i)
      values[element][i / 4][i % 4] =
          static_cast<double>(load<float>(at + static_cast<std::size_t>(i) * sizeof(float)));
  });
  return values;
}

std::vector<float> read_scalars(const tinygltf::Model& model, int accessor,
                                const std::string& where, Components use) {
  std::vector<float> values;
  for (const glm::vec1& value :
       read_vectors<glm::vec1>(model, accessor, TINYGLTF_TYPE_SCALAR, where, use))
    values.push_back(value.x);
  return values;
}

std::vector<std::uint32_t> read_indices(const tinygltf::Model& model, int index,
                                        const std::string& where) {
  const tinygltf::Accessor& accessor = checked(model, index, where);
  if (accessor.type != TINYGLTF_TYPE_SCALAR || !is_index_type(accessor.componentType))
    throw Error(where + ": indices must be unsigned scalars of 1, 2 or 4 bytes");
  std::vector<std::uint32_t> values(element_count(model, index, where), 0);
  read_elements(model, accessor, 1, where, [&](std::size_t element, const unsigned char* at) {
    values[element] = load_index(at, accessor.componentType);
  });
  return values;
}

std::uint64_t element_count(const tinygltf::Model& model, int index, const std::string& where) {
  const tinygltf::Accessor& accessor = checked(model, index, where);
  const std::uint64_t limit =
      accessor.bufferView < 0 ? max_zeros : view_bytes(model, accessor.bufferView, where).size();
  if (accessor.count > limit)
    throw Error(where + ": " + std::to_string(accessor.count) +
                " elements are more than its data can hold");
  return accessor.count;
}

std::span<const unsigned char> view_bytes(const tinygltf::Model& model, int index,
                                          const std::string& where) {
  if (index < 0 || static_cast<std::size_t>(index) >= model.bufferViews.size())
    throw Error(where + ": no buffer view " + std::to_string(index));
  const tinygltf::BufferView& view = model.bufferViews[static_cast<std::size_t>(index)];
  if (view.buffer < 0 || static_cast<std::size_t>(view.buffer) >= model.buffers.size())
    throw Error(where + ": no buffer " + std::to_string(view.buffer));
  const auto& data = model.buffers[static_cast<std::size_t>(view.buffer)].data;
  if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset)
    throw Error(where + ": buffer view " + std::to_string(index) +
                " reaches outside its buffer of " + std::to_string(data.size()) + " bytes");
  return std::span(data).subspan(view.byteOffset, view.byteLength);
}

}  // namespace previz::scene
