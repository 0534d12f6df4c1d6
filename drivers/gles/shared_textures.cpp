#include "drivers/gles/shared_textures.hpp"

#include <EGL/egl.h>
#include <GLES2/gl2ext.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <string_view>

namespace previz::gles {
namespace {

template <typename Function>
Function address_of(const char* name) {
  return reinterpret_cast<Function>(eglGetProcAddress(name));
}

bool has_extension(std::string_view wanted) {
  GLint count = 0;
  glGetIntegerv(GL_NUM_EXTENSIONS, &count);
  for (GLint i = 0; i < count; ++i) {
    const GLubyte* name = glGetStringi(GL_EXTENSIONS, static_cast<GLuint>(i));
    if (name && wanted == reinterpret_cast<const char*>(name)) return true;
  }
  return false;
}

// EGL gives addresses even for what the driver lacks, so the extensions are asked for first.
std::optional<CardIdentity> card_of_context() {
  if (!has_extension("GL_EXT_memory_object") || !has_extension("GL_EXT_memory_object_fd"))
    return std::nullopt;
  CardIdentity card;
  address_of<PFNGLGETUNSIGNEDBYTEI_VEXTPROC>("glGetUnsignedBytei_vEXT")(GL_DEVICE_UUID_EXT, 0,
                                                                        card.device.data());
  address_of<PFNGLGETUNSIGNEDBYTEVEXTPROC>("glGetUnsignedBytevEXT")(GL_DRIVER_UUID_EXT,
                                                                    card.driver.data());
  if (glGetError() != GL_NO_ERROR) return std::nullopt;
  return card;
}

// What follows is judged alone. A context that is lost may have an error each time it is asked.
void forget_errors() {
  constexpr int kinds = 8;
  for (int i = 0; i < kinds && glGetError() != GL_NO_ERROR; ++i) continue;
}

}  // namespace

SharedTextures::SharedTextures() : card_(card_of_context()) {
  glGenFramebuffers(1, &framebuffer_);
}

SharedTextures::~SharedTextures() {
  for (const Imported& imported : imported_) forget(imported);
  glDeleteFramebuffers(1, &framebuffer_);
}

void SharedTextures::forget(const Imported& imported) {
  glDeleteTextures(1, &imported.texture);
  address_of<PFNGLDELETEMEMORYOBJECTSEXTPROC>("glDeleteMemoryObjectsEXT")(1, &imported.memory);
}

// OpenGL ES takes the descriptor that it is given, and keeps the memory for as long as it needs it.
GLuint SharedTextures::texture_of(const CardMemory& memory) {
  const auto known = std::ranges::find(imported_, memory.id, &Imported::id);
  if (known != imported_.end()) {
    std::rotate(known, known + 1, imported_.end());
    return imported_.back().texture;
  }
  if (imported_.size() == most) {
    forget(imported_.front());
    imported_.erase(imported_.begin());
  }
  Imported made{memory.id, 0, 0};
  address_of<PFNGLCREATEMEMORYOBJECTSEXTPROC>("glCreateMemoryObjectsEXT")(1, &made.memory);
  const GLint is_dedicated = GL_TRUE;
  address_of<PFNGLMEMORYOBJECTPARAMETERIVEXTPROC>("glMemoryObjectParameterivEXT")(
      made.memory, GL_DEDICATED_MEMORY_OBJECT_EXT, &is_dedicated);
  const int descriptor = fcntl(memory.descriptor.get(), F_DUPFD_CLOEXEC, 0);
  address_of<PFNGLIMPORTMEMORYFDEXTPROC>("glImportMemoryFdEXT")(
      made.memory, memory.bytes, GL_HANDLE_TYPE_OPAQUE_FD_EXT, descriptor);
  // What OpenGL ES took is no longer ours to close.
  const bool is_taken = glGetError() == GL_NO_ERROR;
  if (!is_taken && descriptor >= 0) ::close(descriptor);
  glGenTextures(1, &made.texture);
  imported_.push_back(made);
  GLint bound = 0;
  glGetIntegerv(GL_TEXTURE_BINDING_2D, &bound);
  glBindTexture(GL_TEXTURE_2D, made.texture);
  address_of<PFNGLTEXSTORAGEMEM2DEXTPROC>("glTexStorageMem2DEXT")(
      GL_TEXTURE_2D, 1, GL_RGBA8, memory.width, memory.height, made.memory, 0);
  glBindTexture(GL_TEXTURE_2D, static_cast<GLuint>(bound));
  return made.texture;
}

bool SharedTextures::copy(const CardPicture& picture) {
  const CardMemory& memory = *picture.memory;
  if (card_ != memory.card) return false;
  forget_errors();
  GLint before = 0;
  glGetIntegerv(GL_FRAMEBUFFER_BINDING, &before);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture_of(memory),
                         0);
  const bool is_complete = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
  if (is_complete) glCopyTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, 0, 0, memory.width, memory.height);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, 0, 0);
  glBindFramebuffer(GL_FRAMEBUFFER, static_cast<GLuint>(before));
  const bool is_copied = glGetError() == GL_NO_ERROR && is_complete;
  if (!is_copied) card_.reset();
  return is_copied;
}

}  // namespace previz::gles
