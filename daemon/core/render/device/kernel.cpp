#include "daemon/core/render/device/kernel.hpp"

#include <algorithm>
#include <cassert>
#include <functional>
#include <map>
#include <mutex>
#include <utility>

#include "daemon/core/render/device/spirv.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/shared.h"

namespace previz::render {
namespace {

constexpr auto compute = vk::PipelineBindPoint::eCompute;
constexpr auto compute_stage = vk::ShaderStageFlagBits::eCompute;

// A pass keeps so many sets of buffers before it writes one anew: the tiles of a large picture, and
// both sides of what is averaged.
constexpr std::size_t most_sets = 64;

vk::DescriptorType descriptor_of(BufferKind kind) {
  switch (kind) {
    case BufferKind::storage:
      return vk::DescriptorType::eStorageBuffer;
    case BufferKind::uniform:
      return vk::DescriptorType::eUniformBuffer;
    case BufferKind::texels:
      return vk::DescriptorType::eUniformTexelBuffer;
    case BufferKind::acceleration_structure:
      return vk::DescriptorType::eAccelerationStructureKHR;
  }
  return {};
}

std::shared_ptr<const Program> compile(const Device& device, const std::string& name,
                                       const std::vector<std::uint32_t>& spirv) {
  const SpirvInfo info = describe_spirv(spirv);
  if (const auto past = past_limits(device.allows(), info, Push::most_bytes))
    throw Error("Vulkan: pass \"" + name + "\" needs " + past->asked + ", but " + device.name() +
                " allows " + std::to_string(past->allowed));
  const auto program = std::make_shared<Program>();
  program->group_size = info.group_size;
  std::vector<vk::DescriptorSetLayoutBinding> bindings;
  for (const SpirvInfo::Binding& binding : info.bindings) {
    const vk::DescriptorType type = descriptor_of(binding.kind);
    program->bindings.push_back({binding.name, binding.number, type});
    bindings.emplace_back(binding.number, type, 1, compute_stage);
  }
  program->set_layout = vk::raii::DescriptorSetLayout(device.vk(), {{}, bindings});
  const vk::PushConstantRange push(compute_stage, 0, Push::most_bytes);
  program->layout = vk::raii::PipelineLayout(device.vk(), {{}, *program->set_layout, push});

  const vk::raii::ShaderModule module(device.vk(), {{}, spirv});
  const vk::PipelineShaderStageCreateInfo stage({}, compute_stage, *module, "main");
  program->pipeline =
      vk::raii::Pipeline(device.vk(), device.programs().cache().get(),
                         vk::ComputePipelineCreateInfo({}, stage, *program->layout));
  return program;
}

// Every module is specialised once a process for the same values, whichever devices it is for: that
// takes longer than all else at the start of a device that has its programs on Mesa's disk cache.
const std::vector<std::uint32_t>& specialised(std::span<const std::uint32_t> spirv,
                                              const std::vector<std::uint32_t>& values) {
  static std::mutex mutex;
  static std::map<std::pair<const std::uint32_t*, std::vector<std::uint32_t>>,
                  std::vector<std::uint32_t>>
      modules;
  const std::pair key(spirv.data(), values);
  {
    const std::lock_guard lock(mutex);
    if (const auto found = modules.find(key); found != modules.end()) return found->second;
  }
  std::vector<std::uint32_t> module = specialise_spirv(spirv, values);  // takes long: unlocked
  const std::lock_guard lock(mutex);
  return modules.try_emplace(key, std::move(module)).first->second;
}

std::vector<std::uint32_t> values_of(const Pass& pass, std::uint32_t features,
                                     std::uint32_t device) {
  return {features, device, pass.parts};
}

std::vector<std::uint32_t> as_for(std::uint32_t device, const std::vector<std::uint32_t>& module) {
  return (device & gpu::DEVICE_LANES_MEET) != 0 ? with_uniform_subgroups(module) : module;
}

// Leaves out the features that the module does not ask about.
std::vector<std::uint32_t> asked_values(std::span<const std::uint32_t> spirv,
                                        std::vector<std::uint32_t> constants) {
  if (!constants.empty()) constants.front() &= describe_spirv(spirv).asked_bits;
  return constants;
}

// A pass with the constants that it reads something of, and the way to compile it.
struct ToCompile {
  ToCompile(const Device& device, const Pass& pass, std::vector<std::uint32_t> constants)
      : spirv(pass.spirv_for(device)), values(asked_values(spirv, std::move(constants))) {
    compile_now = [this, &device, &pass] {
      return compile(device, pass.name, as_for(device_bits(device), specialised(spirv, values)));
    };
  }
  ToCompile(const ToCompile&) = delete;
  ToCompile& operator=(const ToCompile&) = delete;

  const std::span<const std::uint32_t> spirv;
  const std::vector<std::uint32_t> values;
  std::function<std::shared_ptr<const Program>()> compile_now;
};

}  // namespace

std::uint32_t device_bits(const Device& device) {
  return (device.shares_host_memory() ? 0 : gpu::DEVICE_IS_CARD) |
         (device.lanes_meet() ? gpu::DEVICE_LANES_MEET : 0) |
         (device.reads_storage() ? gpu::DEVICE_READS_STORAGE : 0);
}

Kernel::Kernel(Device& device, const char* name, std::span<const std::uint32_t> spirv,
               std::initializer_list<std::uint32_t> constants)
    : device_(&device), name_(name) {
  use(Pass{name, spirv}, constants);
}

Kernel::Kernel(Device& device, const Pass& pass, std::uint32_t features)
    : device_(&device), name_(pass.name) {
  use(pass, values_of(pass, features, device_bits(device)));
}

void Kernel::use(const Pass& pass, std::vector<std::uint32_t> constants) {
  const ToCompile wanted(*device_, pass, std::move(constants));
  state_ = {
      new State{device_->programs().get(wanted.spirv.data(), wanted.values, wanted.compile_now),
                {}},
      Retire<State>{device_}};
}

void make_kernels(std::initializer_list<Kernel*> kernels, Device& device,
                  std::span<const Pass> passes, std::uint32_t features) {
  assert(kernels.size() == passes.size());
  const Pass* pass = passes.data();
  for (Kernel* const kernel : kernels) *kernel = Kernel(device, *pass++, features);
}

std::vector<std::uint32_t> module_of(const Pass& pass, std::uint32_t features,
                                     std::uint32_t device) {
  return as_for(
      device, specialised(pass.spirv, asked_values(pass.spirv, values_of(pass, features, device))));
}

void compile_ahead(Device& device, const Pass& pass, std::uint32_t features) {
  const ToCompile wanted(device, pass, values_of(pass, features, device_bits(device)));
  device.programs().ahead(wanted.spirv.data(), wanted.values, wanted.compile_now);
}

Kernel::BoundSet Kernel::create_set() const {
  std::vector<vk::DescriptorPoolSize> sizes;
  for (const Program::Binding& binding : state_->program->bindings)
    sizes.emplace_back(binding.type, 1);
  BoundSet result;
  result.pool = vk::raii::DescriptorPool(
      device_->vk(), {vk::DescriptorPoolCreateFlagBits::eFreeDescriptorSet, 1, sizes});
  const vk::DescriptorSetLayout layout = *state_->program->set_layout;
  result.set = std::move(vk::raii::DescriptorSets(device_->vk(), {*result.pool, layout}).front());
  return result;
}

// Returns a set that no submission under way uses, the one that was used longest ago if there are
// many.
Kernel::BoundSet& Kernel::free_set() {
  std::vector<BoundSet>& sets = state_->sets;
  if (sets.size() >= most_sets) {
    BoundSet& oldest = *std::ranges::min_element(sets, {}, &BoundSet::submission);
    if (oldest.submission <= device_->submissions().done()) return oldest;
  }
  return sets.emplace_back(create_set());
}

// A live frame uses the buffers of the last one, or of the one before it. A set is therefore
// written once, and used for as long as there are these buffers.
vk::DescriptorSet Kernel::bound(const Buffers& buffers) {
  const std::vector<Program::Binding>& bindings = state_->program->bindings;
  std::vector<const Buffer*> wanted;
  std::vector<std::uint64_t> ids;
  for (const Program::Binding& binding : bindings) {
    const auto found = buffers.find(binding.name);
    if (found == buffers.end())
      throw Error("Vulkan: pass \"" + name_ + "\" was given no buffer \"" + binding.name + "\"");
    wanted.push_back(found->second);
    ids.push_back(found->second->id);
  }
  const auto same = std::ranges::find(state_->sets, ids, &BoundSet::buffers);
  const bool is_written = same != state_->sets.end();
  BoundSet& bound = is_written ? *same : free_set();
  bound.submission = device_->submissions().next();
  if (is_written) return *bound.set;
  bound.buffers = std::move(ids);
  std::vector<vk::DescriptorBufferInfo> infos(bindings.size());
  std::vector<vk::BufferView> views(bindings.size());
  std::vector<vk::WriteDescriptorSetAccelerationStructureKHR> structures(bindings.size());
  std::vector<vk::WriteDescriptorSet> writes;
  for (std::size_t i = 0; i < bindings.size(); ++i) {
    infos[i] = vk::DescriptorBufferInfo(wanted[i]->buffer, 0, wanted[i]->size);
    views[i] = wanted[i]->view;
    writes.emplace_back(*bound.set, bindings[i].number, 0, 1, bindings[i].type, nullptr, &infos[i],
                        &views[i]);
    if (bindings[i].type != vk::DescriptorType::eAccelerationStructureKHR) continue;
    structures[i].setAccelerationStructures(wanted[i]->structure);
    writes.back().pNext = &structures[i];
  }
  device_->vk().updateDescriptorSets(writes, {});
  return *bound.set;
}

void Kernel::bind(const Recording& recording) {
  const vk::raii::CommandBuffer& commands = recording.commands;
  const std::span<const std::byte> push = recording.push.bytes;
  const vk::DescriptorSet set = bound(recording.buffers);
  if (device_->has_labels()) commands.beginDebugUtilsLabelEXT({name_.c_str()});
  device_->clock().start(commands, name_);
  commands.bindPipeline(compute, *state_->program->pipeline);
  commands.bindDescriptorSets(compute, *state_->program->layout, 0, set, {});
  commands.pushConstants<std::byte>(*state_->program->layout, compute_stage, 0,
                                    {static_cast<std::uint32_t>(push.size()), push.data()});
}

void Kernel::finish(const Recording& recording) const {
  device_->clock().stop(recording.commands);
  device_->submissions().barrier(recording.commands);
  if (device_->has_labels()) recording.commands.endDebugUtilsLabelEXT();
}

void Kernel::dispatch(const Recording& recording, std::uint32_t invocations) {
  const std::uint32_t groups =
      invocations / state_->program->group_size + (invocations % state_->program->group_size != 0);
  const std::uint32_t most = device_->limits().maxComputeWorkGroupCount[0];
  if (groups > most)
    throw Error("Vulkan: pass \"" + name_ + "\" needs " + std::to_string(groups) +
                " work groups, but " + device_->name() + " allows " + std::to_string(most));
  bind(recording);
  recording.commands.dispatch(groups, 1, 1);
  finish(recording);
}

void Kernel::dispatch_indirect(const Recording& recording, const Buffer& groups,
                               vk::DeviceSize offset) {
  bind(recording);
  recording.commands.dispatchIndirect(groups.buffer, offset);
  finish(recording);
}

}  // namespace previz::render
