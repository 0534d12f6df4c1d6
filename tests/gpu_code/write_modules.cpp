// Writes every pass of the renderer as the driver of a graphics card gets it:
//   gpu_code_modules SET_FILE FOLDER
// makes FOLDER/<features>.<pass>.spv, and beside each a file .bindings with a line for each buffer,
// "number storage", "number texels" or "number structure". The features are those of the set, and
// all that there are. Passes that trace rays are there a second time, as <pass>_query, for a card
// that has units for them.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "daemon/core/render/device/spirv.hpp"
#include "daemon/core/render/passes/passes.hpp"
#include "daemon/core/render/world/feature.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/set/load.hpp"
#include "shaders/deform.spv.h"
#include "shaders/lib/shared.h"
#include "shaders/refit_leaves.spv.h"
#include "shaders/refit_nodes.spv.h"

namespace {

using previz::render::Pass;

// All five GPUs keep their lanes together.
constexpr std::uint32_t card = previz::gpu::DEVICE_IS_CARD | previz::gpu::DEVICE_LANES_MEET |
                               previz::gpu::DEVICE_READS_STORAGE;

const char* words_for(previz::render::BufferKind kind) {
  using previz::render::BufferKind;
  return kind == BufferKind::storage   ? "storage"
         : kind == BufferKind::uniform ? "uniform"
         : kind == BufferKind::texels  ? "texels"
                                       : "structure";
}

void write(const std::filesystem::path& stem, const Pass& pass, std::uint32_t features) {
  const std::vector<std::uint32_t> module = previz::render::module_of(pass, features, card);
  std::ofstream code(stem.string() + ".spv", std::ios::binary);
  code.write(reinterpret_cast<const char*>(module.data()),
             static_cast<std::streamsize>(module.size() * sizeof(std::uint32_t)));
  std::ofstream bindings(stem.string() + ".bindings");
  for (const auto& binding : previz::render::describe_spirv(module).bindings)
    bindings << binding.number << ' ' << words_for(binding.kind) << '\n';
  code.close();
  bindings.close();
  if (!code || !bindings) throw std::runtime_error(stem.string() + ": cannot be written");
}

void write_all(const std::filesystem::path& folder, const std::string& name,
               std::uint32_t features) {
  std::vector<Pass> passes = previz::render::passes_for(features, card);
  passes.push_back({"deform", deform_spv});
  passes.push_back({"refit_leaves", refit_leaves_spv});
  passes.push_back({"refit_nodes", refit_nodes_spv});
  for (const Pass& pass : passes) {
    const std::filesystem::path stem = folder / (name + "." + pass.name);
    write(stem, pass, features);
    const Pass by_query{pass.name, pass.query};
    if (!pass.query.empty()) write(stem.string() + "_query", by_query, features);
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc != 3) throw std::runtime_error("gpu_code_modules SET_FILE FOLDER");
    const previz::set::Set set = previz::set::load_set(argv[1]);
    const auto scene = previz::scene::load_scene(set);
    const std::filesystem::path folder = argv[2];
    std::filesystem::create_directories(folder);
    write_all(folder, "demo", previz::render::reachable_bits(set, scene, true).front());
    write_all(folder, "all", ~0u);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "gpu_code_modules: %s\n", error.what());
    return 1;
  }
  return 0;
}
