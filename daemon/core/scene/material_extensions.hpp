// This table says what previzd knows of each glTF extension of materials: what it reads and in
// which range, where that goes in Material and gpu::GpuMaterial, and which feature of the renderer
// draws it. The reader, the notes about extensions, the renderer's features and the upload of
// materials all use it. A layer whose numbers and images are like those of the others needs a row
// here, its members in scene.hpp, its constants in shaders/lib/material_shared.h, and shaders that
// draw it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <iterator>
#include <limits>
#include <optional>
#include <span>
#include <variant>

#include "daemon/core/scene/scene.hpp"
#include "shaders/lib/material_shared.h"

namespace previz::scene {

// A member of Material, and the member of gpu::GpuMaterial that gets its value; null where the
// renderer packs it in another way (daemon/core/render/world/gpu_scene.cpp), or not at all.
template <typename T>
struct Packed {
  T Material::*member = nullptr;
  T gpu::GpuMaterial::*packed = nullptr;
};
template <typename T>
Packed(T Material::*) -> Packed<T>;
template <typename T>
Packed(T Material::*, T gpu::GpuMaterial::*) -> Packed<T>;

// A number of an extension, or a linear colour. Without it Material's own default counts, which is
// the one that Khronos states. What is outside the range, in any channel, is brought into it with a
// note.
struct Factor {
  const char* key = nullptr;  // in the extension's JSON
  std::variant<Packed<float>, Packed<glm::vec3>> value;
  double least = 0;  // a colour's is always 0
  double most = 1;
  // What the renderer can draw; less is raised to it, with a note where the layer is there.
  float supported = std::numeric_limits<float>::lowest();
};

// A texture of an extension. It multiplies a factor by the channels that PREVIZ_LAYER_TEXTURES in
// shaders/lib/material_shared.h states.
struct LayerTexture {
  const char* key = nullptr;
  std::uint32_t Material::*texture = nullptr;  // one of material_textures
  Encoding encoding = Encoding::linear;
  // The scale of a normal texture. Without such a texture the layer is smooth, so that it stays
  // where the image cannot be read. Null: without the image there is no such layer.
  float Material::*scale = nullptr;
};

// A feature of the renderer that draws an extension: see render::Feature.
struct MaterialFeature {
  const char* name;
  std::uint32_t bit;  // FEATURE_*
  bool (*is_asked_for)(const Material&);
  const char* used;
};

// Up to so many entries, of which those without a key are unused.
template <typename Entry, std::size_t most>
struct Few {
  Entry entries[most]{};
  constexpr const Entry* begin() const { return std::begin(entries); }
  constexpr const Entry* end() const {
    return std::find_if(std::begin(entries), std::end(entries),
                        [](const Entry& entry) { return entry.key == nullptr; });
  }
};

// Returns a number of the extension by its key, or `otherwise` where there is none.
using GivenNumber = std::function<double(const char* key, double otherwise)>;

struct MaterialExtension {
  const char* name;
  // Where it is not read: what is different in the picture, in plain words.
  const char* ignored = nullptr;
  Few<Factor, 3> factors{};
  Few<LayerTexture, 3> textures{};
  // Returns whether the factors give the material such a layer at all; its textures are read only
  // then. Null: they always are.
  bool (*is_there)(const Material&) = nullptr;
  // Reads what is neither a factor nor a texture, after these. Returns a note about the material,
  // or null.
  const char* (*finish)(const GivenNumber& number, Material& material) = nullptr;
  std::optional<MaterialFeature> feature{};
};

// The rows, in the order in which they are read.
std::span<const MaterialExtension> material_extensions();

// What draws any of the rows' textures.
const MaterialFeature& layer_texture_feature();

}  // namespace previz::scene
