// A kernel is a compute pass, described by its name and its SPIR-V alone. The bindings, the
// pipeline and the size of a work group are read out of the SPIR-V, and a dispatch takes its
// buffers by the names that the shader gives them.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "daemon/core/render/device/buffer.hpp"

namespace previz::render {

// Maps the names of the shaders' variables to buffers. A pass takes those that it declares and
// uses; what it fetches it takes by the name that it fetches it by (shaders/lib/fetch.glsl).
using Buffers = std::map<std::string_view, const Buffer*>;

// The push constants of a dispatch: a structure of shaders/lib/render_shared.h.
struct Push {
  static constexpr std::uint32_t most_bytes = 128;  // every Vulkan device has at least this many
  template <typename T>
  Push(const T& values) : bytes(std::as_bytes(std::span(&values, 1))) {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= most_bytes);
  }
  std::span<const std::byte> bytes;
};

// A command buffer, and the arguments that the dispatches recorded into it share.
struct Recording {
  const vk::raii::CommandBuffer& commands;
  Push push;
  const Buffers& buffers;
};

// A pass in compiled form. All kernels of a device with the same SPIR-V and constants share it.
struct Program {
  struct Binding {
    std::string name;
    std::uint32_t number;
    vk::DescriptorType type;
  };
  std::vector<Binding> bindings;
  std::uint32_t group_size = 1;
  vk::raii::DescriptorSetLayout set_layout{nullptr};
  vk::raii::PipelineLayout layout{nullptr};
  vk::raii::Pipeline pipeline{nullptr};
};

// A pass has what its kernel is made of. Its specialisation constant 0 has the FEATURE_* bits, 1
// the device's DEVICE_* bits, and 2 `parts`.
struct Pass {
  const char* name;
  std::span<const std::uint32_t> spirv;  // static
  // The same pass for a device that traces rays in hardware; empty: it traces none.
  std::span<const std::uint32_t> query = {};
  std::uint32_t parts = 0;  // that it does of a pass which consists of parts

  std::span<const std::uint32_t> spirv_for(const Device& device) const {
    return device.traces_in_hardware() && !query.empty() ? query : spirv;
  }
};

class Kernel {
 public:
  Kernel() = default;  // cannot be dispatched
  // `spirv` is static; `constants[i]` is specialisation constant i (32 bits each).
  Kernel(Device& device, const char* name, std::span<const std::uint32_t> spirv,
         std::initializer_list<std::uint32_t> constants = {});
  // `features` are FEATURE_* bits.
  Kernel(Device& device, const Pass& pass, std::uint32_t features);

  // Record the pass, under a debug label with its name, and a barrier after it. The first runs as
  // many work groups as `invocations` need, the second the number of groups stored in an indirect
  // buffer at `offset`. Both throw previz::Error naming the pass where a buffer that it uses is
  // missing; the first also where the device does not allow so many groups.
  void dispatch(const Recording& recording, std::uint32_t invocations);
  void dispatch_indirect(const Recording& recording, const Buffer& groups, vk::DeviceSize offset);

 private:
  struct BoundSet {
    std::vector<std::uint64_t> buffers;  // their ids, in the order of the program's bindings
    vk::raii::DescriptorPool pool{nullptr};
    vk::raii::DescriptorSet set{nullptr};
    std::uint64_t submission = 0;  // the last one that uses it
  };
  // Kept until the device is done with it.
  struct State {
    std::shared_ptr<const Program> program;
    std::vector<BoundSet> sets;  // for the buffers of the last dispatches
  };

  void use(const Pass& pass, std::vector<std::uint32_t> constants);
  void bind(const Recording& recording);
  void finish(const Recording& recording) const;
  vk::DescriptorSet bound(const Buffers& buffers);
  BoundSet& free_set();
  BoundSet create_set() const;

  Device* device_ = nullptr;
  std::string name_;
  std::unique_ptr<State, Retire<State>> state_;
};

// Makes each of the kernels of the pass in its place.
void make_kernels(std::initializer_list<Kernel*> kernels, Device& device,
                  std::span<const Pass> passes, std::uint32_t features = 0);

// Returns what the device is, as DEVICE_* bits.
std::uint32_t device_bits(const Device& device);

// Returns the SPIR-V that a driver gets for a pass: without what the features switch off, and as it
// is for a device with these DEVICE_* bits.
std::vector<std::uint32_t> module_of(const Pass& pass, std::uint32_t features,
                                     std::uint32_t device);

// Compiles the program of a kernel, unless that has been done or is under way, so that the kernel
// need not wait for it. May be called on any thread while the device is open. Throws
// previz::Error or vk::SystemError where it cannot be compiled; the kernel then tries again.
void compile_ahead(Device& device, const Pass& pass, std::uint32_t features);

}  // namespace previz::render
