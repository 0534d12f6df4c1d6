// What a crew is told whose card no Vulkan driver finds.
#include "daemon/core/render/device/graphics_cards.hpp"

#include "daemon/core/render/device/gpu.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::test::graphics_cards_test {

namespace fs = std::filesystem;

// A sysfs with devices of its own.
class Sysfs {
 public:
  void add(const std::string& address, const std::string& kind, const std::string& vendor,
           const std::string& driver) const {
    const fs::path device = sys() / "bus/pci/devices" / address;
    fs::create_directories(device);
    std::ofstream(device / "class") << kind << '\n';
    std::ofstream(device / "vendor") << vendor << '\n';
    if (!driver.empty())
      fs::create_directory_symlink("../../../bus/pci/drivers/" + driver, device / "driver");
  }
  void connect(const std::string& address) const {
    fs::create_directories(sys() / "bus/pci/devices" / address / "drm/card0/card0-HDMI-A-1");
  }
  std::vector<std::string> missing(std::vector<std::uint32_t> found = {}) const {
    return render::drivers_missing(render::graphics_cards(sys()), found);
  }
  const fs::path& sys() const { return directory_.path(); }

 private:
  TemporaryDirectory directory_;
};

TEST(GraphicsCards, WithoutAVulkanDriverAreSaidWithTheirPackage) {
  const struct {
    const char *kind, *vendor, *driver, *said;
  } cases[] = {{"0x030000", "0x10de", "nouveau", "driven by nouveau.*headers-amd64 nvidia-driver"},
               {"0x030200", "0x10de", "", "no driver.*headers-amd64 nvidia-driver"},
               {"0x030000", "0x10de", "nvidia", "install nvidia-vulkan-icd"},
               {"0x030000", "0x1002", "amdgpu", "adduser USER render.*mesa-vulkan-drivers"},
               {"0x038000", "0x1002", "", "install firmware-amd-graphics"},
               {"0x030000", "0x1002", "radeon", "amdgpu.cik_support=1"},
               {"0x030000", "0x8086", "i915", "adduser USER render.*mesa-vulkan-drivers"},
               {"0x030000", "0x8086", "", "firmware-intel-graphics"}};
  for (const auto& each : cases) {
    const Sysfs sysfs;
    sysfs.add("0000:01:00.0", each.kind, each.vendor, each.driver);
    EXPECT_THAT(sysfs.missing(), ElementsAre(testing::ContainsRegex(each.said)));
    EXPECT_THAT(sysfs.missing({0x10de, 0x1002, 0x8086}), testing::IsEmpty());
  }
}

TEST(GraphicsCards, AreSaidOnceAKindAndOnlyWhereTheyAre) {
  const Sysfs sysfs;
  EXPECT_THAT(sysfs.missing(), testing::IsEmpty());  // no PCI at all
  sysfs.add("0000:00:02.0", "0x030000", "0x8086", "i915");
  sysfs.add("0000:00:03.0", "0x020000", "0x10de", "");       // no display
  sysfs.add("0000:00:04.0", "0x030000", "0x1234", "bochs");  // of a virtual machine
  sysfs.add("0000:00:05.0", "no number", "0x10de", "");
  sysfs.add("0000:00:06.0", "0x030000", "0x10de", "vfio-pci");  // a virtual machine has it
  EXPECT_THAT(sysfs.missing({0x8086}), testing::IsEmpty());
  sysfs.add("0000:01:00.0", "0x030000", "0x10de", "nouveau");
  sysfs.add("0000:02:00.0", "0x030000", "0x10de", "nouveau");
  EXPECT_THAT(sysfs.missing({0x8086}), ElementsAre(HasSubstr("nouveau")));
}

TEST(GraphicsCards, ThatShowNothingWithoutAWindowSystemAreSaid) {
  const auto advice = [](const Sysfs& sysfs) {
    return render::screen_advice(render::graphics_cards(sysfs.sys()));
  };
  const Sysfs sysfs;
  sysfs.add("0000:00:02.0", "0x030000", "0x8086", "i915");
  sysfs.add("0000:02:00.0", "0x030200", "0x10de", "nvidia");  // it computes only
  EXPECT_EQ(advice(sysfs), "");
  sysfs.add("0000:01:00.0", "0x030000", "0x10de", "nvidia");
  EXPECT_THAT(advice(sysfs), HasSubstr("nvidia-drm.modeset=1"));
  sysfs.connect("0000:01:00.0");
  EXPECT_EQ(advice(sysfs), "");
}

TEST(GraphicsCards, WithoutADriverAreNamedByTheDeviceThatDrawsInstead) {
  const Sysfs sysfs;
  sysfs.add("0000:01:00.0", "0x030000", "0x10de", "nouveau");
  render::DeviceOptions options;
  options.sys = sysfs.sys();
  const auto device = render::open_device(options);
  if (render::is_gpu(*device)) GTEST_SKIP() << "Vulkan may have this very card";
  EXPECT_THAT(render::facts_of(*device).missing_drivers, ElementsAre(HasSubstr("nvidia-driver")));
  options.name = "no such card";
  EXPECT_THAT(error_of([&] { render::open_device(options); }),
              AllOf(HasSubstr("named \"no such card\""), HasSubstr("nvidia-driver")));
}

}  // namespace previz::test::graphics_cards_test
