// What a crew is told whose card no Vulkan driver finds.
#include "daemon/render/graphics_cards.hpp"

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
  void set_modeset(const std::string& value) const {
    const fs::path folder = sys() / "module/nvidia_drm/parameters";
    fs::create_directories(folder);
    std::ofstream(folder / "modeset") << value << '\n';
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
  } cases[] = {{"0x030000", "0x10de", "nouveau", "driven by nouveau.*install nvidia-driver,"},
               {"0x030200", "0x10de", "", "no driver has taken it.*install nvidia-driver,"},
               {"0x030000", "0x10de", "nvidia", "install nvidia-vulkan-icd"},
               {"0x030000", "0x1002", "amdgpu", "install mesa-vulkan-drivers.*render"},
               {"0x038000", "0x1002", "", "install firmware-amd-graphics"},
               {"0x030000", "0x8086", "i915", "install mesa-vulkan-drivers.*render"},
               {"0x030000", "0x8086", "", "bookworm-backports"}};
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
  EXPECT_THAT(sysfs.missing({0x8086}), testing::IsEmpty());
  sysfs.add("0000:01:00.0", "0x030000", "0x10de", "nouveau");
  sysfs.add("0000:02:00.0", "0x030000", "0x10de", "nouveau");
  EXPECT_THAT(sysfs.missing({0x8086}), ElementsAre(HasSubstr("nouveau")));
}

TEST(GraphicsCards, ThatShowNothingWithoutAWindowSystemAreSaid) {
  const Sysfs sysfs;
  EXPECT_EQ(render::screen_advice(sysfs.sys()), "");
  sysfs.set_modeset("Y");
  EXPECT_EQ(render::screen_advice(sysfs.sys()), "");
  sysfs.set_modeset("N");
  EXPECT_THAT(render::screen_advice(sysfs.sys()), HasSubstr("nvidia-drm.modeset=1"));
}

}  // namespace previz::test::graphics_cards_test
