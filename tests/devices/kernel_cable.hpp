// The cable of a camera that the kernel drives, pulled by telling the kernel to let it go.
#pragma once

#include <filesystem>
#include <string>

namespace previz::test {

class KernelCable {
 public:
  // Of a camera that is there.
  KernelCable(std::string driver, std::string device);
  ~KernelCable() { plug(); }
  KernelCable(const KernelCable&) = delete;
  KernelCable& operator=(const KernelCable&) = delete;

  // Why it cannot be pulled; empty where it can.
  std::string why_not() const;

  void unplug();
  void plug();  // returns when the driver finds the camera again

 private:
  const std::string driver_, device_;
  // USB: "authorized" of the device, which takes 0 and 1. vivid: unbind and bind of its driver.
  std::filesystem::path out_, in_;
  std::string out_word_, in_word_;
  bool plugged_ = true;
};

}  // namespace previz::test
