// Draws a screenful with OpenGL ES: the picture where it belongs, black around it, overlays above.
#pragma once

#include <GLES3/gl3.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/display.hpp"
#include "drivers/gles/shared_textures.hpp"

namespace previz::gles {

// A Painter needs a current Context for its whole life. Every sample of an 8-bit picture shown at
// its own size, and of opaque overlays, comes out as it is; 16 bits are rounded to 8. Larger
// pictures are interpolated linearly, smaller ones are sampled from mipmaps.
class Painter {
 public:
  Painter(int screen_width, int screen_height, DisplayScale scale);
  ~Painter();
  Painter(const Painter&) = delete;
  Painter& operator=(const Painter&) = delete;

  // Returns the card whose pictures can be taken (Display::card()).
  const std::optional<CardIdentity>& card() const { return shared_.card(); }
  // Sets what is drawn from now on; an empty screenful is black. Returns why a card's picture
  // cannot be taken, in words; `picture` is then drawn in its place, or none if there is none. A
  // card's picture must be held until it was drawn, or finish() was called. This function and those
  // below throw previz::Error that says what OpenGL refused.
  std::optional<std::string> take(const Screenful& screenful);
  // Waits until all is done that was asked for.
  static void finish() { glFinish(); }
  void forget() { take(Screenful{}); }
  // Draws into the framebuffer that is bound, whose first row is the lowest of the screen (as EGL
  // has it).
  void draw();
  // Draws into a framebuffer of its own and returns that as 8-bit RGB of the screen's size.
  Plate read_back();

 private:
  struct Texture {
    GLuint name = 0;
    int width = 0, height = 0;
  };
  struct Quad {
    Texture texture;
    int x, y;  // upper left
  };

  void draw(const Texture& texture, int x, int y, int width, int height, bool blend);
  void take(const std::shared_ptr<const Plate>& picture);
  void upload(const Plate& picture);
  bool copy(const CardPicture& picture);
  void make_picture(int width, int height);
  void filter_picture();
  void upload(const std::vector<Overlay>& overlays);
  void forget_picture();
  void forget_overlays();

  const int width_, height_;
  const DisplayScale scale_;
  GLuint program_ = 0, vertices_ = 0;
  GLint rectangle_ = -1;  // location of the uniform
  Texture picture_;
  std::shared_ptr<const Plate> uploaded_;  // what picture_ holds,
  std::uint64_t copied_ = 0;               // or the number of the card's picture; 0: none
  SharedTextures shared_;
  std::vector<Quad> overlays_;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace previz::gles
