#include "daemon/scene/gltf_texture.hpp"

#include <stb_image.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "daemon/scene/gltf_accessor.hpp"
#include "daemon/scene/gltf_uri.hpp"
#include "daemon/scene/picture_bytes.hpp"
#include "daemon/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

Wrap wrap(int gltf) {
  if (gltf == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::clamp;
  if (gltf == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return Wrap::mirror;
  return Wrap::repeat;
}

template <typename Sample>
std::vector<glm::vec4> linearise(const Sample* samples, std::size_t texels, Encoding encoding) {
  constexpr std::size_t values = std::size_t{std::numeric_limits<Sample>::max()} + 1;
  std::vector<float> color(values), data(values);
  for (std::size_t i = 0; i < values; ++i) {
    const double value = static_cast<double>(i) / static_cast<double>(values - 1);
    data[i] = static_cast<float>(value);
    color[i] = static_cast<float>(encoding == Encoding::srgb ? srgb_signal(value) : value);
  }
  std::vector<glm::vec4> linear(texels);
  for (std::size_t i = 0; i < texels; ++i, samples += 4)
    linear[i] = {color[samples[0]], color[samples[1]], color[samples[2]], data[samples[3]]};
  return linear;
}

}  // namespace

EncodedImage encoded_image(const tinygltf::Model& model, int index, const std::string& file,
                           NameRules rules) {
  if (index < 0 || static_cast<std::size_t>(index) >= model.images.size())
    throw Error(file + ": no image " + std::to_string(index));
  const tinygltf::Image& image = model.images[static_cast<std::size_t>(index)];
  const bool is_data = is_data_uri(image.uri);
  EncodedImage encoded;
  encoded.name = image.name.empty() && !is_data ? image.uri : image.name;
  encoded.where = file + ": " + numbered("image", static_cast<std::size_t>(index), encoded.name);
  if (image.bufferView >= 0) {
    const auto bytes = view_bytes(model, image.bufferView, encoded.where);
    encoded.bytes.assign(bytes.begin(), bytes.end());
  } else if (is_data) {
    encoded.bytes = data_of(image.uri, encoded.where);
  } else {
    const std::string its_file =
        image.name.empty() ? ": " : ": its file \"" + set::one_line(image.uri) + "\" is ";
    const auto found = find_named_file(file, image.uri, rules);
    if (!found) throw Error(encoded.where + its_file + "not found; put it beside the file");
    if (const std::string wrong = read_regular_file(found->path, encoded.bytes); !wrong.empty())
      throw Error(encoded.where + ": cannot be opened: " + wrong);
    encoded.note = note_of_other_name(*found, "texture", image.uri);
  }
  if (encoded.bytes.empty()) throw Error(encoded.where + ": is empty; export the file again");
  return encoded;
}

std::uint32_t GltfTextures::use(int index, Encoding encoding) {
  const std::string name = "texture " + std::to_string(index);
  if (index < 0 || static_cast<std::size_t>(index) >= model_.textures.size())
    throw Error(file_ + ": a material uses " + name + ", which does not exist");
  const tinygltf::Texture& texture = model_.textures[static_cast<std::size_t>(index)];
  if (texture.source < 0) {
    notes_.add(name + ": has no PNG or JPEG image; ignored");
    return no_texture;
  }
  if (static_cast<std::size_t>(texture.source) >= model_.images.size())
    throw Error(file_ + ": " + name + ": no image " + std::to_string(texture.source));
  tinygltf::Sampler sampler;
  if (texture.sampler >= 0) {
    if (static_cast<std::size_t>(texture.sampler) >= model_.samplers.size())
      throw Error(file_ + ": " + name + ": no sampler " + std::to_string(texture.sampler));
    sampler = model_.samplers[static_cast<std::size_t>(texture.sampler)];
  }

  const Wrap wrap_u = wrap(sampler.wrapS), wrap_v = wrap(sampler.wrapT);
  const bool nearest = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST;
  const auto [at, is_new] =
      used_.try_emplace({texture.source, encoding, wrap_u, wrap_v, nearest}, no_texture);
  if (!is_new) return at->second;
  Texture decoded = decode(texture.source, encoding);
  decoded.wrap_u = wrap_u;
  decoded.wrap_v = wrap_v;
  decoded.nearest = nearest;
  at->second = static_cast<std::uint32_t>(scene_.textures.size());
  scene_.textures.push_back(std::move(decoded));
  return at->second;
}

Texture GltfTextures::decode(int index, Encoding encoding) {
  const EncodedImage image = encoded_image(model_, index, file_, names_in_objects);
  const std::vector<unsigned char>& bytes = image.bytes;
  const std::string& where = image.where;
  if (!image.note.empty()) notes_.add(image.note);
  auto [width, height] = checked_picture_size(bytes, where);
  const std::size_t texels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  budget_.add_texture(width, height, where);

  Texture texture;
  texture.name = image.name.empty() ? "image " + std::to_string(index) : image.name;
  texture.width = width;
  texture.height = height;
  const int size = static_cast<int>(bytes.size());
  int channels = 0;
  const auto free = [](void* samples) { stbi_image_free(samples); };
  if (stbi_is_16_bit_from_memory(bytes.data(), size)) {
    const std::unique_ptr<stbi_us, decltype(free)> samples(
        stbi_load_16_from_memory(bytes.data(), size, &width, &height, &channels, 4), free);
    if (samples && width == texture.width && height == texture.height)
      texture.texels = linearise(samples.get(), texels, encoding);
  } else {
    const std::unique_ptr<stbi_uc, decltype(free)> samples(
        stbi_load_from_memory(bytes.data(), size, &width, &height, &channels, 4), free);
    if (samples && width == texture.width && height == texture.height)
      texture.texels = linearise(samples.get(), texels, encoding);
  }
  if (texture.texels.empty()) throw Error(where + ": cannot be decoded: " + picture_failure());
  return texture;
}

}  // namespace previz::scene
