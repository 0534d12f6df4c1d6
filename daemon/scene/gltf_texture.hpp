// Decodes glTF textures, PNG and JPEG images, to linear floats.
#pragma once

#include <tiny_gltf.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>

#include "daemon/scene/load_log.hpp"
#include "daemon/scene/scene.hpp"

namespace previz::scene {

// Holds the textures of one file, each decoded when first used.
class GltfTextures {
 public:
  GltfTextures(const tinygltf::Model& model, std::string file, Scene& scene, Notes& notes,
               Budget& budget)
      : model_(model), file_(std::move(file)), scene_(scene), notes_(notes), budget_(budget) {}

  // Returns an index in Scene::textures, or no_texture with a note where the texture has no PNG or
  // JPEG image. Throws previz::Error naming file and image if the image cannot be read.
  std::uint32_t use(int texture, Encoding encoding);

 private:
  using Key = std::tuple<int, Encoding, Wrap, Wrap, bool>;  // image and how it is read

  Texture decode(int image, Encoding encoding);

  const tinygltf::Model& model_;
  std::string file_;
  Scene& scene_;
  Notes& notes_;
  Budget& budget_;
  std::map<Key, std::uint32_t> used_;
};

}  // namespace previz::scene
