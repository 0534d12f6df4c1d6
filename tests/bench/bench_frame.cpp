// Time of a frame of one sample a pixel over resolution, for several numbers of triangles: the
// paper's figure 4.
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "daemon/bench/shapes.hpp"
#include "daemon/core/render/renderer.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"
#include "tests/bench/measure.hpp"
#include "tests/bench/program.hpp"

namespace previz::bench {
namespace {

struct Options {
  std::vector<std::size_t> triangles{4'000, 98'000, 582'000, 1'000'000};
  int rounds = 3;
  int depth = 4;
};

struct Resolution {
  int width, height;
};
constexpr Resolution resolutions[] = {{320, 240},  {640, 480},  {800, 600},
                                      {1024, 768}, {1280, 720}, {1920, 1080}};

lighting::EnvironmentMap sky() {
  lighting::EnvironmentMap map{32, {}};
  map.radiance.resize(std::size_t{32} * 32);
  for (int j = 0; j < map.size; ++j) {
    for (int i = 0; i < map.size; ++i) {
      const glm::vec3 d = lighting::texel_direction(map.size, i, j);
      map.radiance[static_cast<std::size_t>(j * map.size + i)] =
          d.z > 0 ? glm::vec3(0.4f, 0.6f, 1.0f) * (0.5f + d.z) : glm::vec3(0.1f);
    }
  }
  return map;
}

Times measure(render::Renderer& renderer, const render::FrameInput& frame, int rounds) {
  std::vector<double> wall, cpu;
  for (int round = -1; round < rounds; ++round) {
    const Times times = time_of([&] {
      renderer.begin(frame);
      renderer.render(1);
      renderer.wait();
    });
    if (round < 0) continue;  // compiles the pipelines
    wall.push_back(times.wall_ms);
    cpu.push_back(times.cpu_ms);
  }
  return {median(wall), median(cpu)};
}

void run(const Options& options) {
  const auto device = render::open_device();
  std::printf("%s, %d bounces, 1 sample a pixel\n\n", render::device_name(*device).c_str(),
              options.depth);
  std::printf(
      "| triangles | resolution | ms a frame | CPU ms a frame |\n| --- | --- | --- | --- |\n");
  set::Estimation estimation;
  estimation.max_depth = options.depth;
  for (const std::size_t triangles : options.triangles) {
    const scene::Scene scene = field_with_a_virtual_sphere(triangles);
    const std::size_t count = scene.meshes[0].triangles.size() + scene.meshes[1].triangles.size();
    for (const Resolution& r : resolutions) {
      render::Renderer renderer(device, estimation, camera_of(r.width, r.height));
      renderer.set_scene(scene);
      renderer.set_environment(sky(), set::LightSampling::importance);
      render::FrameInput frame;
      frame.plate = std::make_shared<const Plate>(
          Plate{r.width, r.height, 8,
                std::vector<std::uint16_t>(std::size_t{3} * r.width * r.height, 128)});
      frame.world_from_camera = view_of_field(scene);
      const Times times = measure(renderer, frame, options.rounds);
      std::printf("| %zu | %dx%d | %.0f | %.0f |\n", count, r.width, r.height, times.wall_ms,
                  times.cpu_ms);
      std::fflush(stdout);
    }
  }
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("Milliseconds a frame over resolution and triangles");
  app.add_option("--triangles", options.triangles, "Triangles of the real scene, about");
  app.add_option("--rounds", options.rounds, "Frames measured; the median counts");
  app.add_option("--depth", options.depth, "Path vertices after the camera");
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(options); });
}
