// Measures what a live frame costs, pass by pass: the camera of a truth set moves on, every frame
// gets few samples, is averaged with those before it, denoised and dithered.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "daemon/render/renderer.hpp"
#include "drivers/plate.hpp"
#include "tests/bench/equal_error/view.hpp"
#include "tests/bench/measure.hpp"
#include "tests/bench/program.hpp"

namespace previz::bench {
namespace {

struct Options {
  std::vector<std::filesystem::path> sets;
  std::vector<int> widths = {640, 1920};
  std::string device;
  int samples = 1;
  int frames = 4;  // measured, after two that compile the passes and make the buffers
  bool history = true;
};

PlatePtr grey(int width, int height) {
  return std::make_shared<const Plate>(
      Plate{width, height, 8, std::vector<std::uint16_t>(std::size_t{3} * width * height, 100)});
}

void print(const Options& options, const View& view, render::DeviceTimes times, double wall_ms,
           double cpu_ms) {
  const double frames = options.frames;
  std::printf(
      "\n%s, %dx%d, %d samples, %s\n\n| pass | runs a frame | ms a frame |\n"
      "| --- | --- | --- |\n",
      view.set.c_str(), view.camera.intrinsics.width, view.camera.intrinsics.height,
      options.samples, options.history ? "with history" : "every frame alone");
  std::ranges::sort(times.passes, std::greater(), &render::DeviceTimes::Pass::ms);
  double all = 0;
  for (const auto& pass : times.passes) {
    all += pass.ms;
    std::printf("| %s | %.1f | %.3f |\n", pass.name.c_str(),
                static_cast<double>(pass.count) / frames, pass.ms / frames);
  }
  std::printf(
      "| all passes | | %.3f |\n| waiting for %.1f submissions | | %.3f |\n"
      "| the frame, on the clock | | %.3f |\n| the frame, CPU | | %.3f |\n",
      all / frames, static_cast<double>(times.submissions) / frames, times.waited_ms / frames,
      wall_ms / frames, cpu_ms / frames);
  if (times.untimed > 0)
    std::printf("\n%llu passes were not timed.\n", static_cast<unsigned long long>(times.untimed));
  std::fflush(stdout);
}

void measure(const Options& options, const std::shared_ptr<render::Device>& device,
             const std::filesystem::path& directory, int width) {
  const View view = load_view(directory, {}, width);
  const truth::TruthSet set = truth::load_truth_set(directory);
  render::Renderer renderer(device, {}, view.camera);
  renderer.set_scene(view.scene);
  renderer.set_environment(view.environment, set::LightSampling::importance);
  const PlatePtr plate = grey(view.camera.intrinsics.width, view.camera.intrinsics.height);
  std::chrono::steady_clock::time_point start;
  double cpu_start = 0;
  constexpr int warm = 2;
  for (int i = 0; i < warm + options.frames; ++i) {
    if (i == warm) {
      render::take_times(*device);
      start = std::chrono::steady_clock::now();
      cpu_start = cpu_seconds();
    }
    const auto at = static_cast<std::size_t>(i) % set.frames.size();
    renderer.begin({.plate = plate,
                    .exposure = view.exposure,
                    .world_from_camera = set.frames[at].world_from_camera,
                    .accumulates = options.history,
                    .dithers = true});
    renderer.render(options.samples);
    renderer.show(true);
  }
  const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - start;
  print(options, view, render::take_times(*device), wall.count(),
        1e3 * (cpu_seconds() - cpu_start));
}

void run(const Options& options) {
  render::DeviceOptions wanted;
  wanted.name = options.device;
  wanted.times_passes = true;
  const auto device = render::open_device(wanted);
  std::printf("%s\n", render::device_name(*device).c_str());
  for (const std::filesystem::path& set : options.sets)
    for (const int width : options.widths) measure(options, device, set, width);
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("Milliseconds of a live frame, pass by pass");
  app.add_option("SETDIR", options.sets, "truth sets")->required();
  app.add_option("--width", options.widths, "Pixels; as many as are wanted");
  app.add_option("--samples", options.samples, "a frame");
  app.add_option("--frames", options.frames, "measured")->check(CLI::Range(1, 1000));
  app.add_option("--device", options.device, "part of its name");
  app.add_flag("!--no-history", options.history, "every frame stands alone");
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(options); });
}
