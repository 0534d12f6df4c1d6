// What it costs that a figure walks: the time of a frame before which a figure with a skin took
// another shape, over that of a frame before which nothing changed (P13). Both alternate.
#include <cmath>
#include <cstdio>
#include <vector>

#include "daemon/render/renderer.hpp"
#include "drivers/error.hpp"
#include "tests/bench/frames_after_change.hpp"
#include "tests/bench/program.hpp"
#include "tests/bench/tracers/shapes.hpp"
#include "tests/support/figure.hpp"

namespace previz::bench {
namespace {

struct Options {
  int rings = 500, segments = 50;  // 2 * rings * segments triangles
  int joints = 60;
  int rounds = 15;
  int width = 640, height = 480;
};

scene::Scene make_scene(const Options& options) {
  scene::Scene scene = scene_of(grid(4, 8));  // the real table
  glm::dmat4 placed(1);
  placed[3] = {-0.3, 0, 0.02, 1};
  test::add_limb(scene, test::limb_mesh(options.rings, options.segments, options.joints),
                 options.joints, 0, placed, scene::world_mixed);
  return scene;
}

void run(const Options& options) {
  const auto device = render::open_device();
  const scene::Scene scene = make_scene(options);
  const ViewFromAbove view(device, scene, options.width, options.height);
  const ChangeTimes times = time_changes(view, options.rounds, [&](int round) {
    const double angle = 0.03 * std::sin(0.4 * round);  // a stride is some 16 frames long
    const std::vector<scene::Shape> shapes = {test::bent_limb(scene.deformations[0], angle)};
    return [&view, shapes] { view.renderer->deform(shapes); };
  });
  std::printf("%s, %zu triangles, %d joints, %dx%d, 1 sample, CPU ms, %llu trees built anew\n\n",
              render::device_name(*device).c_str(), scene.meshes.back().triangles.size(),
              options.joints, options.width, options.height,
              static_cast<unsigned long long>(times.rebuilt_trees));
  print_changes(times, "deformed");
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  CLI::App app("The time of frames between which a figure changes its shape");
  previz::bench::Options options;
  app.add_option("--rings", options.rings, "100 triangles each")->check(CLI::Range(1, 5000));
  app.add_option("--joints", options.joints)->check(CLI::Range(1, 1000));
  app.add_option("--rounds", options.rounds)->check(CLI::Range(1, 1000));
  app.add_option("--width", options.width)->check(CLI::Range(8, 8192));
  app.add_option("--height", options.height)->check(CLI::Range(8, 8192));
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(options); });
}
