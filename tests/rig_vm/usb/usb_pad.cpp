// A pad of eight buttons on the USB (HID, one byte a report), plugged into a guest of QEMU.
//   rig_vm_usb_pad SOCKET CABLE
// It is plugged in as long as the file CABLE is there; its first button is held as long as
// CABLE.held is there.
#include <cstdio>

#include "tests/devices/uhid_pad.hpp"
#include "tests/rig_vm/usb/redirection.hpp"

namespace previz::test {
namespace {

constexpr std::uint8_t hid = 3, input_endpoint = 0x81;
constexpr std::uint8_t device_kind = 1, configuration_kind = 2, interface_kind = 4,
                       endpoint_kind = 5, hid_kind = 0x21, report_kind = 0x22;
constexpr std::uint8_t get_descriptor = 6;

class UsbPad final : public UsbDevice {
 public:
  explicit UsbPad(std::filesystem::path held) : held_(std::move(held)) {}

  Bytes device_descriptor() const override {
    return descriptor(device_kind, {number(0x0200, 2),
                                    {0, 0, 0, 64},
                                    number(0x1209, 2),
                                    number(3, 2),
                                    number(0x0100, 2),
                                    {1, 2, 3, 1}});
  }

  Bytes configuration_descriptor() const override {
    const Bytes all =
        joined(descriptor(interface_kind, {{0, 0, 1, hid, 0, 0, 0}}), hid_descriptor(),
               descriptor(endpoint_kind, {{input_endpoint, 3}, number(8, 2), {6}}));  // every 4 ms
    return joined(descriptor(configuration_kind, {number(9 + all.size(), 2), {1, 1, 0, 0x80, 50}}),
                  all);
  }

  std::vector<std::string> strings() const override { return {"previz", "Rig pad", "RIGPAD1"}; }
  std::vector<Interface> interfaces() const override { return {{hid, 0, 0}}; }
  Input input() const override { return {input_endpoint, Input::Kind::interrupt, 0, 8, 6}; }

  std::optional<Bytes> control(const SetupPacket& setup, std::span<const std::uint8_t>) override {
    if (setup.request != get_descriptor) return Bytes{};  // an idle rate, which it has not
    if (setup.value >> 8 == report_kind) return report_descriptor();
    if (setup.value >> 8 == hid_kind) return hid_descriptor();
    return std::nullopt;
  }

  std::optional<Bytes> say(std::size_t) override {
    const auto state = static_cast<std::uint8_t>(exists(held_) ? 1 : 0);
    if (state == said_) return std::nullopt;
    said_ = state;
    return Bytes{state};
  }

  void reset() override { said_ = 0; }

 private:
  static Bytes report_descriptor() { return {eight_buttons.begin(), eight_buttons.end()}; }
  static Bytes hid_descriptor() {
    return descriptor(
        hid_kind, {number(0x0111, 2), {0, 1, report_kind}, number(report_descriptor().size(), 2)});
  }

  const std::filesystem::path held_;
  std::uint8_t said_ = 0;
};

}  // namespace
}  // namespace previz::test

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: rig_vm_usb_pad SOCKET CABLE\n");
    return 2;
  }
  try {
    previz::test::UsbPad pad(std::string(argv[2]) + ".held");
    previz::test::serve(pad, argv[1], argv[2]);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "rig_vm_usb_pad: %s\n", error.what());
    return 1;
  }
}
