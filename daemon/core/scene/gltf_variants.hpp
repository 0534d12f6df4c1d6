// Reads the variants of a file's materials by their names (KHR_materials_variants).
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <string>
#include <vector>

#include "daemon/core/scene/load_log.hpp"

namespace previz::scene {

class GltfVariants {
 public:
  // Variants without a name, or with that of an earlier one, are noted and named by their number.
  GltfVariants(const tinygltf::Model& model, std::string file, Notes& notes);

  const std::vector<std::string>& names() const { return names_; }
  // Returns the place of a name among the names, plus 1; 0 for "", which means no variant. Throws
  // previz::Error naming the file, and the names that it has, if there is no such variant.
  std::size_t look_of(const std::string& name) const;

  // Returns the materials that the primitive has without a variant and in each variant; a single
  // one if no variant changes it. Throws previz::Error for a variant that is not there. `what`
  // names the primitive.
  std::vector<int> materials(const tinygltf::Primitive& primitive, const std::string& what) const;

 private:
  std::string file_;
  Notes& notes_;
  std::vector<std::string> names_;
};

}  // namespace previz::scene
