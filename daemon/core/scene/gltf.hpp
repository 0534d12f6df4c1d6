// Reads one glTF 2.0 file once and puts it into the scene for every object that names it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/mat4x4.hpp>
#include <memory>

#include "daemon/core/scene/load_log.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::scene {

// glTF is Y up: (x, y, z) of the file is (x, -z, y) of the world.
inline constexpr glm::dmat4 z_up_from_y_up{1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1};

class GltfFile {
 public:
  // Meshes, materials, textures, instances and lights go into `scene`, each once, when first
  // needed. Throws previz::Error naming the file if the file cannot be read.
  GltfFile(const std::filesystem::path& file, Scene& scene, Budget& budget);
  ~GltfFile();

  // Puts the nodes that the object asks for, and their descendants, into the scene as instances and
  // lights of set object `index`. Throws previz::Error where the object asks for a node that the
  // file's scene lacks (naming the most similar name that it has) or for a variant that it lacks
  // (naming those that it has), where the nodes are no tree, and where accessors, indices or images
  // are out of range.
  void add(const set::Object& object, std::uint32_t index);

  // Decodes the textures of what was added, and notes what the whole file is about; call this once
  // every file of the scene is added.
  void finish();

  // Returns what was left out or not understood so far, ready to print.
  std::vector<std::string> notes() const;

 private:
  struct Loader;
  std::unique_ptr<Loader> loader_;
};

}  // namespace previz::scene
