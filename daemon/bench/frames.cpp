#include "daemon/bench/frames.hpp"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <utility>

#include "daemon/bench/shapes.hpp"
#include "daemon/core/lighting/environment.hpp"
#include "drivers/display_drivers.hpp"
#include "drivers/error.hpp"
#include "drivers/frame.hpp"

namespace previz::bench {
namespace {

using Clock = std::chrono::steady_clock;

// A card's clock rises only under load, and the first frames make buffers: they are not measured.
constexpr int warm_frames = 3, most_frames = 12;
constexpr double measured_s = 2;  // frames are measured for about this long

double seconds_between(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

// A blue sky over dark ground, and a sun, so that glass throws caustics.
lighting::EnvironmentMap sky() {
  lighting::EnvironmentMap map{64, std::vector<glm::vec3>(std::size_t{64} * 64)};
  const glm::dvec3 sun = glm::normalize(glm::dvec3(0.5, -0.4, 0.8));
  for (int j = 0; j < map.size; ++j)
    for (int i = 0; i < map.size; ++i) {
      const glm::dvec3 d = lighting::texel_direction(map.size, i, j);
      glm::vec3 radiance =
          d.z > 0 ? glm::vec3(0.4f, 0.6f, 1.0f) * static_cast<float>(0.5 + d.z) : glm::vec3(0.1f);
      if (glm::dot(d, sun) > std::cos(0.06)) radiance = glm::vec3(100);
      map.radiance[static_cast<std::size_t>(j * map.size + i)] = radiance;
    }
  return map;
}

scene::Scene field_with_a_glass_ball(std::size_t triangles) {
  scene::Scene scene = field_with_a_virtual_sphere(triangles);
  scene::Material glass;
  glass.roughness = 0;
  glass.transmission = 1;
  glass.thin_walled = false;
  scene.instances.back().material = static_cast<std::uint32_t>(scene.materials.size());
  scene.materials.push_back(glass);
  return scene;
}

std::size_t triangles_of(const scene::Scene& scene) {
  std::size_t count = 0;
  for (const scene::Mesh& mesh : scene.meshes) count += mesh.triangles.size();
  return count;
}

// Returns what a camera with colour filters gives.
FramePtr grey_mosaic(int width, int height) {
  Frame frame;
  frame.format = PixelFormat::gray8;
  frame.bayer = BayerPattern::rggb;
  frame.width = width;
  frame.height = height;
  frame.bytes.assign(frame_bytes(frame.format, width, height), 128);
  return std::make_shared<const Frame>(std::move(frame));
}

std::uint64_t share(std::uint64_t before, std::uint64_t after, int frames) {
  const auto count = static_cast<std::uint64_t>(frames);
  return (after - before + count - 1) / count;
}

}  // namespace

struct Frames::Stage {
  FrameWish wish;
  std::size_t triangles;
  std::unique_ptr<render::Renderer> renderer;
  FramePtr camera;
  glm::dmat4 view;
  int frames = 0;
  FrameFigures sums;
};

Frames::Frames(std::shared_ptr<render::Device> device) : device_(std::move(device)) {
  const Clock::time_point start = Clock::now();
  const FrameWish first{.width = 320, .height = 180};
  make_stage(first);
  frame(1);
  start_s_ = seconds_between(start, Clock::now());
  // The time of a pixel and of a sample, roughly; measure() knows better each time.
  const double pixels = first.width * first.height;
  const auto s_of_frame = [&](int samples) {
    const Clock::time_point begin = Clock::now();
    frame(samples);
    return seconds_between(begin, Clock::now());
  };
  s_of_frame(1);
  const double one = s_of_frame(1), four = s_of_frame(4);
  s_a_sample_ = std::max(four - one, 0.1 * one) / 3 / pixels;
  s_a_pixel_ = std::max(one / pixels - s_a_sample_, 0.0);
}

Frames::~Frames() = default;

double Frames::expected_s(const FrameWish& wish) const {
  const double pixels = static_cast<double>(wish.width) * wish.height;
  const double frame_s = pixels * (s_a_pixel_ + wish.samples * s_a_sample_);
  // Frames are measured alone and, on a card, in a row.
  const double measured = std::clamp(2 * measured_s, 2 * frame_s, 2 * most_frames * frame_s);
  const bool is_new = !stage_ || stage_->wish.triangles != wish.triangles;
  return warm_frames * frame_s + measured +
         (is_new ? s_a_triangle_ * static_cast<double>(wish.triangles) : 0);
}

void Frames::make_stage(const FrameWish& wish) {
  const bool same = stage_ && stage_->wish.triangles == wish.triangles;
  if (!same) {
    stage_.reset();
    const Clock::time_point start = Clock::now();
    const scene::Scene scene = field_with_a_glass_ball(wish.triangles);
    set::Estimation estimation;
    estimation.max_depth = 4;
    stage_ = std::make_unique<Stage>();
    stage_->triangles = triangles_of(scene);
    stage_->view = view_of_field(scene);
    stage_->renderer =
        std::make_unique<render::Renderer>(device_, estimation, camera_of(wish.width, wish.height));
    stage_->renderer->set_scene(scene);
    stage_->renderer->set_environment(sky(), set::LightSampling::importance);
    s_a_triangle_ = std::max(s_a_triangle_ / 4, seconds_between(start, Clock::now()) /
                                                    static_cast<double>(stage_->triangles));
  } else {
    stage_->renderer->resize(camera_of(wish.width, wish.height));
  }
  stage_->wish = wish;
  stage_->camera = grey_mosaic(wish.width, wish.height);
  open_display(wish.width, wish.height);
}

void Frames::open_display(int width, int height) {
  display_.reset();  // before another one has its context in this thread
  no_display_.clear();
  try {
    display_ = display_driver("headless").open({"", DisplayMode{width, height, 0}, {}});
  } catch (const Error& error) {
    no_display_ = error.what();
  }
}

// Returns where the next picture is wanted, as `previzd run` decides.
render::ShowTo Frames::where() const {
  const std::optional<CardIdentity> card = stage_->renderer->card();
  const bool is_on_card = card && display_ && display_->card() == card;
  return {.computer = !is_on_card, .card = is_on_card};
}

void Frames::begin() {
  Stage& stage = *stage_;
  ++stage.frames;
  stage.renderer->begin({.world_from_camera = glm::translate(
                             stage.view, glm::dvec3(0.002 * (stage.frames % 16), 0, 0)),
                         .accumulates = true,
                         .dithers = true,
                         .camera = stage.camera});
}

// Renders frames as `previzd run` does where the next one waits already.
double Frames::interval_ms(int samples, int frames) {
  std::optional<render::Showing> last;
  Clock::time_point start;
  for (int i = 0; i <= frames; ++i) {
    begin();
    stage_->renderer->render(samples);
    render::Showing showing = stage_->renderer->show_later(true, where());
    if (last) last->finish();
    if (i == 1) start = Clock::now();
    last = std::move(showing);
  }
  last->finish();
  return 1e3 * seconds_between(start, Clock::now()) / frames;
}

// Renders a frame, and adds its times to the sums.
void Frames::frame(int samples) {
  Stage& stage = *stage_;
  render::Renderer& renderer = *stage.renderer;
  const Clock::time_point start = Clock::now();
  begin();
  const Clock::time_point begun = Clock::now();
  renderer.render(samples);
  const Clock::time_point recorded = Clock::now();
  const render::Showing::Shown picture = renderer.show_later(true, where()).finish();
  const Clock::time_point shown = Clock::now();
  if (display_) {
    const DisplayEvent event = display_->show({picture.picture, {}, picture.on_card});
    if (const auto* trouble = std::get_if<DeviceTrouble>(&event)) no_display_ = trouble->what;
  }
  stage.sums.comes_down = picture.picture != nullptr;
  stage.sums.screen_ms += 1e3 * seconds_between(shown, Clock::now());
  stage.sums.begin_ms += 1e3 * seconds_between(start, begun);
  stage.sums.record_ms += 1e3 * seconds_between(begun, recorded);
  stage.sums.show_ms += 1e3 * seconds_between(recorded, shown);
}

FrameFigures Frames::measure(const FrameWish& wish) {
  make_stage(wish);
  const Clock::time_point warm = Clock::now();
  for (int i = 0; i < warm_frames; ++i) frame(wish.samples);
  const double frame_s = seconds_between(warm, Clock::now()) / warm_frames;
  stage_->sums = {};
  render::take_times(*device_);
  const render::DeviceWork before = render::work_of(*device_);
  const double cpu_before = cpu_seconds();
  const int frames = std::clamp(static_cast<int>(measured_s / frame_s), 1, most_frames);
  for (int i = 0; i < frames; ++i) frame(wish.samples);
  const render::DeviceWork after = render::work_of(*device_);
  const render::DeviceTimes times = render::take_times(*device_);
  const render::Counters counters = stage_->renderer->counters();

  FrameFigures figures = stage_->sums;
  for (double* of_all :
       {&figures.begin_ms, &figures.record_ms, &figures.show_ms, &figures.screen_ms})
    *of_all /= frames;
  figures.width = wish.width;
  figures.height = wish.height;
  figures.samples = wish.samples;
  figures.triangles = stage_->triangles;
  figures.frames = frames;
  figures.ms = figures.begin_ms + figures.record_ms + figures.show_ms;
  figures.cpu_ms = 1e3 * (cpu_seconds() - cpu_before) / frames;
  figures.waited_ms = times.waited_ms / frames;
  figures.passes = times.passes;
  for (render::DeviceTimes::Pass& pass : figures.passes) {
    pass.ms /= frames;
    pass.count = share(0, pass.count, frames);
  }
  std::ranges::sort(figures.passes, std::greater(), &render::DeviceTimes::Pass::ms);
  figures.rays = counters.rays;
  figures.shadow_rays = counters.shadow_rays;
  figures.work = {.submissions = share(before.submissions, after.submissions, frames),
                  .waits = share(before.waits, after.waits, frames),
                  .allocations = share(before.allocations, after.allocations, frames),
                  .barriers = share(before.barriers, after.barriers, frames),
                  .bytes_up = share(before.bytes_up, after.bytes_up, frames),
                  .bytes_down = share(before.bytes_down, after.bytes_down, frames)};
  figures.interval_ms = render::facts_of(*device_).shares_host_memory
                            ? figures.ms
                            : interval_ms(wish.samples, frames);
  const double pixels = static_cast<double>(wish.width) * wish.height;
  const double rest = 1e-3 * figures.ms / pixels - wish.samples * s_a_sample_;
  if (rest > 0)
    s_a_pixel_ = rest;
  else
    s_a_sample_ = 1e-3 * figures.ms / pixels / wish.samples;
  return figures;
}

}  // namespace previz::bench
