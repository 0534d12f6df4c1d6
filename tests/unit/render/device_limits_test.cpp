// What a device does not allow is said with both numbers, before a driver is asked for it.
#include "daemon/core/render/device/device_limits.hpp"

#include "daemon/core/render/device/buffer.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::device_limits_test {

using render::DeviceLimits, render::past_limits, render::SpirvInfo;

// A pass with five storage and three texel buffers, 64 invocations and 128 bytes of push constants,
// a buffer of 4,096 bytes and 512 texels, and a device that allows just that.
constexpr std::uint32_t push_bytes = 128;
constexpr DeviceLimits just_enough{5, 3, 8, 64, 64, 128, 4096, 4096, 4096, 512};

SpirvInfo pass() {
  SpirvInfo info;
  for (std::uint32_t i = 0; i < 8; ++i)
    info.bindings.push_back(
        {"buffer", i, i < 5 ? render::BufferKind::storage : render::BufferKind::texels});
  info.group_size = 64;
  return info;
}

void expect_past(const std::optional<render::PastLimit>& past, const char* asked,
                 std::uint64_t allowed) {
  ASSERT_TRUE(past) << asked;
  EXPECT_EQ(past->asked, asked);
  EXPECT_EQ(past->allowed, allowed);
}

TEST(DeviceLimits, AllowWhatIsJustEnough) {
  EXPECT_FALSE(past_limits(just_enough, pass(), push_bytes));
  EXPECT_FALSE(past_limits(just_enough, {4096, 512, true}));
  EXPECT_FALSE(past_limits(just_enough, {4096, 0, false}));
}

TEST(DeviceLimits, OfAPassAreNamedWithBothNumbers) {
  const struct {
    std::uint32_t DeviceLimits::*limit;
    const char* words;
  } cases[] = {{&DeviceLimits::storage_buffers, "5 storage buffers"},
               {&DeviceLimits::texel_buffers, "3 texel buffers"},
               {&DeviceLimits::buffers, "8 buffers"},
               {&DeviceLimits::group_invocations, "64 invocations in a work group"},
               {&DeviceLimits::group_width, "64 invocations across a work group"},
               {&DeviceLimits::push_bytes, "128 bytes of push constants"}};
  for (const auto& each : cases) {
    DeviceLimits limits = just_enough;
    --(limits.*each.limit);
    expect_past(past_limits(limits, pass(), push_bytes), each.words, limits.*each.limit);
  }
}

TEST(DeviceLimits, OfABufferAreNamedWithBothNumbers) {
  const struct {
    std::uint64_t DeviceLimits::*limit;
    const char* words;
  } cases[] = {{&DeviceLimits::texels, "512 texels"},
               {&DeviceLimits::storage_bytes, "4096 bytes in a storage buffer"},
               {&DeviceLimits::buffer_bytes, "4096 bytes in a buffer"},
               {&DeviceLimits::allocation_bytes, "4096 bytes in an allocation"}};
  for (const auto& each : cases) {
    DeviceLimits limits = just_enough;
    --(limits.*each.limit);
    expect_past(past_limits(limits, {4096, 512, true}), each.words, limits.*each.limit);
  }
  // What is only read as texels may be larger than a storage buffer.
  DeviceLimits small = just_enough;
  small.storage_bytes = 16;
  EXPECT_FALSE(past_limits(small, {4096, 512, false}));
}

// The device's own limits are read from where Vulkan keeps them, and a buffer past them is refused
// in words that name the device, before any memory is taken.
TEST(DeviceLimits, OfThisDeviceRefuseABufferByName) {
  render::Device& device = *shared_device();
  const DeviceLimits& allows = device.allows();
  EXPECT_EQ(allows.storage_bytes, device.limits().maxStorageBufferRange);
  EXPECT_GE(allows.buffer_bytes, 1u << 30) << "what Vulkan 1.3 asks of every device";
  EXPECT_GE(allows.allocation_bytes, 1u << 30);
  EXPECT_GE(allows.push_bytes, push_bytes);
  const auto create_past_it = [&] {
    const render::Purpose purpose{"the texels of a test", "use fewer"};
    render::create_texel_buffer(device, purpose,
                                std::max(16 * allows.texels, allows.storage_bytes) + 16,
                                vk::Format::eR32G32B32A32Sfloat);
  };
  EXPECT_THAT(error_of(create_past_it),
              AllOf(HasSubstr(device.name()),
                    HasSubstr(std::to_string(device.reads_storage() ? allows.storage_bytes
                                                                    : allows.texels)),
                    HasSubstr("for the texels of a test needs "), HasSubstr("; use fewer")));
  EXPECT_EQ(render::validation_messages(device), 0u);
}

}  // namespace previz::test::device_limits_test
