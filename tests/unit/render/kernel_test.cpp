// A compute pass is described by its SPIR-V, takes its buffers by name, and says by its own name
// what is wrong with a dispatch.
#include "daemon/core/render/device/kernel.hpp"

#include "shaders/lib/render_shared.h"
#include "shaders/prepare_shadow.spv.h"
#include "tests/support/render_fixture.hpp"

namespace previz::test::kernel_test {

using render::Buffer;
using render::Buffers;
using render::Device;
using render::Kernel;

// The pass that turns a number of shadow rays into a number of work groups.
Kernel prepare_shadow(Device& device = *shared_device()) {
  return Kernel(device, "prepare_shadow", prepare_shadow_spv, {0});
}

Buffer control_with(std::uint32_t shadow_rays, Device& device = *shared_device()) {
  gpu::GpuControl control{};
  control.shadow_count = shadow_rays;
  Buffer buffer;
  const render::Purpose purpose{"a test", ""};
  render::upload_storage(device, purpose, buffer, std::vector{control});
  return buffer;
}

std::uint32_t groups_in(const Buffer& buffer, Device& device = *shared_device()) {
  return render::download<gpu::GpuControl>(device, buffer, 1).front().shadow_groups[0];
}

void submit(Kernel& kernel, const Buffers& buffers, std::uint32_t invocations = 1,
            Device& device = *shared_device()) {
  const gpu::GpuBatch batch{};
  device.record([&](const vk::raii::CommandBuffer& commands) {
    kernel.dispatch({commands, batch, buffers}, invocations);
  });
}

std::string refusal(Kernel& kernel, const Buffers& buffers, std::uint32_t invocations = 1) {
  return error_of([&] { submit(kernel, buffers, invocations); });
}

TEST(Kernel, AMissingBufferIsNamedWithItsPass) {
  Kernel kernel = prepare_shadow();
  EXPECT_THAT(refusal(kernel, {}),
              AllOf(HasSubstr("\"prepare_shadow\""), HasSubstr("\"control\"")));

  // The device goes on working.
  const Buffer control = control_with(2 * gpu::WORKGROUP_SIZE + 1);
  submit(kernel, {{"control", &control}});
  EXPECT_EQ(groups_in(control), 3u);
  EXPECT_EQ(render::validation_messages(*shared_device()), 0u);
}

TEST(Kernel, MoreWorkGroupsThanTheDeviceAllowsAreRefusedByName) {
  const std::uint32_t most = shared_device()->limits().maxComputeWorkGroupCount[0];
  if (most >= std::numeric_limits<std::uint32_t>::max() / gpu::WORKGROUP_SIZE)
    GTEST_SKIP() << "this device allows more work groups than can be asked for";
  Kernel kernel = prepare_shadow();
  const Buffer control = control_with(1);
  submit(kernel, {{"control", &control}}, most * gpu::WORKGROUP_SIZE);
  EXPECT_EQ(groups_in(control), 1u);
  EXPECT_THAT(refusal(kernel, {{"control", &control}}, most * gpu::WORKGROUP_SIZE + 1),
              AllOf(HasSubstr("\"prepare_shadow\""), HasSubstr(std::to_string(most))));
  EXPECT_EQ(render::validation_messages(*shared_device()), 0u);
}

// Every dispatch of a submission reads the buffers that it was given. So does one of a later
// submission that has fewer dispatches.
TEST(Kernel, DispatchesOfOneSubmissionKeepTheirOwnBuffers) {
  Kernel kernel = prepare_shadow();
  const gpu::GpuBatch batch{};
  for (const std::uint32_t used : {3u, 1u, 4u}) {
    std::vector<Buffer> controls;
    for (std::uint32_t i = 0; i < used; ++i)
      controls.push_back(control_with((i + used) * gpu::WORKGROUP_SIZE));
    shared_device()->record([&](const vk::raii::CommandBuffer& commands) {
      for (int twice : {0, 1}) {
        static_cast<void>(twice);
        for (const Buffer& control : controls) {
          const Buffers buffers{{"control", &control}};
          kernel.dispatch({commands, batch, buffers}, 1);
        }
      }
    });
    for (std::uint32_t i = 0; i < used; ++i) EXPECT_EQ(groups_in(controls[i]), i + used);
  }
  EXPECT_EQ(render::validation_messages(*shared_device()), 0u);
}

// Counts how often `compile` is called for one of two shaders with a constant.
struct Compiler {
  static constexpr std::uint32_t shaders[2] = {};
  Device& device;
  int calls = 0;

  std::shared_ptr<const render::Program> program(int shader, std::uint32_t constant) {
    return device.programs().get(&shaders[shader], std::array{constant}, [&] {
      ++calls;
      return std::make_shared<const render::Program>();
    });
  }
};

TEST(Programs, OfTheSameShaderAndConstantsAreCompiledOnce) {
  Device device({.validation = true, .name = ""});
  Compiler compiler{device};
  const auto first = compiler.program(0, 1);
  EXPECT_NE(compiler.program(0, 2), first);
  EXPECT_NE(compiler.program(1, 1), first);
  EXPECT_EQ(compiler.program(0, 1), first);
  EXPECT_EQ(compiler.calls, 3);
}

TEST(Programs, ThatWereNotWantedForLongAreForgotten) {
  Device device({.validation = true, .name = ""});
  Compiler compiler{device};
  constexpr int most = render::Programs::most;
  for (int i = 0; i < most; ++i) compiler.program(0, static_cast<std::uint32_t>(i));
  compiler.program(0, 0);  // wanted again, so that 1 is the oldest
  EXPECT_EQ(compiler.calls, most);
  compiler.program(1, 0);
  compiler.program(0, 0);
  EXPECT_EQ(compiler.calls, most + 1);
  compiler.program(0, 1);
  EXPECT_EQ(compiler.calls, most + 2);
}

TEST(Programs, AreCompiledAnewForAReopenedDevice) {
  Device device({.validation = true, .name = ""});
  for (int opened = 0; opened < 2; ++opened) {
    Buffer control = control_with(3 * gpu::WORKGROUP_SIZE, device);
    for (int renderer = 0; renderer < 2; ++renderer) {
      Kernel kernel = prepare_shadow(device);
      submit(kernel, {{"control", &control}}, 1, device);
      EXPECT_EQ(groups_in(control, device), 3u);
    }
    control = {};
    if (opened == 0) device.reopen(false);
  }
  EXPECT_EQ(device.validation_messages(), 0u);
}

}  // namespace previz::test::kernel_test
