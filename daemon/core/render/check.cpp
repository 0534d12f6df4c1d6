#include "daemon/core/render/check.hpp"

#include <cmath>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/render/device/graphics_cards.hpp"
#include "daemon/core/render/passes/photon_schedule.hpp"
#include "daemon/core/render/picture/picture_memory.hpp"
#include "daemon/core/render/picture/sample_sums.hpp"
#include "daemon/core/render/world/feature.hpp"
#include "daemon/core/set/check.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

using set::grouped;
using set::plural;
using set::words;

void print_features(const Demand& demand, const scene::Size& size, std::ostream& out) {
  std::vector<std::string> used;
  std::string unused;
  for (const Feature& feature : features())
    if (is_needed(feature, demand))
      used.push_back(words(feature.name, ": ", feature.used));
    else
      add_to_list(unused, feature.name);
  out << "\nthis set uses\n  geometry: " << plural(size.triangles, "triangle") << ", or "
      << grouped(size.instanced_triangles) << " counting every copy of an object\n";
  for (const auto& line : used) out << "  " << line << '\n';
  out << "\nnot used by this set, so switched off\n  " << unused << '\n';
}

constexpr double mebibyte = 1024.0 * 1024.0;

void print_picture_memory(const set::Quality& quality, const PinholeIntrinsics& intrinsics,
                          std::ostream& out) {
  const bool averaged_live = quality.denoise && quality.accumulate;
  const bool averaged_offline = quality.denoise && quality.neighbours > 0;
  std::uint64_t bytes = picture_bytes(intrinsics.width, intrinsics.height, false);
  if (averaged_live || averaged_offline)
    bytes += history_bytes(intrinsics.width, intrinsics.height);
  const auto mebibytes = [](std::uint64_t count) {
    return std::ceil(static_cast<double>(count) / mebibyte);
  };
  out << words("  picture in the GPU's memory: about ", mebibytes(bytes), " MiB\n");
  const TakeMemory offline = take_memory({.width = intrinsics.width,
                                          .height = intrinsics.height,
                                          .each_side = averaged_offline ? quality.neighbours : 0,
                                          .take_frames = std::numeric_limits<std::uint64_t>::max(),
                                          .parts = part_count(quality.samples)},
                                         {});
  out << words("  offline, in the computer's memory: about ", mebibytes(offline.whole()),
               " MiB, or ", mebibytes(offline.rest), " MiB and scratch files of ",
               mebibytes(offline.banded), " MiB\n");
}

void print_costs(const set::Set& set, std::uint32_t needed, const scene::Size& size,
                 std::ostream& out) {
  // These are the bytes a vertex, triangle and texel in lib/render_shared.h's buffers; a tree of
  // pairs takes about one record of 64 bytes a triangle.
  // Levels of textures take a third more.
  const double a_texel = (needed & gpu::FEATURE_FILTERED_TEXTURES) != 0 ? 8.0 * 4 / 3 : 8.0;
  const double scene_bytes =
      32.0 * size.vertices + (16.0 + 64.0) * size.triangles + a_texel * size.texels;
  constexpr auto any_number = std::numeric_limits<std::uint32_t>::max();
  out << "\na frame costs\n";
  out << words("  scene in the GPU's memory: about ", std::ceil(scene_bytes / mebibyte), " MiB\n");
  if (!set.observer.calibration) return;
  const auto& intrinsics = set.observer.calibration->intrinsics;
  const double pixels = static_cast<double>(intrinsics.width) * intrinsics.height;
  const double samples = pixels * set.quality.samples;
  print_picture_memory(set.quality, intrinsics, out);
  // A path has a segment and a light sample a bounce, and one more segment; twice as many where the
  // worlds part.
  const double most = samples * (2.0 * set.estimation.max_depth + 1) *
                      ((needed & gpu::FEATURE_FORKS) != 0 ? 2.0 : 1.0);
  out << "  rays: " << grouped(static_cast<std::uint64_t>(2 * samples)) << " at least, "
      << grouped(static_cast<std::uint64_t>(most)) << " at most\n";
  if ((needed & gpu::FEATURE_PHOTONS) != 0)
    out << "  photons: "
        << grouped(std::uint64_t{photon_count(set.estimation.photons, intrinsics.width,
                                              intrinsics.height, any_number)} *
                   static_cast<std::uint64_t>(set.quality.samples))
        << '\n';
}

}  // namespace

void describe(const set::Set& set, const scene::Scene& scene, std::ostream& out) {
  const scene::Size size = scene::size_of(scene);
  const Demand demand =
      demand_of(set, scene, material_features(scene, set.estimation.specular_roughness));
  print_features(demand, size, out);
  print_costs(set, needed_bits(demand), size, out);
}

void describe_computer(std::ostream& out) {
  out << "\nthis computer\n";
  try {
    const DeviceFacts facts = facts_of(*open_device({}));
    const std::string name = facts.name + " (" + facts.driver + ")";
    out << (facts.is_gpu ? "  draws with " + name
                         : "  draws on the processor, by " + name + ": no graphics card is used")
        << words("; memory: ",
                 std::floor(static_cast<double>(facts.memory_bytes) / (1024 * mebibyte)), " GiB\n");
    for (const std::string& missing : facts.missing_drivers) out << "  " << missing << '\n';
  } catch (const Error& error) {
    out << "  " << error.what() << '\n';
  }
  const std::string advice = screen_advice(graphics_cards());
  if (!advice.empty()) out << "  " << advice << '\n';
}

}  // namespace previz::render
