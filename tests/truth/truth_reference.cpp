// Renders truth frames with the reference CPU tracer and compares: whether the truth and our
// material models are the same, without the renderer under test.
#include <chrono>
#include <cstdio>
#include <iostream>

#include "daemon/lighting/lighting.hpp"
#include "daemon/scene/load.hpp"
#include "drivers/error.hpp"
#include "tests/bench/program.hpp"
#include "tests/truth/compare.hpp"
#include "tests/truth/cpu_camera.hpp"
#include "tests/truth/cpu_tracer.hpp"
#include "tests/truth/truth_set.hpp"

namespace previz::truth {
namespace {

// Each pixel of the small picture repeated, so that 8x8 block means stay what they are. (Clipping
// then acts on the small pixel's mean: mirror images of lamps need --scale 1.)
template <class T, class From>
std::vector<T> enlarged(const std::vector<From>& small, int width, int height, int times) {
  std::vector<T> out;
  out.reserve(small.size() * static_cast<std::size_t>(times * times));
  for (int y = 0; y < height * times; ++y) {
    for (int x = 0; x < width * times; ++x) {
      out.emplace_back(small[static_cast<std::size_t>(y / times * width + x / times)]);
    }
  }
  return out;
}

EstimatedFrame estimated(const TruthFrame& truth, const TracedPicture& mixed,
                         const TracedPicture& real, int reduction) {
  EstimatedFrame out;
  out.mixed = enlarged<glm::vec3>(mixed.mean, mixed.width, mixed.height, reduction);
  out.real = enlarged<glm::vec3>(real.mean, mixed.width, mixed.height, reduction);
  out.mask = enlarged<float>(mixed.mask, mixed.width, mixed.height, reduction);
  for (std::size_t i = 0; i < out.mixed.size(); ++i) out.diff.push_back(out.mixed[i] - out.real[i]);
  return composited(truth, out);
}

EstimatedFrame mean_of(const TruthFrame& truth, const EstimatedFrame& a, const EstimatedFrame& b) {
  EstimatedFrame out = a;
  for (std::size_t i = 0; i < a.mask.size(); ++i) {
    out.mixed[i] = 0.5F * (a.mixed[i] + b.mixed[i]);
    out.real[i] = 0.5F * (a.real[i] + b.real[i]);
    out.diff[i] = 0.5F * (a.diff[i] + b.diff[i]);
    out.mask[i] = 0.5F * (a.mask[i] + b.mask[i]);
  }
  return composited(truth, out);
}

// Truth with half the difference of the halves added: as far from truth as their mean is by chance.
EstimatedFrame noise_of(const TruthFrame& truth, const EstimatedFrame& a, const EstimatedFrame& b) {
  EstimatedFrame out = a;
  for (std::size_t i = 0; i < a.mask.size(); ++i) {
    out.mixed[i] = truth.mixed[i] + 0.5F * (a.mixed[i] - b.mixed[i]);
    out.real[i] = truth.real[i] + 0.5F * (a.real[i] - b.real[i]);
    out.diff[i] = truth.mixed[i] - truth.real[i] + 0.5F * (a.diff[i] - b.diff[i]);
    out.mask[i] = truth.mask[i];
  }
  return composited(truth, out);
}

void run(const std::filesystem::path& directory, int frame, int reduction, int samples) {
  const TruthSet truth_set = load_truth_set(directory);
  const TruthFrame truth = load_truth_frame(truth_set, frame);
  if (truth.width % reduction || truth.height % reduction) {
    throw Error("the picture's size is not a multiple of " + std::to_string(reduction));
  }
  set::Set set;
  const auto object = [](const char* name, const std::filesystem::path& file, set::Presence p) {
    set::Object o;
    o.name = name;
    o.file = file;
    o.file_as_written = file.string();
    o.presence = p;
    return o;
  };
  set.objects = {object("phantom", truth_set.phantom, set::Presence::phantom),
                 object("virtual", truth_set.virtual_objects, set::Presence::virtual_object)};
  set.lighting.environment = truth_set.environment;
  set.lighting.environment_as_written = truth_set.environment.string();
  const scene::Scene scene = scene::load_scene(set);
  for (const std::string& note : scene.notes) std::cerr << "scene: " << note << std::endl;
  const lighting::Lighting lighting = lighting::load_environment(set.lighting);
  std::cerr << "environment: " << lighting.environment.size << " texels a side" << std::endl;

  const auto begin = std::chrono::steady_clock::now();
  CpuTracer tracer(scene, lighting.environment);
  const ObserverCalibration camera = resized(truth_set.observer, 1.0 / reduction);
  const glm::dmat4 pose = observer_frame(truth_set, frame).world_from_camera;
  // Two independent halves show the estimate's own noise. The same random numbers in both worlds:
  // what the virtual objects do not touch cancels.
  const auto half = [&](std::uint64_t seed) {
    return estimated(truth, tracer.trace(camera, pose, scene::world_mixed, samples / 2, seed),
                     tracer.trace(camera, pose, scene::world_real, samples / 2, seed), reduction);
  };
  const EstimatedFrame a = half(1);
  const EstimatedFrame b = half(2);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const Measures m = compare(truth, mean_of(truth, a, b));
  const Measures noise = compare(truth, noise_of(truth, a, b));

  std::printf("%s frame %s, 1/%d, %d samples, %.0f s\n", truth_set.name.c_str(),
              frame_name(frame).c_str(), reduction, samples, seconds);
  const auto print = [](const char* what, double error, double bias, double own,
                        const std::optional<double>& of_truth) {
    std::printf("  %-8s error %.4f, of which noise %.4f (truth's %.4f), bias %+.5f\n", what, error,
                own, of_truth.value_or(0), bias);
  };
  print("real", m.e_real, m.bias_real, noise.e_real, {});
  print("virtual", m.e_virtual, m.bias_virtual, noise.e_virtual, m.noise_virtual);
  print("diff", m.e_diff, m.bias_diff, noise.e_diff, m.noise_diff);
  std::printf("  mask     error %.5f, near edges %.5f\n", m.e_mask, m.e_mask_edge);
  std::fflush(stdout);
}

}  // namespace
}  // namespace previz::truth

int main(int argc, char** argv) {
  CLI::App app("The reference CPU tracer against ground truth sets.");
  std::filesystem::path directory;
  int frame = 0, reduction = 4, samples = 256;
  app.add_option("SETDIR", directory)->required();
  app.add_option("--frame", frame, "truth frame [0]");
  app.add_option("--reduction", reduction, "trace a picture smaller by this factor [4]")
      ->check(CLI::IsMember({1, 2, 4, 8}));
  app.add_option("--spp", samples, "samples per (reduced) pixel, in two halves [256]")
      ->check(CLI::Range(2, 1000000));
  return previz::bench::run_program(
      app, argc, argv, [&] { previz::truth::run(directory, frame, reduction, samples); });
}
