// What it costs that things move: the time of a frame before which a large virtual object and a
// lamp were moved, over that of a frame before which nothing was (P13, P14). Both alternate.
#include <cstdio>
#include <glm/gtc/matrix_transform.hpp>
#include <vector>

#include "daemon/bench/shapes.hpp"
#include "daemon/core/render/renderer.hpp"
#include "drivers/error.hpp"
#include "tests/bench/frames_after_change.hpp"
#include "tests/bench/program.hpp"

namespace previz::bench {
namespace {

constexpr int width = 320, height = 240;

scene::Scene make_scene() {
  scene::Scene scene = scene_of(grid(4, 8));  // the real table
  scene.meshes.push_back(bumpy_sphere(7, 0.5, 0.2, 7));
  scene::Instance sphere;
  sphere.name = "virtual";
  sphere.mesh = 1;
  sphere.presence = scene::world_mixed;
  scene.instances.push_back(sphere);
  set::Light lamp;
  lamp.position = {1, 0, 2};
  scene.lights.push_back(lamp);
  scene.light_objects.push_back(scene::no_object);
  return scene;
}

void run(int rounds) {
  const auto device = render::open_device();
  const scene::Scene scene = make_scene();
  const ViewFromAbove view(device, scene, width, height);
  const ChangeTimes times = time_changes(view, rounds, [&](int round) {
    const glm::dvec3 step(0.01 * round, 0, 0.5);
    std::vector<scene::Instance> instances = scene.instances;
    instances[1].world_from_object = glm::translate(glm::dmat4(1), step);
    std::vector<set::Light> lights = scene.lights;
    lights[0].position += step;
    return [&view, instances, lights] { view.renderer->move(instances, lights); };
  });
  std::printf("%s, %zu triangles, %dx%d, 1 sample, CPU ms\n\n",
              render::device_name(*device).c_str(), scene.meshes[1].triangles.size(), width,
              height);
  print_changes(times, "moved");
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  CLI::App app("The time of frames between which things move");
  int rounds = 15;
  app.add_option("--rounds", rounds)->check(CLI::Range(1, 1000));
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(rounds); });
}
