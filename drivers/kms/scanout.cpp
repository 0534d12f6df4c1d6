#include "drivers/kms/scanout.hpp"

#include <xf86drm.h>
#include <xf86drmMode.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "drivers/error.hpp"

namespace previz::kms {
namespace {

constexpr std::uint32_t pixel_format = GBM_FORMAT_XRGB8888;  // every card scans it out

// A buffer's framebuffer lives as long as the buffer.
struct Framebuffer {
  int card;
  std::uint32_t id;
};

void forget(gbm_bo*, void* data) {
  const auto* framebuffer = static_cast<Framebuffer*>(data);
  drmModeRmFB(framebuffer->card, framebuffer->id);
  delete framebuffer;
}

std::uint32_t framebuffer_of(int card, gbm_bo* buffer) {
  if (const auto* known = static_cast<Framebuffer*>(gbm_bo_get_user_data(buffer))) return known->id;
  const std::uint32_t handles[4] = {gbm_bo_get_handle(buffer).u32};
  const std::uint32_t strides[4] = {gbm_bo_get_stride(buffer)};
  const std::uint32_t offsets[4] = {};
  std::uint32_t id = 0;
  if (drmModeAddFB2(card, gbm_bo_get_width(buffer), gbm_bo_get_height(buffer), pixel_format,
                    handles, strides, offsets, &id, 0) != 0)
    throw Error(std::string("the card refuses a picture of the screen's size: ") +
                std::strerror(errno));
  gbm_bo_set_user_data(buffer, std::make_unique<Framebuffer>(Framebuffer{card, id}).release(),
                       forget);
  return id;
}

gbm_device* make_device(int card) {
  if (gbm_device* device = gbm_create_device(card)) return device;
  throw Error("GBM: does not support this graphics card");
}

gbm_surface* make_surface(gbm_device* device, int width, int height) {
  if (gbm_surface* surface = gbm_surface_create(device, static_cast<std::uint32_t>(width),
                                                static_cast<std::uint32_t>(height), pixel_format,
                                                GBM_BO_USE_SCANOUT | GBM_BO_USE_RENDERING))
    return surface;
  throw Error("GBM: cannot create a surface of the screen's size");
}

}  // namespace

Scanout::Scanout(int card, int width, int height)
    : card_(card),
      device_(make_device(card), gbm_device_destroy),
      surface_(make_surface(device_.get(), width, height), gbm_surface_destroy),
      context_(EGL_PLATFORM_GBM_KHR, device_.get(), pixel_format) {
  drawn_ = eglCreatePlatformWindowSurface(context_.display(), context_.config(), surface_.get(),
                                          nullptr);
  if (drawn_ == EGL_NO_SURFACE)
    throw Error(std::string("EGL: no surface for the screen: ") + gles::egl_error());
  begin();
}

Scanout::~Scanout() {
  give_back(waiting_);
  give_back(on_screen_);
  if (drawn_ == EGL_NO_SURFACE) return;
  eglMakeCurrent(context_.display(), EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroySurface(context_.display(), drawn_);
}

std::uint32_t Scanout::finish() {
  if (!eglSwapBuffers(context_.display(), drawn_))
    throw Error(std::string("EGL: the picture cannot be finished: ") + gles::egl_error());
  waiting_ = gbm_surface_lock_front_buffer(surface_.get());
  if (!waiting_) throw Error("GBM: returns no buffer");
  return framebuffer_of(card_, waiting_);
}

void Scanout::seen() {
  give_back(on_screen_);
  on_screen_ = std::exchange(waiting_, nullptr);
}

void Scanout::withdraw() {
  give_back(waiting_);
}

void Scanout::give_back(gbm_bo*& buffer) {
  if (buffer) gbm_surface_release_buffer(surface_.get(), std::exchange(buffer, nullptr));
}

}  // namespace previz::kms
