// Milliseconds a frame over resolution and triangles, one sample a pixel, three bounces: the
// paper's figure 4 for this renderer. Prints a table and writes CSV and SVG. Wall time, so on a CPU
// device quote it only from an idle machine.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "daemon/render/renderer.hpp"
#include "tests/bench/tracers/shapes.hpp"

namespace previz::bench {
namespace {

struct Resolution {
  int width, height;
};

struct Curve {
  std::size_t triangles;
  std::vector<double> megapixels, milliseconds;
};

const std::vector<Resolution> resolutions = {
    {320, 240}, {640, 480}, {800, 600}, {1280, 720}, {1920, 1080}};

// A real ground under a virtual field of spheres, lit by a sky with a brighter side.
scene::Scene mixed_field(std::size_t triangles) {
  scene::Scene scene;
  scene.meshes = {grid(40, 2), sphere_field(triangles)};
  scene::Material ground, field;
  ground.specular = field.specular = 0;
  ground.base_color = glm::vec3(0.5f);
  field.base_color = glm::vec3(0.6f, 0.5f, 0.4f);
  scene.materials = {ground, field};
  scene::Instance below;
  below.world_from_object[3] = glm::dvec4(0, 0, -0.01, 1);
  scene::Instance above;
  above.mesh = above.material = 1;
  above.presence = scene::world_mixed;
  scene.instances = {below, above};
  return scene;
}

lighting::EnvironmentMap sky() {
  lighting::EnvironmentMap map{64, {}};
  for (int j = 0; j < 64; ++j)
    for (int i = 0; i < 64; ++i)
      map.radiance.emplace_back(glm::vec3(0.3f) + glm::vec3(0.02f, 0.015f, 0.01f) * float(i));
  return map;
}

// From beyond the field's corner, looking at its middle.
glm::dmat4 camera_pose(const scene::Mesh& field) {
  float edge = 0;
  for (const glm::vec3& p : field.positions) edge = std::max({edge, p.x, p.y});
  const glm::dvec3 eye(0, -1.4 * edge, 0.8 * edge);
  const glm::dvec3 z = glm::normalize(-eye);
  const glm::dvec3 x(1, 0, 0);
  glm::dmat4 pose(1.0);
  pose[0] = glm::dvec4(x, 0);
  pose[1] = glm::dvec4(glm::cross(z, x), 0);
  pose[2] = glm::dvec4(z, 0);
  pose[3] = glm::dvec4(eye, 1);
  return pose;
}

double median_frame_ms(render::Renderer& renderer, const glm::dmat4& pose, int frames) {
  std::vector<double> times;
  for (int i = 0; i <= frames; ++i) {  // the first one compiles the kernels and does not count
    const auto begin = std::chrono::steady_clock::now();
    renderer.begin({{}, 1.0, pose});
    renderer.render(1);
    const std::chrono::duration<double, std::milli> taken =
        std::chrono::steady_clock::now() - begin;
    if (i > 0) times.push_back(taken.count());
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

Curve measure(const std::shared_ptr<render::Device>& device, std::size_t triangles, int frames) {
  const scene::Scene scene = mixed_field(triangles);
  Curve curve{scene.meshes[1].triangles.size(), {}, {}};
  set::Estimation estimation;
  estimation.max_depth = 3;
  for (const Resolution& size : resolutions) {
    ObserverCalibration calibration;
    const double f = size.width / (2 * std::tan(0.4));
    calibration.intrinsics = {
        size.width, size.height, f, f, size.width / 2.0 - 0.5, size.height / 2.0 - 0.5};
    render::Renderer renderer(device, estimation, calibration);
    renderer.set_scene(scene);
    renderer.set_environment(sky(), set::LightSampling::importance);
    const double ms = median_frame_ms(renderer, camera_pose(scene.meshes[1]), frames);
    std::printf("%8zu triangles  %4dx%-4d  %9.2f ms\n", curve.triangles, size.width, size.height,
                ms);
    std::fflush(stdout);
    curve.megapixels.push_back(1e-6 * size.width * size.height);
    curve.milliseconds.push_back(ms);
  }
  return curve;
}

void write_csv(const std::vector<Curve>& curves, const std::filesystem::path& file) {
  std::ofstream out(file);
  out << "triangles,width,height,ms\n";
  for (const Curve& curve : curves)
    for (std::size_t i = 0; i < resolutions.size(); ++i)
      out << curve.triangles << ',' << resolutions[i].width << ',' << resolutions[i].height << ','
          << curve.milliseconds[i] << '\n';
}

void write_svg(const std::vector<Curve>& curves, const std::string& device,
               const std::filesystem::path& file) {
  constexpr double left = 70, bottom = 340, width = 520, height = 300;
  static constexpr const char* colours[] = {"#1b6ca8", "#2e8b57", "#c9820a", "#b03a48"};
  double slowest = 0, largest = 0;
  for (const Curve& c : curves) {
    slowest = std::max(slowest, *std::max_element(c.milliseconds.begin(), c.milliseconds.end()));
    largest = std::max(largest, c.megapixels.back());
  }
  const auto x = [&](double megapixels) { return left + width * megapixels / largest; };
  const auto y = [&](double ms) { return bottom - height * ms / slowest; };
  std::ofstream out(file);
  out << "<svg xmlns='http://www.w3.org/2000/svg' width='720' height='400' "
         "font-family='sans-serif' "
         "font-size='12'>\n<rect width='720' height='400' fill='white'/>\n<text x='70' y='20'>ms a "
         "frame over resolution, 1 sample a pixel, 3 bounces; "
      << device << "</text>\n";
  for (int i = 0; i <= 4; ++i) {
    const double ms = slowest * i / 4;
    out << "<path d='M" << left << ' ' << y(ms) << " h" << width << "' stroke='#ddd'/><text x='"
        << left - 6 << "' y='" << y(ms) + 4 << "' text-anchor='end'>" << std::lround(ms * 10) / 10.0
        << "</text>\n";
  }
  for (std::size_t i = 0; i < resolutions.size(); ++i)
    out << "<text x='" << x(curves[0].megapixels[i]) << "' y='" << bottom + 18
        << "' text-anchor='end' transform='rotate(-25 " << x(curves[0].megapixels[i]) << ' '
        << bottom + 18 << ")'>" << resolutions[i].width << "x" << resolutions[i].height
        << "</text>\n";
  for (std::size_t k = 0; k < curves.size(); ++k) {
    out << "<polyline fill='none' stroke-width='2' stroke='" << colours[k % 4] << "' points='";
    for (std::size_t i = 0; i < resolutions.size(); ++i)
      out << x(curves[k].megapixels[i]) << ',' << y(curves[k].milliseconds[i]) << ' ';
    out << "'/>\n<text x='" << left + width + 8 << "' y='" << y(curves[k].milliseconds.back()) + 4
        << "' fill='" << colours[k % 4] << "'>" << curves[k].triangles << "</text>\n";
  }
  out << "</svg>\n";
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  CLI::App app("Milliseconds a frame over resolution and triangles.");
  std::string device_name;
  std::filesystem::path out = "out/bench";
  int frames = 3;
  std::vector<std::size_t> triangles = {4000, 98000, 582000, 1000000};
  app.add_option("--device", device_name, "Vulkan device whose name contains this");
  app.add_option("--out", out, "directory for frame.csv and frame.svg [out/bench]");
  app.add_option("--frames", frames, "frames timed each; the median counts [3]")
      ->check(CLI::Range(1, 1000));
  app.add_option("--triangles", triangles, "about how many [4000 98000 582000 1000000]");
  CLI11_PARSE(app, argc, argv);
  try {
    const auto device = previz::render::open_device({.validation = false, .name = device_name});
    std::vector<previz::bench::Curve> curves;
    for (const std::size_t count : triangles)
      curves.push_back(previz::bench::measure(device, count, frames));
    std::filesystem::create_directories(out);
    previz::bench::write_csv(curves, out / "frame.csv");
    previz::bench::write_svg(curves, previz::render::device_name(*device), out / "frame.svg");
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_frame: %s\n", error.what());
    return 1;
  }
}
