#include "daemon/core/scene/gltf_texture.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "daemon/core/scene/gltf_accessor.hpp"
#include "daemon/core/scene/gltf_uri.hpp"
#include "daemon/core/scene/gltf_value.hpp"
#include "daemon/core/scene/picture_bytes.hpp"
#include "daemon/core/scene/texture_sizes.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/convert/area_average.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

Wrap wrap(int gltf) {
  if (gltf == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::clamp;
  if (gltf == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return Wrap::mirror;
  return Wrap::repeat;
}

constexpr double least_cover = 1e-6;  // what a texel counts of alpha 0

// Returns what samples of 0 to `largest` are, as data or in linear light.
std::vector<float> values_of(int largest, Encoding encoding) {
  std::vector<float> values(static_cast<std::size_t>(largest) + 1);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double value = static_cast<double>(i) / largest;
    values[i] = static_cast<float>(encoding == Encoding::srgb ? srgb_signal(value) : value);
  }
  return values;
}

// Takes the rows of a picture and returns its texels, averaged in linear light where `to` is
// smaller; where the alpha cuts out, the colours by it.
class Linearised {
 public:
  Linearised(PictureSize from, PictureSize to, Encoding encoding, bool cuts_out)
      : encoding_(encoding), by_alpha_(cuts_out), row_(static_cast<std::size_t>(from.width)) {
    if (from != to) average_.emplace(from.width, from.height, to.width, to.height);
    texels_.reserve(static_cast<std::size_t>(to.width) * static_cast<std::size_t>(to.height));
  }

  void add(const PictureRow& row) {
    if (data_.empty()) {
      data_ = values_of(row.largest, Encoding::linear);
      color_ = values_of(row.largest, encoding_);
    }
    const std::uint16_t* samples = row.rgba.data();
    for (glm::vec4& texel : row_) {
      texel = {color_[samples[0]], color_[samples[1]], color_[samples[2]], data_[samples[3]]};
      samples += 4;
    }
    if (!average_) {
      texels_.insert(texels_.end(), row_.begin(), row_.end());
      return;
    }
    const auto weighted = [&](int x) {
      const glm::dvec4 texel(row_[static_cast<std::size_t>(x)]);
      return by_alpha_ ? glm::dvec4((texel.a + least_cover) * glm::dvec3(texel), texel.a) : texel;
    };
    average_->add(weighted, [&](std::span<const glm::dvec4> sums) {
      for (const glm::dvec4& sum : sums)
        texels_.emplace_back(by_alpha_ ? glm::dvec4(glm::dvec3(sum) / (sum.a + least_cover), sum.a)
                                       : sum);
    });
  }

  std::vector<glm::vec4> texels() && { return std::move(texels_); }

 private:
  Encoding encoding_;
  bool by_alpha_;
  std::vector<float> data_, color_;  // by sample
  std::vector<glm::vec4> row_, texels_;
  std::optional<convert::AreaAverage<glm::dvec4>> average_;
};

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

namespace {

// Returns why an image of a model cannot be read, without the file's name; "" of one that can.
std::string unreadable(const tinygltf::Model& model, int index, const std::string& file,
                       NameRules rules) {
  try {
    const EncodedImage image = encoded_image(model, index, file, rules);
    checked_picture_size(image.bytes, image.where);
  } catch (const Error& error) {
    return std::string(error.what()).substr(file.size() + 2);
  }
  return "";
}

}  // namespace

TextureImage image_of(const tinygltf::Model& model, int index, const std::string& file,
                      NameRules rules) {
  const std::string name = "texture " + std::to_string(index);
  if (index < 0 || static_cast<std::size_t>(index) >= model.textures.size())
    throw Error(file + ": a material uses " + name + ", which does not exist");
  const tinygltf::Texture& texture = model.textures[static_cast<std::size_t>(index)];
  int image = texture.source;
  const double webp = number(extension(texture.extensions, "EXT_texture_webp"), "source", -1);
  std::string left_out;
  if (webp >= 0) {
    const int preferred = static_cast<int>(std::min(webp, 2e9));
    if (image >= 0) left_out = unreadable(model, preferred, file, rules);
    if (left_out.empty())
      image = preferred;
    else
      left_out = name + ": its WebP is ignored for its other picture: " + left_out;
  }
  if (image >= 0 && static_cast<std::size_t>(image) >= model.images.size())
    throw Error(file + ": " + name + ": no image " + std::to_string(image));
  if (image >= 0) return {image, left_out};
  for (const auto& [extension, content] : texture.extensions)
    return {-1, name + ": its picture is in a format that is not supported (" +
                    set::one_line(extension) + ")"};
  return {-1, name + ": has no picture"};
}

std::uint32_t GltfTextures::use(int index, Encoding encoding, bool white,
                                std::optional<float> glossiness, bool cuts_out) {
  const auto [image, missing] = image_of(model_, index, file_, names_in_objects);
  if (image < 0 && white)
    throw Error(file_ + ": " + missing +
                ", and without it a surface would be white; export the file with textures in PNG, "
                "JPEG or WebP");
  if (image < 0) {
    notes_.add(missing + "; ignored");
    return no_texture;
  }
  if (!missing.empty()) notes_.add(missing);
  const std::string name = "texture " + std::to_string(index);
  const tinygltf::Texture& texture = model_.textures[static_cast<std::size_t>(index)];
  tinygltf::Sampler sampler;
  if (texture.sampler >= 0) {
    if (static_cast<std::size_t>(texture.sampler) >= model_.samplers.size())
      throw Error(file_ + ": " + name + ": no sampler " + std::to_string(texture.sampler));
    sampler = model_.samplers[static_cast<std::size_t>(texture.sampler)];
  }

  const Wrap wrap_u = wrap(sampler.wrapS), wrap_v = wrap(sampler.wrapT);
  const bool nearest = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST;
  const auto [at, is_new] =
      used_.try_emplace({image, encoding, wrap_u, wrap_v, nearest, glossiness}, no_texture);
  if (!is_new) {
    const auto same = std::ranges::find(pending_, at->second, &Pending::texture);
    if (cuts_out && same != pending_.end()) same->cuts_out = true;
    return at->second;
  }
  Pending pending{scene_.textures.size(),
                  0,
                  encoded_image(model_, image, file_, names_in_objects),
                  {},
                  encoding,
                  glossiness,
                  cuts_out};
  if (!pending.image.note.empty()) notes_.add(pending.image.note);
  pending.size = checked_picture_size(pending.image.bytes, pending.image.where);
  pending.in_budget = budget_.add_texture(pending.size);
  Texture header;
  header.name = pending.image.name.empty() ? "image " + std::to_string(image) : pending.image.name;
  header.wrap_u = wrap_u;
  header.wrap_v = wrap_v;
  header.nearest = nearest;
  at->second = static_cast<std::uint32_t>(pending.texture);
  scene_.textures.push_back(std::move(header));
  pending_.push_back(std::move(pending));
  return at->second;
}

void GltfTextures::decode() {
  const auto in_words = [](PictureSize size) {
    return std::to_string(size.width) + " x " + std::to_string(size.height);
  };
  constexpr std::size_t most_named = 3;
  std::size_t reduced = 0;
  std::string names;
  PictureSize widest{0, 0};
  for (const Pending& pending : pending_) {
    const auto [width, height] = budget_.fitted_texture(pending.in_budget);
    Texture& texture = scene_.textures[pending.texture];
    texture.width = width;
    texture.height = height;
    Linearised linearised(pending.size, {width, height}, pending.encoding, pending.cuts_out);
    decode_rows(pending.image.bytes, pending.size, pending.image.where,
                [&](const PictureRow& row) { linearised.add(row); });
    texture.texels = std::move(linearised).texels();
    if (pending.glossiness)
      for (glm::vec4& texel : texture.texels) texel = {1, 1 - *pending.glossiness * texel.a, 1, 1};
    if (pending.size == PictureSize{width, height}) continue;
    widest = {std::max(widest.width, width), std::max(widest.height, height)};
    if (++reduced > most_named) continue;
    names += (reduced > 1 ? ", \"" : "\"") + set::one_line(texture.name) + "\" of " +
             in_words(pending.size) + " pixels to " + in_words({width, height});
  }
  pending_.clear();
  if (reduced == 0) return;
  if (reduced > most_named) names += " and " + std::to_string(reduced - most_named) + " more";
  const double of_two = static_cast<double>(budget_.most_texels()) / 2;
  const bool has_levels = budget_.has_levels();  // which have a third of the pixels
  const int side = static_cast<int>(std::sqrt(has_levels ? of_two * 3 / 4 : of_two));
  notes_.add((reduced == 1 ? "1 texture is" : std::to_string(reduced) + " textures are") +
             " reduced, " + names + ": the textures of the scene have more than " +
             std::to_string(budget_.most_texels()) + " pixels together" +
             (has_levels ? " with their smaller levels" : "") + ", as two of " +
             in_words({side, side}) +
             " have; to choose their sizes, use gltf-transform resize IN OUT --width " +
             std::to_string(widest.width) + " --height " + std::to_string(widest.height));
}

}  // namespace previz::scene
