// What it costs that a figure walks: the time of a frame before which a figure with a skin took
// another shape, over that of a frame before which nothing changed (P13). Both alternate.
#include <cmath>
#include <cstdio>
#include <vector>

#include "daemon/bench/shapes.hpp"
#include "daemon/core/render/renderer.hpp"
#include "drivers/error.hpp"
#include "tests/bench/frames_after_change.hpp"
#include "tests/bench/program.hpp"
#include "tests/support/figure.hpp"

namespace previz::bench {
namespace {

constexpr int rings = 500, segments = 50;  // 2 * rings * segments triangles
constexpr int joints = 60;
constexpr int width = 640, height = 480;

scene::Scene make_scene() {
  scene::Scene scene = scene_of(grid(4, 8));  // the real table
  glm::dmat4 placed(1);
  placed[3] = {-0.3, 0, 0.02, 1};
  test::add_limb(scene, test::limb_mesh(rings, segments, joints), joints, 0, placed,
                 scene::world_mixed);
  return scene;
}

void run(int rounds) {
  const auto device = render::open_device();
  const scene::Scene scene = make_scene();
  const ViewFromAbove view(device, scene, width, height);
  const ChangeTimes times = time_changes(view, rounds, [&](int round) {
    const double angle = 0.03 * std::sin(0.4 * round);  // a stride is some 16 frames long
    const std::vector<scene::Shape> shapes = {test::bent_limb(scene.deformations[0], angle)};
    return [&view, shapes] { view.renderer->deform(shapes); };
  });
  std::printf("%s, %zu triangles, %d joints, %dx%d, 1 sample, CPU ms, %llu trees built anew\n\n",
              render::device_name(*device).c_str(), scene.meshes.back().triangles.size(), joints,
              width, height, static_cast<unsigned long long>(times.rebuilt_trees));
  print_changes(times, "deformed");
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  CLI::App app("The time of frames between which a figure changes its shape");
  int rounds = 15;
  app.add_option("--rounds", rounds)->check(CLI::Range(1, 1000));
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(rounds); });
}
