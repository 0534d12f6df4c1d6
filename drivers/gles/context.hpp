// An EGL display with an OpenGL ES 3 context, current in the thread that made it.
#pragma once

#include <EGL/egl.h>
#include <EGL/eglext.h>

namespace previz::gles {

class Context {
 public:
  // `platform` and `native` are those of eglGetPlatformDisplay. `native_visual`, if not 0, is what
  // the configuration's EGL_NATIVE_VISUAL_ID must be: on GBM a DRM format. Throws previz::Error
  // that says what EGL lacks.
  Context(EGLenum platform, void* native, EGLint native_visual = 0);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  EGLDisplay display() const { return display_; }
  EGLConfig config() const { return config_; }

  // Directs drawing to a surface; with EGL_NO_SURFACE only framebuffer objects can be drawn to.
  // Throws previz::Error.
  void use(EGLSurface surface);

 private:
  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLConfig config_ = nullptr;
  EGLContext context_ = EGL_NO_CONTEXT;
};

// Returns why EGL refused its last call in this thread.
const char* egl_error();

}  // namespace previz::gles
