// Measures what a live frame costs, pass by pass: the camera of a truth set moves on, every frame
// gets few samples, is averaged with those before it, denoised and dithered.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <utility>
#include <vector>

#include "daemon/core/render/renderer.hpp"
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
  int warm = 3;    // frames that compile the passes and make the buffers, and are not measured
  int frames = 4;  // measured
  bool as_gpu = false;
  bool history = true;
};

PlatePtr grey(int width, int height) {
  return std::make_shared<const Plate>(
      Plate{width, height, 8, std::vector<std::uint16_t>(std::size_t{3} * width * height, 100)});
}

// Sums over all measured frames, on the computer's clock: placing the frame, recording its samples,
// and having its picture, which waits for the device.
struct Spent {
  double begin_ms = 0, render_ms = 0, show_ms = 0, cpu_ms = 0;
};

double ms_since(std::chrono::steady_clock::time_point& start) {
  const auto before = std::exchange(start, std::chrono::steady_clock::now());
  return std::chrono::duration<double, std::milli>(start - before).count();
}

void print(const Options& options, const View& view, render::DeviceTimes times, const Spent& spent,
           const render::DeviceWork& before, const render::DeviceWork& after) {
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
  const auto row = [&](const char* what, double all_frames) {
    std::printf("| %s | | %.3f |\n", what, all_frames / frames);
  };
  row("all passes", all);
  row("waiting for the device", times.waited_ms);
  row("begin", spent.begin_ms);
  row("render", spent.render_ms);
  row("show", spent.show_ms);
  row("the frame, on the clock", spent.begin_ms + spent.render_ms + spent.show_ms);
  row("the frame, CPU", spent.cpu_ms);
  const auto count = [&](const char* what, std::uint64_t render::DeviceWork::*of) {
    std::printf("| %s | %.1f | |\n", what, static_cast<double>(after.*of - before.*of) / frames);
  };
  count("submissions", &render::DeviceWork::submissions);
  count("waits", &render::DeviceWork::waits);
  count("allocations", &render::DeviceWork::allocations);
  count("barriers", &render::DeviceWork::barriers);
  count("bytes up", &render::DeviceWork::bytes_up);
  count("bytes down", &render::DeviceWork::bytes_down);
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
  Spent spent;
  render::DeviceWork before;
  double cpu_start = 0;
  for (int i = 0; i < options.warm + options.frames; ++i) {
    if (i == options.warm) {
      render::take_times(*device);
      spent = {};
      before = render::work_of(*device);
      cpu_start = cpu_seconds();
    }
    auto start = std::chrono::steady_clock::now();
    const auto at = static_cast<std::size_t>(i) % set.frames.size();
    renderer.begin({.plate = plate,
                    .exposure = view.exposure,
                    .world_from_camera = set.frames[at].world_from_camera,
                    .accumulates = options.history,
                    .dithers = true});
    spent.begin_ms += ms_since(start);
    renderer.render(options.samples);
    spent.render_ms += ms_since(start);
    renderer.show(true);
    spent.show_ms += ms_since(start);
  }
  spent.cpu_ms = 1e3 * (cpu_seconds() - cpu_start);
  print(options, view, render::take_times(*device), spent, before, render::work_of(*device));
}

void run(const Options& options) {
  render::DeviceOptions wanted;
  wanted.name = options.device;
  wanted.as_gpu = options.as_gpu;
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
  app.add_option("--warm", options.warm, "frames before those")->check(CLI::Range(0, 1000));
  app.add_flag("--as-gpu", options.as_gpu, "treat a CPU device as a graphics card");
  app.add_option("--device", options.device, "part of its name");
  app.add_flag("!--no-history", options.history, "every frame stands alone");
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(options); });
}
