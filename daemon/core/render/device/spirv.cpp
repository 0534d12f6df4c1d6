#include "daemon/core/render/device/spirv.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>
#include <spirv-tools/optimizer.hpp>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "drivers/error.hpp"

namespace previz::render {
namespace {

// The few SPIR-V enumerants that describe a kernel (Khronos, "SPIR-V Specification", 3.32
// Instructions and the tables before it).
enum Op : std::uint32_t {
  op_name = 5,
  op_member_name = 6,
  op_extension = 10,
  op_entry_point = 15,
  op_execution_mode = 16,
  op_capability = 17,
  op_type_pointer = 32,
  op_constant = 43,
  op_spec_constant = 50,
  op_spec_constant_op = 52,
  op_variable = 59,
  op_load = 61,
  op_access_chain = 65,
  op_array_length = 68,
  op_decorate = 71,
  op_bitwise_and = 199,
  op_execution_mode_id = 331,
  op_type_acceleration_structure = 5341
};
constexpr std::uint32_t spirv_header_words = 5;
constexpr std::uint32_t mode_local_size = 17, mode_local_size_id = 38;
constexpr std::uint32_t mode_subgroup_uniform_control_flow = 4421;
constexpr std::uint32_t capability_group_non_uniform = 61;
constexpr std::uint32_t decoration_spec_id = 1, decoration_binding = 33;
// One buffer that is seen in two ways (shaders/lib/fetch.glsl).
constexpr std::string_view storage_suffix = "_storage", texels_suffix = "_texels";
constexpr std::uint32_t storage_uniform_constant = 0, storage_uniform = 2,
                        storage_storage_buffer = 12;

// Everything that a module says about one of its ids.
struct SpirvId {
  const char* name = "";
  const char* first_member = "";  // of a block
  std::uint32_t pointee = 0;      // of a pointer's type: the type that it points to
  std::uint32_t type = 0, storage = 0, binding = 0;  // of a variable
  std::uint32_t value = 0;                           // of a constant
  bool is_used = false;
  bool is_acceleration_structure = false;  // of a type
};

// Collects what specialisation constant 0 is masked with.
struct Masks {
  std::uint32_t constant = 0;  // its id
  const std::vector<SpirvId>* ids = nullptr;
  std::uint32_t bits = 0;
};

// What one instruction does with it. Its own definition, its name and its decoration do nothing.
spv_result_t add_masks(void* user, const spv_parsed_instruction_t* instruction) {
  Masks& masks = *static_cast<Masks*>(user);
  const std::span operands(instruction->operands, instruction->num_operands);
  const auto id_of = [&](const spv_parsed_operand_t& operand) {
    return operand.type == SPV_OPERAND_TYPE_ID ? instruction->words[operand.offset] : 0;
  };
  const auto is_constant = [&](const auto& operand) { return id_of(operand) == masks.constant; };
  const std::uint32_t op = instruction->opcode;
  if (op == op_name || op == op_decorate || std::ranges::none_of(operands, is_constant))
    return SPV_SUCCESS;
  const bool is_mask = op == op_bitwise_and ||
                       (op == op_spec_constant_op && instruction->words[3] == op_bitwise_and);
  const std::uint32_t a = id_of(operands[operands.size() - 2]), b = id_of(operands.back());
  masks.bits |= is_mask ? (*masks.ids)[a == masks.constant ? b : a].value : ~0u;
  return SPV_SUCCESS;
}

// Returns the constants with which specialisation constant 0 is masked; all bits if it is used in
// any other way.
std::uint32_t asked_bits(std::span<const std::uint32_t> spirv, const std::vector<SpirvId>& ids,
                         std::uint32_t constant) {
  if (constant == 0) return 0;
  Masks masks{constant, &ids};
  const spvtools::Context context(SPV_ENV_VULKAN_1_3);
  if (spvBinaryParse(context.CContext(), &masks, spirv.data(), spirv.size(), nullptr, add_masks,
                     nullptr) != SPV_SUCCESS)
    return ~0u;
  return masks.bits;
}

}  // namespace

// A variable's name is its own or, where a block without an instance name declares it, that of the
// block's first member, without the suffix of what is fetched. Variables that are declared in a
// header and not used here have no binding of their own: the compiler leaves all of them at 0.
SpirvInfo describe_spirv(std::span<const std::uint32_t> spirv) {
  SpirvInfo info;
  std::vector<SpirvId> ids(spirv[3]);
  std::vector<std::uint32_t> variables;
  std::uint32_t group_size_id = 0, feature_id = 0;
  for (std::size_t at = spirv_header_words; at < spirv.size(); at += spirv[at] >> 16) {
    const std::uint32_t* const operands = spirv.data() + at + 1;  // none of the last instruction
    const auto text = [&](int i) { return reinterpret_cast<const char*>(operands + i); };
    switch (spirv[at] & 0xffff) {
      case op_name:
        ids[operands[0]].name = text(1);
        break;
      case op_member_name:
        if (operands[1] == 0) ids[operands[0]].first_member = text(2);
        break;
      case op_execution_mode:
        if (operands[1] == mode_local_size) info.group_size = operands[2];
        break;
      case op_execution_mode_id:
        if (operands[1] == mode_local_size_id) group_size_id = operands[2];
        break;
      case op_decorate:
        if (operands[1] == decoration_binding) ids[operands[0]].binding = operands[2];
        if (operands[1] == decoration_spec_id && operands[2] == 0) feature_id = operands[0];
        break;
      case op_type_pointer:
        ids[operands[0]].pointee = operands[2];
        break;
      case op_constant:
        ids[operands[1]].value = operands[2];
        break;
      case op_type_acceleration_structure:
        ids[operands[0]].is_acceleration_structure = true;
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
  if (group_size_id != 0) info.group_size = ids[group_size_id].value;
  for (const std::uint32_t id : variables) {
    const SpirvId& variable = ids[id];
    const bool is_storage = variable.storage == storage_storage_buffer;
    const bool is_uniform = variable.storage == storage_uniform;
    if (!variable.is_used ||
        !(is_storage || is_uniform || variable.storage == storage_uniform_constant))
      continue;
    const SpirvId& type = ids[ids[variable.type].pointee];
    std::string_view name = *variable.name != 0 ? variable.name : type.first_member;
    const std::string_view suffix = is_storage ? storage_suffix : texels_suffix;
    if (name.ends_with(suffix)) name.remove_suffix(suffix.size());
    const BufferKind kind = is_storage                       ? BufferKind::storage
                            : is_uniform                     ? BufferKind::uniform
                            : type.is_acceleration_structure ? BufferKind::acceleration_structure
                                                             : BufferKind::texels;
    info.bindings.push_back({std::string(name), variable.binding, kind});
  }
  info.asked_bits = asked_bits(spirv, ids, feature_id);
  return info;
}

// Extensions follow the capabilities, and modes the entry point.
std::vector<std::uint32_t> with_uniform_subgroups(std::span<const std::uint32_t> spirv) {
  static constexpr char extension[] = "SPV_KHR_subgroup_uniform_control_flow";
  std::array<std::uint32_t, sizeof(extension) / 4 + 1> name{};
  std::memcpy(name.data(), extension, sizeof(extension));
  std::vector<std::uint32_t> result(spirv.begin(), spirv.begin() + spirv_header_words);
  bool asks = false, named = false;
  for (std::size_t at = spirv_header_words; at < spirv.size(); at += spirv[at] >> 16) {
    const std::uint32_t op = spirv[at] & 0xffff;
    asks |= op == op_capability && spirv[at + 1] == capability_group_non_uniform;
    if (op != op_capability && !std::exchange(named, true)) {
      result.push_back(static_cast<std::uint32_t>(name.size() + 1) << 16 | op_extension);
      std::ranges::copy(name, std::back_inserter(result));
    }
    result.insert(result.end(), spirv.begin() + static_cast<std::ptrdiff_t>(at),
                  spirv.begin() + static_cast<std::ptrdiff_t>(at + (spirv[at] >> 16)));
    if (op == op_entry_point)
      result.insert(result.end(), {3u << 16 | op_execution_mode, spirv[at + 2],
                                   mode_subgroup_uniform_control_flow});
  }
  return asks ? result : std::vector<std::uint32_t>(spirv.begin(), spirv.end());
}

std::vector<std::uint32_t> specialise_spirv(std::span<const std::uint32_t> spirv,
                                            std::span<const std::uint32_t> constants) {
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> values;
  for (std::uint32_t i = 0; i < constants.size(); ++i) values[i] = {constants[i]};
  std::string complaint;
  spvtools::Optimizer optimizer(SPV_ENV_VULKAN_1_3);
  optimizer.SetMessageConsumer([&](spv_message_level_t, const char*, const spv_position_t&,
                                   const char* message) { complaint = message; });
  optimizer.RegisterPass(spvtools::CreateSetSpecConstantDefaultValuePass(values))
      .RegisterPass(spvtools::CreateFreezeSpecConstantValuePass())
      .RegisterPass(spvtools::CreateFoldSpecConstantOpAndCompositePass())
      .RegisterPass(spvtools::CreateCCPPass())
      .RegisterPass(spvtools::CreateDeadBranchElimPass());
  spvtools::OptimizerOptions options;
  options.set_run_validator(false);  // the validation layer looks at the result
  std::vector<std::uint32_t> result;
  if (!optimizer.Run(spirv.data(), spirv.size(), &result, options))
    throw Error("Vulkan: a shader cannot be specialised: " + complaint);
  return result;
}

}  // namespace previz::render
