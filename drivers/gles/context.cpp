#include "drivers/gles/context.hpp"

#include <string>
#include <vector>

#include "drivers/error.hpp"

namespace previz::gles {
namespace {

[[noreturn]] void refuse(const std::string& what) {
  throw Error("EGL: " + what + ": " + egl_error());
}

// Chooses a configuration with eight bits a colour and, if one is wanted, the native format.
EGLConfig choose_config(EGLDisplay display, EGLint native_visual) {
  const EGLint wanted[] = {EGL_SURFACE_TYPE,
                           native_visual != 0 ? EGL_WINDOW_BIT : EGL_DONT_CARE,
                           EGL_RENDERABLE_TYPE,
                           EGL_OPENGL_ES3_BIT,
                           EGL_RED_SIZE,
                           8,
                           EGL_GREEN_SIZE,
                           8,
                           EGL_BLUE_SIZE,
                           8,
                           EGL_NONE};
  EGLint count = 0;
  if (!eglChooseConfig(display, wanted, nullptr, 0, &count) || count < 1)
    refuse("no configuration with 8 bits per colour");
  std::vector<EGLConfig> configs(static_cast<std::size_t>(count));
  eglChooseConfig(display, wanted, configs.data(), count, &count);
  if (native_visual == 0) return configs.front();
  for (EGLConfig config : configs) {
    EGLint visual = 0;
    eglGetConfigAttrib(display, config, EGL_NATIVE_VISUAL_ID, &visual);
    if (visual == native_visual) return config;
  }
  refuse("no configuration for the screen's pixel format");
}

}  // namespace

const char* egl_error() {
  switch (eglGetError()) {
    case EGL_SUCCESS:
      return "no further reason given";
    case EGL_NOT_INITIALIZED:
      return "the driver does not start (EGL_NOT_INITIALIZED)";
    case EGL_BAD_ACCESS:
      return "another thread holds it (EGL_BAD_ACCESS)";
    case EGL_BAD_ALLOC:
      return "out of memory (EGL_BAD_ALLOC)";
    case EGL_BAD_CONFIG:
      return "the configuration does not fit (EGL_BAD_CONFIG)";
    case EGL_BAD_MATCH:
      return "surface and context do not fit (EGL_BAD_MATCH)";
    case EGL_BAD_NATIVE_WINDOW:
      return "the screen's buffers are gone (EGL_BAD_NATIVE_WINDOW)";
    case EGL_BAD_SURFACE:
      return "the surface is gone (EGL_BAD_SURFACE)";
    case EGL_CONTEXT_LOST:
      return "the GPU was reset (EGL_CONTEXT_LOST)";
    default:
      return "it refuses a parameter";
  }
}

Context::Context(EGLenum platform, void* native, EGLint native_visual)
    : display_(eglGetPlatformDisplay(platform, native, nullptr)) {
  if (display_ == EGL_NO_DISPLAY) refuse("no such platform");
  if (!eglInitialize(display_, nullptr, nullptr)) refuse("cannot be initialised");
  try {
    if (!eglBindAPI(EGL_OPENGL_ES_API)) refuse("no OpenGL ES");
    config_ = choose_config(display_, native_visual);
    const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_NONE};
    context_ = eglCreateContext(display_, config_, EGL_NO_CONTEXT, version);
    if (context_ == EGL_NO_CONTEXT) refuse("no OpenGL ES 3 context");
    use(EGL_NO_SURFACE);
  } catch (...) {
    if (context_ != EGL_NO_CONTEXT) eglDestroyContext(display_, context_);
    eglTerminate(display_);
    throw;
  }
}

Context::~Context() {
  eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display_, context_);
  eglTerminate(display_);
  eglReleaseThread();
}

void Context::use(EGLSurface surface) {
  if (!eglMakeCurrent(display_, surface, surface, context_)) refuse("the context cannot be used");
}

}  // namespace previz::gles
