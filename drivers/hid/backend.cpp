#include "drivers/hid/backend.hpp"

#include <dlfcn.h>

#include <vector>

#include "drivers/error.hpp"

namespace previz::hid {
namespace {

// Both libraries have the same names for their functions, so that they cannot be linked together.
// They stay loaded: hidapi keeps what hid_init() made until the process ends.
struct Libraries {
  std::vector<Backend> loaded;
  std::string missing;

  Libraries() {
    load("hidraw", "libhidapi-hidraw.so.0");
    load("libusb", "libhidapi-libusb.so.0");
  }

  template <typename Function>
  static bool find(void* library, const char* name, Function& function) {
    function = reinterpret_cast<Function>(dlsym(library, name));
    return function != nullptr;
  }

  void load(const char* name, const char* file) {
    Backend backend{name, nullptr, nullptr, nullptr, nullptr, nullptr};
    decltype(&hid_init) init = nullptr;
    void* library = dlopen(file, RTLD_NOW | RTLD_LOCAL);
    const bool whole = library && find(library, "hid_init", init) &&
                       find(library, "hid_open", backend.open) &&
                       find(library, "hid_close", backend.close) &&
                       find(library, "hid_read_timeout", backend.read_timeout) &&
                       find(library, "hid_enumerate", backend.enumerate) &&
                       find(library, "hid_free_enumeration", backend.free_enumeration);
    if (whole && init() == 0) return loaded.push_back(backend);
    const char* why = whole ? "cannot be started" : dlerror();
    add_to_list(missing, why ? why : file, "; ");
  }
};

}  // namespace

std::span<const Backend> backends() {
  static const Libraries libraries;
  if (libraries.loaded.empty()) throw Error("HID devices cannot be read: " + libraries.missing);
  return libraries.loaded;
}

std::mutex& library_mutex() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace previz::hid
