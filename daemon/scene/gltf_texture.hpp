// Decodes glTF textures, PNG and JPEG images, to linear floats.
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "daemon/scene/load_log.hpp"
#include "daemon/scene/named_file.hpp"
#include "daemon/scene/picture_bytes.hpp"
#include "daemon/scene/scene.hpp"

namespace previz::scene {

// A picture of a model as it is stored, PNG or JPEG.
struct EncodedImage {
  std::vector<unsigned char> bytes;  // at least one
  std::string name;                  // the image's, or its file's; "" where it has none
  std::string where;  // FILE: image 3 "NAME", as checked_picture_size() and others take it
  std::string note;   // of a picture that is read from a file of another name; "" mostly
};

// Returns the picture of an image of a model that read_gltf() has read from `file`, be it in a
// buffer view, in a data URI or in a file that the rules let it name. Throws previz::Error naming
// file and image if it cannot be read.
EncodedImage encoded_image(const tinygltf::Model& model, int image, const std::string& file,
                           NameRules rules);

// Holds the textures of one file. What is used is known by its size first, and decoded at last.
class GltfTextures {
 public:
  GltfTextures(const tinygltf::Model& model, std::string file, Scene& scene, Notes& notes,
               Budget& budget)
      : model_(model), file_(std::move(file)), scene_(scene), notes_(notes), budget_(budget) {}

  // Returns an index in Scene::textures, or no_texture with a note where the texture has no PNG or
  // JPEG image. Throws previz::Error naming file and image if the image cannot be read.
  std::uint32_t use(int texture, Encoding encoding);

  // Decodes what was used since the last call, smaller where the budget has no place for all of it,
  // with a note. All files of the scene have added theirs to the budget before. Throws
  // previz::Error naming file and image.
  void decode();

 private:
  using Key = std::tuple<int, Encoding, Wrap, Wrap, bool>;  // image and how it is read

  struct Pending {
    std::size_t texture, in_budget;
    EncodedImage image;
    PictureSize size;
    Encoding encoding;
  };

  const tinygltf::Model& model_;
  std::string file_;
  Scene& scene_;
  Notes& notes_;
  Budget& budget_;
  std::vector<Pending> pending_;
  std::map<Key, std::uint32_t> used_;
};

}  // namespace previz::scene
