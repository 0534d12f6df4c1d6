// Reads the numbers of a glTF accessor: every component type, normalised integers, strides and
// sparse accessors (glTF 2.0, 3.6.2; KHR_mesh_quantization). Everything is checked against the
// buffers and against what its `use` allows before it is read; `where` begins the message of the
// previz::Error thrown.
#pragma once

#include <tiny_gltf.h>

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/scene/gltf_components.hpp"

namespace previz::scene {

std::vector<glm::vec2> read_vec2s(const tinygltf::Model& model, int accessor,
                                  const std::string& where, Components use = Components::floats);
std::vector<glm::vec3> read_vec3s(const tinygltf::Model& model, int accessor,
                                  const std::string& where, Components use = Components::floats);
std::vector<glm::vec4> read_vec4s(const tinygltf::Model& model, int accessor,
                                  const std::string& where, Components use = Components::floats);
// Reads the colours of vertices; those without alpha have 1.
std::vector<glm::vec4> read_colors(const tinygltf::Model& model, int accessor,
                                   const std::string& where);
std::vector<glm::dmat4> read_mat4s(const tinygltf::Model& model, int accessor,
                                   const std::string& where);
std::vector<float> read_scalars(const tinygltf::Model& model, int accessor,
                                const std::string& where, Components use = Components::floats);
std::vector<std::uint32_t> read_indices(const tinygltf::Model& model, int accessor,
                                        const std::string& where);

// Returns the number of elements, without reading them.
std::uint64_t element_count(const tinygltf::Model& model, int accessor, const std::string& where);

std::span<const unsigned char> view_bytes(const tinygltf::Model& model, int buffer_view,
                                          const std::string& where);

}  // namespace previz::scene
