#include "tests/durability/scarce_memory.hpp"

#include <atomic>
#include <cerrno>
#include <cstdint>

namespace previz::test {
namespace {

std::atomic<bool> is_scarce = false;
std::atomic<std::size_t> allocations_made = 0, fails_from = SIZE_MAX, works_from = SIZE_MAX;
thread_local bool has_enough = false;

bool fails() {
  if (!is_scarce || has_enough) return false;
  const std::size_t allocation = allocations_made++;
  return allocation >= fails_from && allocation < works_from;
}

}  // namespace

ScarceMemory::ScarceMemory(std::size_t from, std::size_t count) {
  has_enough = true;
  allocations_made = 0;
  fails_from = from;
  works_from = from + count;
  is_scarce = true;
}

ScarceMemory::~ScarceMemory() {
  is_scarce = false;
  has_enough = false;
}

ScarceMemory::Lack::Lack() {
  has_enough = false;
}

ScarceMemory::Lack::~Lack() {
  has_enough = true;
}

std::size_t ScarceMemory::allocations() const {
  return allocations_made;
}

}  // namespace previz::test

// These stand before the C library's functions of the same name; `new` calls them.
extern "C" {

using previz::test::fails;

void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* old, size_t size);
void* __libc_memalign(size_t alignment, size_t size);

void* malloc(size_t size) {
  if (!fails()) return __libc_malloc(size);
  errno = ENOMEM;
  return nullptr;
}
void* calloc(size_t count, size_t size) {
  if (!fails()) return __libc_calloc(count, size);
  errno = ENOMEM;
  return nullptr;
}
void* realloc(void* old, size_t size) {
  if (!fails()) return __libc_realloc(old, size);
  errno = ENOMEM;
  return nullptr;
}
void* memalign(size_t alignment, size_t size) {
  if (!fails()) return __libc_memalign(alignment, size);
  errno = ENOMEM;
  return nullptr;
}
void* aligned_alloc(size_t alignment, size_t size) {
  return memalign(alignment, size);
}
int posix_memalign(void** result, size_t alignment, size_t size) {
  void* const made = memalign(alignment, size);
  if (!made) return ENOMEM;
  *result = made;
  return 0;
}

}  // extern "C"
