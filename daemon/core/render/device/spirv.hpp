// Reads what a SPIR-V module says about itself, and leaves out of it what its specialisation
// constants switch off.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace previz::render {

enum class BufferKind { storage, uniform, texels, acceleration_structure };

struct SpirvInfo {
  struct Binding {
    std::string name;  // as the shader calls the buffer
    std::uint32_t number;
    BufferKind kind;
  };
  std::vector<Binding> bindings;  // of the buffers that the module uses
  std::uint32_t group_size = 1;
  // The bits of specialisation constant 0 that the module asks about; the others make no
  // difference.
  std::uint32_t asked_bits = 0;
};

// `spirv` is a valid module with one entry point, whose names were not stripped.
SpirvInfo describe_spirv(std::span<const std::uint32_t> spirv);

// Returns the module with the value constants[i] in place of specialisation constant i, without the
// branches that are never taken then. Drivers inline and optimise a whole module before they look
// at its constants, which takes a multiple of the time. Throws previz::Error if SPIRV-Tools cannot.
std::vector<std::uint32_t> specialise_spirv(std::span<const std::uint32_t> spirv,
                                            std::span<const std::uint32_t> constants);

// Returns the module with a promise to the driver's compiler that it rests on: the lanes of a
// subgroup are together again behind a branch that only some of them took
// (SPV_KHR_subgroup_uniform_control_flow). A module that asks nothing of its subgroup stays as it
// is.
std::vector<std::uint32_t> with_uniform_subgroups(std::span<const std::uint32_t> spirv);

}  // namespace previz::render
