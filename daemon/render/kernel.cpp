#include "daemon/render/kernel.hpp"

#include <algorithm>
#include <utility>

#include "drivers/error.hpp"

namespace previz::render {
namespace {

constexpr auto compute = vk::PipelineBindPoint::eCompute;
constexpr auto compute_stage = vk::ShaderStageFlagBits::eCompute;

// The few SPIR-V enumerants that describe a kernel (Khronos, "SPIR-V Specification", 3.32
// Instructions and the tables before it).
enum Op : std::uint32_t {
  op_name = 5,
  op_member_name = 6,
  op_execution_mode = 16,
  op_type_pointer = 32,
  op_constant = 43,
  op_variable = 59,
  op_load = 61,
  op_access_chain = 65,
  op_array_length = 68,
  op_decorate = 71,
  op_execution_mode_id = 331
};
constexpr std::uint32_t spirv_header_words = 5;
constexpr std::uint32_t mode_local_size = 17, mode_local_size_id = 38;
constexpr std::uint32_t decoration_binding = 33;
constexpr std::uint32_t storage_uniform_constant = 0, storage_storage_buffer = 12;

// Everything that a module says about one of its ids.
struct SpirvId {
  const char* name = "";
  const char* first_member = "";  // of a block
  std::uint32_t pointee = 0;      // of a pointer's type: the type that it points to
  std::uint32_t type = 0, storage = 0, binding = 0;  // of a variable
  std::uint32_t value = 0;                           // of a constant
  bool is_used = false;
};

// A variable's name is its own or, where a block without an instance name declares it, that of the
// block's first member. Variables that are declared in a header and not used here have no binding
// of their own: the compiler leaves all of them at 0.
void reflect(std::span<const std::uint32_t> spirv, Program& program) {
  std::vector<SpirvId> ids(spirv[3]);
  std::vector<std::uint32_t> variables;
  std::uint32_t group_size_id = 0;
  for (std::size_t at = spirv_header_words; at < spirv.size(); at += spirv[at] >> 16) {
    const std::uint32_t* const operands = &spirv[at + 1];
    const auto text = [&](int i) { return reinterpret_cast<const char*>(operands + i); };
    switch (spirv[at] & 0xffff) {
      case op_name:
        ids[operands[0]].name = text(1);
        break;
      case op_member_name:
        if (operands[1] == 0) ids[operands[0]].first_member = text(2);
        break;
      case op_execution_mode:
        if (operands[1] == mode_local_size) program.group_size = operands[2];
        break;
      case op_execution_mode_id:
        if (operands[1] == mode_local_size_id) group_size_id = operands[2];
        break;
      case op_decorate:
        if (operands[1] == decoration_binding) ids[operands[0]].binding = operands[2];
        break;
      case op_type_pointer:
        ids[operands[0]].pointee = operands[2];
        break;
      case op_constant:
        ids[operands[1]].value = operands[2];
        break;
      case op_variable:
        ids[operands[1]].type = operands[0];
        ids[operands[1]].storage = operands[2];
        variables.push_back(operands[1]);
        break;
      case op_load:
      case op_access_chain:
      case op_array_length:
        ids[operands[2]].is_used = true;
        break;
      default:
        break;
    }
  }
  if (group_size_id != 0) program.group_size = ids[group_size_id].value;
  for (const std::uint32_t id : variables) {
    const SpirvId& variable = ids[id];
    const bool is_storage = variable.storage == storage_storage_buffer;
    if (!variable.is_used || !(is_storage || variable.storage == storage_uniform_constant))
      continue;
    const char* own = variable.name;
    program.bindings.push_back({*own != 0 ? own : ids[ids[variable.type].pointee].first_member,
                                variable.binding,
                                is_storage ? vk::DescriptorType::eStorageBuffer
                                           : vk::DescriptorType::eUniformTexelBuffer});
  }
}

std::shared_ptr<const Program> compile(const Device& device, std::span<const std::uint32_t> spirv,
                                       std::span<const std::uint32_t> constants) {
  const auto program = std::make_shared<Program>();
  reflect(spirv, *program);
  std::vector<vk::DescriptorSetLayoutBinding> bindings;
  for (const Program::Binding& binding : program->bindings)
    bindings.emplace_back(binding.number, binding.type, 1, compute_stage);
  program->set_layout = vk::raii::DescriptorSetLayout(device.vk(), {{}, bindings});
  const vk::PushConstantRange push(compute_stage, 0, Push::most_bytes);
  program->layout = vk::raii::PipelineLayout(device.vk(), {{}, *program->set_layout, push});

  const vk::raii::ShaderModule module(device.vk(), {{}, spirv.size_bytes(), spirv.data()});
  std::vector<vk::SpecializationMapEntry> entries;
  for (std::uint32_t i = 0; i < constants.size(); ++i) entries.emplace_back(i, 4 * i, 4);
  const vk::SpecializationInfo specialization(static_cast<std::uint32_t>(entries.size()),
                                              entries.data(), constants.size_bytes(),
                                              constants.data());
  const vk::PipelineShaderStageCreateInfo stage({}, compute_stage, *module, "main",
                                                &specialization);
  program->pipeline = vk::raii::Pipeline(
      device.vk(), nullptr, vk::ComputePipelineCreateInfo({}, stage, *program->layout));
  return program;
}

}  // namespace

Kernel::Kernel(Device& device, const char* name, std::span<const std::uint32_t> spirv,
               std::initializer_list<std::uint32_t> constants)
    : device_(&device), name_(name), program_(device.program(spirv.data(), constants, [&] {
        return compile(device, spirv, constants);
      })) {}

Kernel::BoundSet Kernel::create_set() const {
  std::vector<vk::DescriptorPoolSize> sizes;
  for (const Program::Binding& binding : program_->bindings) sizes.emplace_back(binding.type, 1);
  BoundSet result;
  result.pool = vk::raii::DescriptorPool(
      device_->vk(), {vk::DescriptorPoolCreateFlagBits::eFreeDescriptorSet, 1, sizes});
  const vk::DescriptorSetLayout layout = *program_->set_layout;
  result.set = std::move(vk::raii::DescriptorSets(device_->vk(), {*result.pool, layout}).front());
  return result;
}

void Kernel::write(const BoundSet& bound) const {
  const std::vector<Program::Binding>& bindings = program_->bindings;
  std::vector<vk::DescriptorBufferInfo> infos(bindings.size());
  std::vector<vk::BufferView> views(bindings.size());
  std::vector<vk::WriteDescriptorSet> writes;
  for (std::size_t i = 0; i < bindings.size(); ++i) {
    const Buffer& buffer = *bound.buffers[i];
    infos[i] = vk::DescriptorBufferInfo(*buffer.buffer, 0, buffer.size);
    views[i] = *buffer.view;
    writes.emplace_back(*bound.set, bindings[i].number, 0, 1, bindings[i].type, nullptr, &infos[i],
                        &views[i]);
  }
  device_->vk().updateDescriptorSets(writes, {});
}

// Each submission is waited for before the next one is recorded. A set can therefore be written
// when a submission first needs it, and then stays unchanged until the submission ends.
const Kernel::BoundSet& Kernel::bound(const Buffers& buffers) {
  if (submission_ != device_->submissions()) sets_in_use_ = 0;
  submission_ = device_->submissions();
  std::vector<const Buffer*> wanted;
  for (const Program::Binding& binding : program_->bindings) {
    const auto found = buffers.find(binding.name);
    if (found == buffers.end())
      throw Error("Vulkan: pass \"" + name_ + "\" was given no buffer \"" + binding.name + "\"");
    wanted.push_back(found->second);
  }
  const auto end = sets_.begin() + static_cast<std::ptrdiff_t>(sets_in_use_);
  const auto same =
      std::find_if(sets_.begin(), end, [&](const BoundSet& set) { return set.buffers == wanted; });
  if (same != end) return *same;
  if (end == sets_.end()) sets_.push_back(create_set());
  BoundSet& next = sets_[sets_in_use_++];
  next.buffers = std::move(wanted);
  write(next);
  return next;
}

void Kernel::bind(const Recording& recording) {
  const vk::raii::CommandBuffer& commands = recording.commands;
  const std::span<const std::byte> push = recording.push.bytes;
  const vk::DescriptorSet set = *bound(recording.buffers).set;
  if (device_->has_labels()) commands.beginDebugUtilsLabelEXT({name_.c_str()});
  commands.bindPipeline(compute, *program_->pipeline);
  commands.bindDescriptorSets(compute, *program_->layout, 0, set, {});
  commands.pushConstants<std::byte>(*program_->layout, compute_stage, 0,
                                    {static_cast<std::uint32_t>(push.size()), push.data()});
}

void Kernel::finish(const Recording& recording) const {
  barrier(recording.commands);
  if (device_->has_labels()) recording.commands.endDebugUtilsLabelEXT();
}

void Kernel::dispatch(const Recording& recording, std::uint32_t invocations) {
  const std::uint32_t groups =
      invocations / program_->group_size + (invocations % program_->group_size != 0);
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
  recording.commands.dispatchIndirect(*groups.buffer, offset);
  finish(recording);
}

}  // namespace previz::render
