// Decodes glTF textures, PNG, JPEG and WebP images, to linear floats.
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "daemon/core/scene/load_log.hpp"
#include "daemon/core/scene/named_file.hpp"
#include "daemon/core/scene/picture_bytes.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::scene {

// A picture of a model as it is stored.
struct EncodedImage {
  std::vector<unsigned char> bytes;  // at least one
  std::string name;                  // the image's, or its file's; "" where it has none
  std::string where;  // FILE: image 3 "NAME", as checked_picture_size() and others take it
  std::string note;   // of a picture that is read from a file of another name; "" mostly
};

// The image of a texture of a model: that of EXT_texture_webp, else its source, also where that of
// the extension cannot be read.
struct TextureImage {
  int image = -1;
  std::string missing;  // what cannot be had and why, "texture 3: ..."; "" mostly
};
// Throws previz::Error naming `file` if the texture or the image does not exist.
TextureImage image_of(const tinygltf::Model& model, int texture, const std::string& file,
                      NameRules rules = names_in_objects);

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

  // Returns an index in Scene::textures, or no_texture with a note where the texture has no image
  // that is read (image_of()). With a glossiness the texture's green is roughness: 1 - glossiness *
  // alpha. Where its alpha `cuts_out` its colours, they count by it when it is reduced. Throws
  // previz::Error naming file and image if the image cannot be read, or, where without the texture
  // the surface would be `white`, if there is none.
  std::uint32_t use(int texture, Encoding encoding, bool white = false,
                    std::optional<float> glossiness = {}, bool cuts_out = false);

  // Decodes what was used since the last call, smaller where the budget has no place for all of it,
  // with one note. All files of the scene have added theirs to the budget before. Throws
  // previz::Error naming file and image.
  void decode();

 private:
  // Image and how it is read.
  using Key = std::tuple<int, Encoding, Wrap, Wrap, bool, std::optional<float>>;

  struct Pending {
    std::size_t texture, in_budget;
    EncodedImage image;
    PictureSize size;
    Encoding encoding;
    std::optional<float> glossiness;
    bool cuts_out = false;
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
