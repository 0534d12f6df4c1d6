#include "daemon/scene/gltf_texture.hpp"

#include <stb_image.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "daemon/scene/gltf_accessor.hpp"
#include "daemon/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

// A file has at most this many texels per byte: Deflate packs at most 1032 bytes into one, and a
// PNG of one bit per pixel has 8 pixels in each of those bytes. JPEG is less dense.
constexpr std::uint64_t max_texels_a_byte = 8256;

Wrap wrap(int gltf) {
  if (gltf == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::clamp;
  if (gltf == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return Wrap::mirror;
  return Wrap::repeat;
}

constexpr unsigned char png_signature[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr unsigned char jpeg_signature[] = {0xff, 0xd8, 0xff};

bool begins_with(std::span<const unsigned char> bytes, std::span<const unsigned char> signature) {
  return bytes.size() > signature.size() &&
         std::memcmp(bytes.data(), signature.data(), signature.size()) == 0;
}

// stb_image asks for as much memory as a chunk's length says before it reads the chunk: up to 2 GiB
// for a file of a few bytes. Throws previz::Error unless the chunks of a PNG, up to IEND, are in
// its bytes.
void require_chunks(std::span<const unsigned char> png, const std::string& where) {
  std::size_t at = sizeof png_signature;
  for (;;) {
    constexpr std::size_t head = 8, checksum = 4;  // bytes; the head is a length and a name
    if (png.size() - at < head) throw Error(where + ": is cut short: it has no IEND chunk");
    const std::size_t length = std::size_t{png[at]} << 24 | std::size_t{png[at + 1]} << 16 |
                               std::size_t{png[at + 2]} << 8 | png[at + 3];
    const std::string name(png.begin() + static_cast<std::ptrdiff_t>(at + 4),
                           png.begin() + static_cast<std::ptrdiff_t>(at + head));
    if (name == "IEND") return;
    const std::size_t left = png.size() - at - head;
    if (left < checksum || length > left - checksum)
      throw Error(where + ": is cut short: its chunk " + set::printable(name) + " says " +
                  std::to_string(length) + " bytes, and " + std::to_string(left) + " are left");
    at += head + length + checksum;
  }
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

std::string failure() {
  const char* reason = stbi_failure_reason();
  return reason ? reason : "damaged";
}

}  // namespace

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
  const tinygltf::Image& image = model_.images[static_cast<std::size_t>(index)];
  const std::string& given = image.name.empty() ? image.uri : image.name;
  const std::string where = file_ + ": image " + std::to_string(index) +
                            (given.empty() ? std::string() : " \"" + set::printable(given) + "\"");
  const std::span<const unsigned char> bytes = image.bufferView >= 0
                                                   ? view_bytes(model_, image.bufferView, where)
                                                   : std::span<const unsigned char>(image.image);
  if (bytes.empty()) throw Error(where + ": not found, or empty");
  const bool is_png = begins_with(bytes, png_signature);
  if (!is_png && !begins_with(bytes, jpeg_signature))
    throw Error(where + ": is neither PNG nor JPEG");
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw Error(where + ": is larger than 2 GiB");
  if (is_png) require_chunks(bytes, where);
  const int size = static_cast<int>(bytes.size());
  int width = 0, height = 0, channels = 0;
  if (!stbi_info_from_memory(bytes.data(), size, &width, &height, &channels) || width < 1 ||
      height < 1)
    throw Error(where + ": cannot be decoded: " + failure());
  if (width > max_texture_side || height > max_texture_side)
    throw Error(where + ": is " + std::to_string(width) + "x" + std::to_string(height) +
                "; a side is at most " + std::to_string(max_texture_side));
  const std::size_t texels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (texels / max_texels_a_byte > bytes.size()) throw Error(where + ": is cut short");
  budget_.add_texture(width, height, where);

  Texture texture;
  texture.name = given.empty() ? "image " + std::to_string(index) : given;
  texture.width = width;
  texture.height = height;
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
  if (texture.texels.empty()) throw Error(where + ": cannot be decoded: " + failure());
  return texture;
}

}  // namespace previz::scene
