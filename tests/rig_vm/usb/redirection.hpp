// A USB device that a guest of QEMU sees on its bus: what a device answers, and the usbredir
// protocol that carries it (`-device usb-redir` on a socket of QEMU's).
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace previz::test {

using Bytes = std::vector<std::uint8_t>;

// A control request, as the first eight bytes of a transfer say (USB 2.0, 9.3).
struct SetupPacket {
  std::uint8_t type = 0, request = 0;
  std::uint16_t value = 0, index = 0;
};

// A device with one configuration, no alternate settings and one endpoint that speaks to the host.
class UsbDevice {
 public:
  struct Interface {
    std::uint8_t device_class, subclass, protocol;
  };
  struct Input {
    enum class Kind : std::uint8_t { bulk = 2, interrupt = 3 };  // as endpoint descriptors say
    std::uint8_t endpoint;                                       // 0x81 to 0x8f
    Kind kind;
    std::uint8_t interface;
    std::uint16_t packet_bytes;
    std::uint8_t interval;  // as its descriptor says
  };

  virtual ~UsbDevice() = default;

  virtual Bytes device_descriptor() const = 0;
  virtual Bytes configuration_descriptor() const = 0;
  virtual std::vector<std::string> strings() const = 0;  // string descriptors from 1 on; ASCII
  virtual std::vector<Interface> interfaces() const = 0;
  virtual Input input() const = 0;

  // A request that the protocol does not answer by itself: of a class, or of an interface. None
  // stalls.
  virtual std::optional<Bytes> control(const SetupPacket& setup,
                                       std::span<const std::uint8_t> data) = 0;
  // What it says next, of at most `room` bytes; none yet.
  virtual std::optional<Bytes> say(std::size_t room) = 0;
  // The bus was reset, as at every plugging in.
  virtual void reset() = 0;
};

// Descriptors: their length goes before them, numbers are little-endian.
Bytes descriptor(std::uint8_t kind, std::initializer_list<Bytes> parts);
template <typename... Parts>
Bytes joined(const Parts&... parts) {
  Bytes all;
  (all.insert(all.end(), parts.begin(), parts.end()), ...);
  return all;
}
Bytes number(std::uint64_t value, int bytes);

// Keeps the device plugged in to QEMU's socket for as long as the file `cable` is there. Returns
// when QEMU ends while it is plugged in. Throws std::runtime_error.
void serve(UsbDevice& device, const std::filesystem::path& socket,
           const std::filesystem::path& cable);

}  // namespace previz::test
