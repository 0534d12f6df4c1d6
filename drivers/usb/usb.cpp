#include "drivers/usb/usb.hpp"

#include <libusb.h>

#include <array>
#include <functional>
#include <span>
#include <string_view>

#include "drivers/error.hpp"

namespace previz::usb {
namespace {

using Context = std::unique_ptr<libusb_context, Free>;

struct CloseHandle {
  void operator()(libusb_device_handle* handle) const { libusb_close(handle); }
};
using Handle = std::unique_ptr<libusb_device_handle, CloseHandle>;

Context make_context(int& error) {
  libusb_context* context = nullptr;
  error = libusb_init(&context);
  return Context(error == 0 ? context : nullptr);
}

Handle open(libusb_device& device, int& error) {
  libusb_device_handle* handle = nullptr;
  error = libusb_open(&device, &handle);
  return Handle(error == 0 ? handle : nullptr);
}

Place place_of(libusb_device& device) {
  return {libusb_get_bus_number(&device), libusb_get_device_address(&device)};
}

// Calls back with every device there is; returns libusb's error, or 0.
int for_each_device(const std::function<void(libusb_device&)>& call) {
  int error = 0;
  const Context context = make_context(error);
  if (!context) return error;
  libusb_device** list = nullptr;
  const ssize_t count = libusb_get_device_list(context.get(), &list);
  if (count < 0) return static_cast<int>(count);
  for (libusb_device* device : std::span(list, static_cast<std::size_t>(count))) call(*device);
  libusb_free_device_list(list, 1);
  return 0;
}

std::optional<Place> the_one(
    const std::function<bool(libusb_device&, const libusb_device_descriptor&)>& matches) {
  std::optional<Place> place;
  int found = 0;
  for_each_device([&](libusb_device& device) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(&device, &descriptor) != 0) return;
    if (!matches(device, descriptor)) return;
    place = place_of(device);
    ++found;
  });
  return found == 1 ? place : std::nullopt;
}

}  // namespace

void Free::operator()(libusb_context* context) const {
  libusb_exit(context);
}

std::optional<Place> place_of_serial(const std::string& serial) {
  return the_one([&](libusb_device& device, const libusb_device_descriptor& descriptor) {
    int error = 0;
    const Handle handle = open(device, error);
    if (!handle) return false;
    std::array<unsigned char, 256> text{};
    const int size = libusb_get_string_descriptor_ascii(handle.get(), descriptor.iSerialNumber,
                                                        text.data(), text.size());
    return size > 0 && serial == std::string_view(reinterpret_cast<const char*>(text.data()),
                                                  static_cast<std::size_t>(size));
  });
}

std::optional<Place> place_of_product(std::uint16_t vendor, std::uint16_t product) {
  return the_one([&](libusb_device&, const libusb_device_descriptor& descriptor) {
    return descriptor.idVendor == vendor && descriptor.idProduct == product;
  });
}

std::string reset(const Place& place) {
  int error = LIBUSB_ERROR_NO_DEVICE;
  const int listed = for_each_device([&](libusb_device& device) {
    if (place_of(device) != place) return;
    if (const Handle handle = open(device, error)) error = libusb_reset_device(handle.get());
  });
  // A device that comes back as another one has been reset too.
  if (listed == 0 && (error == 0 || error == LIBUSB_ERROR_NOT_FOUND)) return {};
  return libusb_strerror(static_cast<libusb_error>(listed != 0 ? listed : error));
}

Hotplug::Hotplug() {
  int error = 0;
  context_ = make_context(error);
  if (context_ && libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG) == 0)
    error = LIBUSB_ERROR_NOT_SUPPORTED;
  if (error == 0)
    error = libusb_hotplug_register_callback(
        context_.get(), LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED, 0, LIBUSB_HOTPLUG_MATCH_ANY,
        LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY,
        [](libusb_context*, libusb_device*, libusb_hotplug_event, void* self) {
          ++static_cast<Hotplug*>(self)->arrivals_;
          return 0;
        },
        this, nullptr);
  if (error != 0)
    throw Error(std::string("cannot watch for USB devices: ") +
                libusb_strerror(static_cast<libusb_error>(error)));
  thread_ = std::jthread([this](const std::stop_token& stop) {
    while (!stop.stop_requested()) libusb_handle_events(context_.get());
  });
}

Hotplug::~Hotplug() {
  thread_.request_stop();
  libusb_interrupt_event_handler(context_.get());
  thread_.join();
}

}  // namespace previz::usb
