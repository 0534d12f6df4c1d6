// Pictures that the card can scan out: a GBM surface that OpenGL ES draws into.
#pragma once

#include <gbm.h>

#include <cstdint>
#include <memory>
#include <utility>

#include "drivers/gles/context.hpp"

namespace previz::kms {

class Scanout {
 public:
  // `card` stays open longer than this. Throws previz::Error saying what GBM or EGL lacks.
  Scanout(int card, int width, int height);
  ~Scanout();
  Scanout(const Scanout&) = delete;
  Scanout& operator=(const Scanout&) = delete;

  // OpenGL ES draws here from now on. Throws previz::Error.
  void begin() { context_.use(drawn_); }
  // What was drawn becomes the next buffer: its framebuffer for the kernel. One at most is waiting;
  // seen() or withdraw() comes before the next. Throws previz::Error.
  std::uint32_t finish();
  // The buffer that waited is on the screen, and the one before may be drawn into again.
  void seen();
  // It will never be on the screen.
  void withdraw();

 private:
  using DeviceOwner = std::unique_ptr<gbm_device, decltype(&gbm_device_destroy)>;
  using SurfaceOwner = std::unique_ptr<gbm_surface, decltype(&gbm_surface_destroy)>;

  void give_back(gbm_bo*& buffer);

  const int card_;
  DeviceOwner device_;
  SurfaceOwner surface_;
  gles::Context context_;
  EGLSurface drawn_ = EGL_NO_SURFACE;
  gbm_bo* waiting_ = nullptr;
  gbm_bo* on_screen_ = nullptr;
};

}  // namespace previz::kms
