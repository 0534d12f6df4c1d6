// Reads numbers from the free-form JSON of glTF's extensions.
#pragma once

#include <tiny_gltf.h>

#include <algorithm>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "daemon/core/scene/load_log.hpp"

namespace previz::scene {

// Returns the extension's object, or an empty one if the extension is absent.
inline tinygltf::Value extension(const tinygltf::ExtensionMap& extensions,
                                 const std::string& name) {
  const auto at = extensions.find(name);
  return at != extensions.end() && at->second.IsObject()
             ? at->second
             : tinygltf::Value(tinygltf::Value::Object{});
}

inline double number(const tinygltf::Value& object, const std::string& key, double otherwise) {
  return object.Has(key) && object.Get(key).IsNumber() ? object.Get(key).GetNumberAsDouble()
                                                       : otherwise;
}

// Returns the first numbers of an array, or `otherwise` if the array is absent, shorter, or not of
// numbers.
inline std::vector<double> numbers(const tinygltf::Value& object, const std::string& key,
                                   std::vector<double> otherwise) {
  if (!object.Has(key) || object.Get(key).ArrayLen() < otherwise.size()) return otherwise;
  std::vector<double> values;
  for (std::size_t i = 0; i < otherwise.size(); ++i) {
    const tinygltf::Value& value = object.Get(key).Get(static_cast<int>(i));
    if (!value.IsNumber()) return otherwise;
    values.push_back(value.GetNumberAsDouble());
  }
  return values;
}

// Clamps `value` to the allowed range, with a note if that changes it.
inline float within(double value, double low, double high, const std::string& what, Notes& notes) {
  const double allowed = value >= low ? std::min(value, high) : low;
  if (allowed != value) notes.add(what + " is out of range; nearest allowed value used");
  return static_cast<float>(allowed);
}

inline glm::vec3 color_within(const std::vector<double>& rgb, double high, const std::string& what,
                              Notes& notes) {
  return {within(rgb[0], 0, high, what, notes), within(rgb[1], 0, high, what, notes),
          within(rgb[2], 0, high, what, notes)};
}

}  // namespace previz::scene
