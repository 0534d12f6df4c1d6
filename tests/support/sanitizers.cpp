// What sanitizers must know of libraries that are not built with them; linked into every program of
// theirs. LeakSanitizer: Mesa's lavapipe leaves a hundred bytes a device behind. The report could
// not say whose they are, since the Vulkan loader has unloaded the driver by then; so libraries
// stay loaded, and the driver's leaks can be named. So does x265, which encodes videos for tests,
// with its parameters, fontconfig with its patterns, and the validation layer with what it knows of
// a device. ThreadSanitizer sees neither the locks of GLib
// nor the threads' hand-over within Aravis, Embree and Mesa's CPU driver, nor how the standard
// library counts the owners of an exception that one thread hands to another; and it lets a child
// that was forked beside threads start its own, as the recorder's tests do, only if it is asked to.
#include <unistd.h>

namespace {
const pid_t program = ::getpid();
}

extern "C" {

const char* __lsan_default_suppressions() {
  return "leak:libvulkan_lvp.so\nleak:libx265.so\nleak:libfontconfig.so\n"
         "leak:libVkLayer_khronos_validation.so\n";
}

const char* __tsan_default_suppressions() {
  return "race:libaravis-0.8.so\nrace:libglib-2.0.so\nrace:libgio-2.0.so\nrace:libgobject-2.0.so\n"
         "race:libembree3.so\nrace:swrast_dri.so\nrace:libvulkan_lvp.so\nrace:libopencv_core.so\n"
         "race:std::__exception_ptr::exception_ptr::_M_release\n";
}

// A child that was forked has the threads of its parent in its books, and waits for them in vain.
int __lsan_is_turned_off() {
  return ::getpid() != program;
}

// Without the longest memory a thread's access is reported without the stack that would suppress
// it.
const char* __tsan_default_options() {
  return "die_after_fork=0:history_size=7";
}

int dlclose(void* /*library*/) {
  return 0;
}

}  // extern "C"
