// Pictures of a graphics card as textures of OpenGL ES, by the extensions GL_EXT_memory_object and
// GL_EXT_memory_object_fd.
#pragma once

#include <GLES3/gl3.h>

#include <optional>
#include <vector>

#include "drivers/card_picture.hpp"

namespace previz::gles {

// Needs a current Context for its whole life.
class SharedTextures {
 public:
  SharedTextures();
  ~SharedTextures();
  SharedTextures(const SharedTextures&) = delete;
  SharedTextures& operator=(const SharedTextures&) = delete;

  // Returns the card whose pictures can be copied; nothing where the extensions are missing, or
  // after copy() failed.
  const std::optional<CardIdentity>& card() const { return card_; }
  // Copies the picture into the texture that is bound, which has its size. The picture must be held
  // until that is done. Returns false where OpenGL ES refuses.
  bool copy(const CardPicture& picture);

 private:
  struct Imported {
    std::uint64_t id;
    GLuint memory, texture;
  };
  GLuint texture_of(const CardMemory& memory);
  void forget(const Imported& imported);

  static constexpr std::size_t most = 8;  // more than a renderer has at one size
  std::optional<CardIdentity> card_;
  GLuint framebuffer_ = 0;
  std::vector<Imported> imported_;  // the one that was used last is the last
};

}  // namespace previz::gles
