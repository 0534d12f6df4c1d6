#include "drivers/aravis/shared_buffers.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "drivers/error.hpp"

namespace previz::aravis {
namespace {

constexpr std::size_t page = 4096;

[[noreturn]] void refuse(const char* what) {
  throw Error(std::string("memory for frames cannot be ") + what + ": " + std::strerror(errno));
}

}  // namespace

SharedBuffers::SharedBuffers(const Ring& ring)
    : ring_(ring),
      stride_((ring.payload + page - 1) / page * page),
      memory_(memfd_create("previzd frames", MFD_CLOEXEC | MFD_ALLOW_SEALING)) {
  if (!memory_ || ftruncate(memory_.get(), static_cast<off_t>(bytes())) != 0 ||
      fcntl(memory_.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0)
    refuse("made");
  map(PROT_READ);
}

SharedBuffers::SharedBuffers(const Ring& ring, OwnedDescriptor memory)
    : ring_(ring), stride_((ring.payload + page - 1) / page * page), memory_(std::move(memory)) {
  map(PROT_READ | PROT_WRITE);
}

SharedBuffers::~SharedBuffers() {
  if (base_) munmap(base_, bytes());
}

void SharedBuffers::map(int protection) {
  void* at = mmap(nullptr, bytes(), protection, MAP_SHARED, memory_.get(), 0);
  if (at == MAP_FAILED) refuse("mapped");
  base_ = static_cast<std::uint8_t*>(at);
}

}  // namespace previz::aravis
