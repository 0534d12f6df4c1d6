// What a frame costs beside its samples: from the camera's picture to the renderer, and from its
// sums to the picture that is shown.
#include <chrono>
#include <cstdio>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "daemon/render/renderer.hpp"
#include "drivers/plate.hpp"
#include "tests/bench/measure.hpp"
#include "tests/bench/program.hpp"
#include "tests/bench/tracers/shapes.hpp"

namespace previz::bench {
namespace {

constexpr int rounds = 3;

struct Options {
  int width = 1920, height = 1080;
};

Plate noise(const Options& options) {
  Plate plate{options.width, options.height, 8,
              std::vector<std::uint16_t>(std::size_t{3} * options.width * options.height)};
  std::minstd_rand random;
  for (std::uint16_t& sample : plate.samples)
    sample = static_cast<std::uint16_t>(random() >> 8 & 0xff);
  return plate;
}

struct Step {
  std::string name;
  std::function<void()> run;
  std::vector<double> wall_ms{}, cpu_ms{};

  void measure() {
    const auto start = std::chrono::steady_clock::now();
    const double cpu_start = cpu_seconds();
    run();
    const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - start;
    wall_ms.push_back(wall.count());
    cpu_ms.push_back(1e3 * (cpu_seconds() - cpu_start));
  }
};

void run(const Options& options) {
  const auto device = render::open_device();
  const scene::Scene scene = field_with_a_virtual_sphere(4'000);
  render::Renderer renderer(device, {}, camera_of(options.width, options.height));
  renderer.set_scene(scene);
  renderer.set_environment(lighting::EnvironmentMap{1, {glm::vec3(0.3F)}},
                           set::LightSampling::importance);
  const render::FrameInput frame{std::make_shared<const Plate>(noise(options)), 1,
                                 view_of_field(scene)};

  render::Layers layers;
  Plate picture;
  Step steps[] = {
      {"begin", [&] { renderer.begin(frame); }},
      {"one sample", [&] { renderer.render(1); }},
      {"layers", [&] { layers = renderer.layers(); }},
      {"picture", [&] { picture = renderer.show(false); }},
      {"picture, denoised", [&] { picture = renderer.show(true); }},
      {"picture and layers, denoised", [&] { picture = renderer.show(true, &layers); }}};
  for (int round = -1; round < rounds; ++round) {
    for (Step& step : steps) step.measure();
    if (round >= 0) continue;  // compiles the pipelines
    for (Step& step : steps) {
      step.wall_ms.clear();
      step.cpu_ms.clear();
    }
  }
  std::printf("%s, %dx%d\n\n| step | ms | CPU ms |\n| --- | --- | --- |\n",
              render::device_name(*device).c_str(), options.width, options.height);
  for (const Step& step : steps)
    std::printf("| %s | %.1f | %.1f |\n", step.name.c_str(), median(step.wall_ms),
                median(step.cpu_ms));
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("Milliseconds of a frame beside its samples");
  app.add_option("--width", options.width, "Pixels");
  app.add_option("--height", options.height, "Pixels");
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(options); });
}
