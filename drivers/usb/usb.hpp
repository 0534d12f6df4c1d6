// Asks the USB itself, through libusb: counts the devices that are plugged in, and resets one that
// is wedged.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>

struct libusb_context;

namespace previz::usb {

struct Free {
  void operator()(libusb_context* context) const;
};

// The place where a device is plugged in, valid until it is replugged.
struct Place {
  int bus = 0, address = 0;

  friend bool operator==(const Place&, const Place&) = default;
};

// Return the place of the one device that matches; none if there is none, or more than one.
std::optional<Place> place_of_serial(const std::string& serial);
std::optional<Place> place_of_product(std::uint16_t vendor, std::uint16_t product);

// Resets a device as if it had been replugged: its driver begins anew. Returns "", or why the reset
// failed.
std::string reset(const Place& place);

// Counts the devices that are plugged in, on a thread of its own.
class Hotplug {
 public:
  // Throws previz::Error if this machine does not report arrivals.
  Hotplug();
  ~Hotplug();
  Hotplug(const Hotplug&) = delete;
  Hotplug& operator=(const Hotplug&) = delete;

  std::uint64_t arrivals() const { return arrivals_; }

 private:
  std::unique_ptr<libusb_context, Free> context_;
  std::atomic<std::uint64_t> arrivals_ = 0;
  std::jthread thread_;
};

}  // namespace previz::usb
