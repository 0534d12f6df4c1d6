// The udev rules that `previzd devices --rules` prints, of devices as the kernel lists them.
#include "daemon/device_rules.hpp"

#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::device_rules_test {

namespace fs = std::filesystem;

class DeviceRules : public testing::Test {
 protected:
  void add_hid(const std::string& node, const std::string& id, const std::string& name,
               const std::string& descriptor) {
    const fs::path device = sysfs_ / "class" / "hidraw" / node / "device";
    fs::create_directories(device);
    std::ofstream(device / "uevent") << "DRIVER=hid-generic\nHID_ID=" << id << "\nHID_NAME=" << name
                                     << "\nHID_PHYS=usb-1/input0\n";
    std::ofstream(device / "report_descriptor", std::ios::binary) << descriptor;
  }
  void add_chip(const std::string& chip, const std::string& parent, const std::string& driver) {
    const fs::path place = sysfs_ / "devices" / "platform" / parent;
    fs::create_directories(place / chip);
    fs::create_directories(sysfs_ / "drivers" / driver);
    fs::create_directory_symlink(sysfs_ / "drivers" / driver, place / "driver");
    fs::create_directories(sysfs_ / "bus" / "gpio" / "devices");
    fs::create_directory_symlink(place / chip, sysfs_ / "bus" / "gpio" / "devices" / chip);
  }
  std::string rules() const {
    std::ostringstream out;
    print_device_rules(out, sysfs_.path());
    return out.str();
  }

  // A pad's report descriptor begins with "generic desktop, game pad"; a keyboard's with "generic
  // desktop, keyboard".
  static constexpr const char* of_pad = "\x05\x01\x09\x05\xa1\x01";
  static constexpr const char* of_keyboard = "\x05\x01\x09\x06\xa1\x01";
  test::TemporaryDirectory sysfs_;
};

TEST_F(DeviceRules, NameAPadByVendorAndProductAndAChipByWhereItIs) {
  add_hid("hidraw0", "0003:00001209:0000000A", "previz Rig pad", of_pad);
  add_chip("gpiochip1", "gpio-sim.0", "gpio-sim");
  const std::string text = rules();
  EXPECT_THAT(text, HasSubstr("# previz Rig pad\n"
                              "SUBSYSTEM==\"hidraw\", KERNELS==\"*:1209:000A.*\", "
                              "GROUP=\"previz\", MODE=\"0660\"\n"));
  EXPECT_THAT(text, HasSubstr("# gpiochip1, a chip of gpio-sim\n"
                              "SUBSYSTEM==\"gpio\", KERNEL==\"gpiochip*\", "
                              "KERNELS==\"gpio-sim.0\", GROUP=\"previz\", MODE=\"0660\"\n"));
}

// A device may be a pad by one interface and a keyboard by another.
TEST_F(DeviceRules, OfAKeyboardAreComments) {
  add_hid("hidraw0", "0003:0000046D:0000C31C", "Keyboard", of_pad);
  add_hid("hidraw1", "0003:0000046D:0000C31C", "Keyboard", of_keyboard);
  EXPECT_THAT(rules(), HasSubstr("\n#SUBSYSTEM==\"hidraw\", KERNELS==\"*:046D:C31C.*\""));
  EXPECT_THAT(rules(), Not(HasSubstr("\nSUBSYSTEM")));
}

// What a device says of itself cannot add a rule.
TEST_F(DeviceRules, ADeviceCannotWriteOne) {
  add_hid("hidraw0", "0003:00001209:00000001", "pad\rSUBSYSTEM==\"hidraw\", MODE=\"0666\"", of_pad);
  add_hid("hidraw1", "0003:0000\"*\"\"", "pad", of_pad);
  EXPECT_THAT(rules(), Not(HasSubstr("MODE=\"0666\"")));
  EXPECT_THAT(rules(), Not(HasSubstr("\r")));
}

TEST_F(DeviceRules, WithoutDevicesThereAreNone) {
  EXPECT_THAT(rules(), Not(HasSubstr("SUBSYSTEM")));
}

}  // namespace previz::device_rules_test
