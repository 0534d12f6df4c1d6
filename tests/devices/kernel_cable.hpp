// The cable of a camera that the kernel drives: pulled by telling the kernel to let it go, or,
// where PREVIZ_TEST_USB_CABLE names the file that stands for a USB camera's cable, really
// (tests/rig_vm).
#pragma once

#include <filesystem>
#include <string>

namespace previz::test {

class KernelCable {
 public:
  // Of a camera that is there.
  KernelCable(std::string driver, std::string device);
  ~KernelCable();
  KernelCable(const KernelCable&) = delete;
  KernelCable& operator=(const KernelCable&) = delete;

  // Why it cannot be pulled; empty where it can.
  std::string why_not() const;

  // They throw previz::Error where nothing comes of it within 20 s.
  void unplug();  // a real cable: returns when the driver does not find the camera any more
  void plug();    // returns when the driver finds the camera again

 private:
  void wait_until_found(bool found) const;

  const std::string driver_, device_;
  // USB: "authorized" of the device, which takes 0 and 1. vivid: unbind and bind of its driver.
  std::filesystem::path out_, in_;
  std::filesystem::path file_;  // a real cable's; empty: none
  std::string out_word_, in_word_;
  bool plugged_ = true;
};

}  // namespace previz::test
