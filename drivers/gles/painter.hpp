// Draws a screenful with OpenGL ES: the picture where it belongs, black around it, overlays above.
#pragma once

#include <GLES3/gl3.h>

#include <memory>
#include <vector>

#include "drivers/display.hpp"

namespace previz::gles {

// Needs a current Context, for its whole life. Of a picture of 8 bits a sample that is shown at its
// own size, and of opaque overlays, every sample comes out as it is; 16 bits are rounded to 8.
// Larger is linear interpolation of picture values, smaller goes by way of halved pictures.
class Painter {
 public:
  Painter(int screen_width, int screen_height, DisplayScale scale);
  ~Painter();
  Painter(const Painter&) = delete;
  Painter& operator=(const Painter&) = delete;

  // From now on this is drawn; an empty one is black. Throws previz::Error, here and below, saying
  // what OpenGL refused.
  void take(const Screenful& screenful);
  // Into the framebuffer bound now, whose first row is the lowest of the screen (as EGL has it).
  void draw();
  // Into a framebuffer of its own, which is read: 8-bit RGB of the screen's size.
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
  void upload(const Plate& picture);
  void upload(const std::vector<Overlay>& overlays);
  void forget_picture();
  void forget_overlays();

  const int width_, height_;
  const DisplayScale scale_;
  GLuint program_ = 0, vertices_ = 0;
  GLint rectangle_ = -1;  // uniform
  Texture picture_;
  std::shared_ptr<const Plate> uploaded_;  // what picture_ holds
  std::vector<Quad> overlays_;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace previz::gles
