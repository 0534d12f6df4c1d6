#include "daemon/core/scene/gltf_variants.hpp"

#include <algorithm>
#include <utility>

#include "daemon/core/scene/gltf_value.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

constexpr const char* variants_extension = "KHR_materials_variants";
constexpr std::size_t most_variants = 1000;

// Returns the element of an array, or an empty value if it is no array or shorter.
tinygltf::Value element(const tinygltf::Value& object, const std::string& key, std::size_t index) {
  const tinygltf::Value& array = object.Get(key);
  return index < array.ArrayLen() ? array.Get(static_cast<int>(index)) : tinygltf::Value();
}

std::size_t elements(const tinygltf::Value& object, const std::string& key) {
  return object.Has(key) ? object.Get(key).ArrayLen() : 0;
}

}  // namespace

GltfVariants::GltfVariants(const tinygltf::Model& model, std::string file, Notes& notes)
    : file_(std::move(file)), notes_(notes) {
  const tinygltf::Value given = extension(model.extensions, variants_extension);
  const std::size_t count = elements(given, "variants");
  if (count > most_variants)
    throw Error(file_ + ": has " + std::to_string(count) + " variants; at most " +
                std::to_string(most_variants) + " are supported");
  for (std::size_t i = 0; i < count; ++i) {
    const tinygltf::Value variant = element(given, "variants", i);
    std::string name;
    if (variant.IsObject() && variant.Has("name") && variant.Get("name").IsString())
      name = variant.Get("name").Get<std::string>();
    const auto is_taken = [&] { return name.empty() || std::ranges::count(names_, name) > 0; };
    if (is_taken()) {
      for (std::size_t number = i + 1; is_taken(); ++number)
        name = "variant " + std::to_string(number);
      notes.add("variant " + std::to_string(i) + " has no unique name; called \"" +
                set::one_line(name) + "\"");
    }
    names_.push_back(name);
  }
}

std::size_t GltfVariants::look_of(const std::string& name) const {
  if (name.empty()) return 0;
  const auto found = std::ranges::find(names_, name);
  if (found != names_.end()) return 1 + static_cast<std::size_t>(found - names_.begin());
  std::string known;
  for (const std::string& other : names_)
    known += (known.empty() ? "it has \"" : ", \"") + set::one_line(other) + '"';
  throw Error(file_ + ": no variant \"" + set::one_line(name) + "\"; " +
              (known.empty() ? "it has none" : known));
}

std::vector<int> GltfVariants::materials(const tinygltf::Primitive& primitive,
                                         const std::string& what) const {
  std::vector<int> materials(1 + names_.size(), primitive.material);
  std::vector<bool> is_mapped(names_.size());
  const tinygltf::Value given = extension(primitive.extensions, variants_extension);
  for (std::size_t i = 0; i < elements(given, "mappings"); ++i) {
    const tinygltf::Value mapping = element(given, "mappings", i);
    const double material = number(mapping, "material", -1);
    for (std::size_t j = 0; j < elements(mapping, "variants"); ++j) {
      const tinygltf::Value variant = element(mapping, "variants", j);
      const double index = variant.IsNumber() ? variant.GetNumberAsDouble() : -1;
      if (!(index >= 0 && index < static_cast<double>(names_.size())) ||
          !(material >= 0 && material < 1e9))
        throw Error(file_ + ": " + what + ": refers to a missing variant or material");
      const auto at = static_cast<std::size_t>(index);
      if (is_mapped[at])
        notes_.add(what + ": has several materials in one variant; the first is used");
      else
        materials[1 + at] = static_cast<int>(material);
      is_mapped[at] = true;
    }
  }
  const bool varies = std::ranges::any_of(materials, [&](int m) { return m != materials[0]; });
  if (!varies) materials.resize(1);
  return materials;
}

}  // namespace previz::scene
