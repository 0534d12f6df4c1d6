// Provides the buffers that OpenGL ES draws into and the card can scan out: a GBM surface.
#pragma once

#include <gbm.h>

#include <cstdint>
#include <memory>
#include <utility>

#include "drivers/gles/context.hpp"

namespace previz::kms {

class Scanout {
 public:
  // `card` must stay open longer than this object. Throws previz::Error that says what GBM or EGL
  // lacks.
  Scanout(int card, int width, int height);
  ~Scanout();
  Scanout(const Scanout&) = delete;
  Scanout& operator=(const Scanout&) = delete;

  // Makes OpenGL ES draw here from now on. Throws previz::Error.
  void begin() { context_.use(drawn_); }
  // Makes what was drawn the next buffer, and returns its framebuffer for the kernel. At most one
  // buffer may wait: seen() or withdraw() must come before the next call. Throws previz::Error.
  std::uint32_t finish();
  // Must be called once the waiting buffer is on the screen; the one before may then be drawn into
  // again.
  void seen();
  // Takes back the waiting buffer, which will never be on the screen.
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
