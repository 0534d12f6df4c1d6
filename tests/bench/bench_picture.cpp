// What a frame costs beside its samples: from the camera's picture to the renderer, and from its
// sums to the picture that is shown.
#include <cstdio>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "daemon/bench/shapes.hpp"
#include "daemon/core/render/renderer.hpp"
#include "drivers/plate.hpp"
#include "tests/bench/measure.hpp"
#include "tests/bench/program.hpp"

namespace previz::bench {
namespace {

constexpr int rounds = 3;
constexpr int width = 1920, height = 1080;

// Returns what a camera with colour filters gives.
FramePtr noise() {
  Frame frame;
  frame.format = PixelFormat::gray8;
  frame.bayer = BayerPattern::rggb;
  frame.width = width;
  frame.height = height;
  frame.bytes.resize(frame_bytes(frame.format, width, height));
  std::minstd_rand random;
  for (std::uint8_t& byte : frame.bytes) byte = static_cast<std::uint8_t>(random() >> 8 & 0xff);
  return std::make_shared<const Frame>(std::move(frame));
}

struct Step {
  std::string name;
  std::function<void()> run;
  std::vector<double> wall_ms{}, cpu_ms{};

  void measure() {
    const Times times = time_of(run);
    wall_ms.push_back(times.wall_ms);
    cpu_ms.push_back(times.cpu_ms);
  }
};

void run() {
  const auto device = render::open_device();
  const scene::Scene scene = field_with_a_virtual_sphere(4'000);
  render::Renderer renderer(device, {}, camera_of(width, height));
  renderer.set_scene(scene);
  renderer.set_environment(lighting::EnvironmentMap{1, {glm::vec3(0.3F)}},
                           set::LightSampling::importance);
  const FramePtr camera = noise();
  render::FrameInput with_plate{.world_from_camera = view_of_field(scene)};
  render::FrameInput with_camera = with_plate;
  with_camera.camera = camera;

  render::Layers layers;
  Plate picture;
  Step steps[] = {
      {"the plate, by the computer",
       [&] { with_plate.plate = std::make_shared<const Plate>(to_plate(*camera)); }},
      {"begin with the plate", [&] { renderer.begin(with_plate); }},
      {"begin with the camera's bytes", [&] { renderer.begin(with_camera); }},
      {"one sample",
       [&] {
         renderer.render(1);
         renderer.wait();
       }},
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
              render::device_name(*device).c_str(), width, height);
  for (const Step& step : steps)
    std::printf("| %s | %.1f | %.1f |\n", step.name.c_str(), median(step.wall_ms),
                median(step.cpu_ms));
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  CLI::App app("Milliseconds of a frame beside its samples");
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(); });
}
