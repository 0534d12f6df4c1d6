#include "daemon/core/render/passes/history.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <iterator>
#include <utility>

#include "shaders/history.spv.h"
#include "shaders/history_cover.spv.h"
#include "shaders/history_cover_query.spv.h"
#include "shaders/history_show.spv.h"
#include "shaders/history_surface.spv.h"
#include "shaders/history_surface_query.spv.h"

namespace previz::render {
namespace {

// Returns how many vertices deform.
std::size_t deforming_points(const std::vector<GpuScene::Stance>& stances) {
  std::size_t points = 0;
  for (const GpuScene::Stance& stance : stances)
    points += stance.deformed ? stance.deformed->vertices : 0;
  return points;
}

// Returns whether the shape of one is that of the other, but for where its points are.
bool are_comparable(const GpuScene::Stance& a, const GpuScene::Stance& b) {
  if (a.material != b.material || a.presence != b.presence) return false;
  if (!a.deformed || !b.deformed) return a.deformed == b.deformed;
  return a.deformed->reach == b.deformed->reach;
}

// A dispatch works on no more pixels than these: devices that allow 65,535 work groups at once
// could not do a picture of 3840x2160 in one.
constexpr std::uint32_t most_pixels_at_once = 1u << 21;

constexpr Pass show_pass{"history_show", history_show_spv};
constexpr Pass frame_passes[] = {
    {"history_surface", history_surface_spv, history_surface_query_spv},
    {"history_cover", history_cover_spv, history_cover_query_spv},
    {"history", history_spv}};

double frames_after(double change) {
  return change > 0 ? most_drift / change : std::numeric_limits<double>::infinity();
}

void set_rotation(gpu::vec4 (&rows)[3], const glm::dmat3& rotation) {
  for (int r = 0; r < 3; ++r)
    rows[r] = glm::vec4(rotation[0][r], rotation[1][r], rotation[2][r], 0.0);
}

Purpose for_average(const PinholeIntrinsics& lens) {
  return {"the average over frames",
          "make the picture smaller, or turn off averaging (quality.accumulate or --neighbours 0)",
          lens.width, lens.height};
}

}  // namespace

History::History(Device& device) : device_(device), show_(device, show_pass, 0) {}

std::vector<Pass> History::passes() {
  std::vector<Pass> all(std::begin(frame_passes), std::end(frame_passes));
  all.push_back(show_pass);
  return all;
}

void History::forget() {
  shorten(0);
}

void History::start_over() {
  for (Frame& frame : frames_) frame.is_shown = false;
  samples_.reset();
  shortened_ = shortened_now_ = std::numeric_limits<double>::infinity();
  light_ = {};
}

void History::shorten(double frames) {
  shortened_ = std::min(shortened_, frames);
}

void History::light_with(const EncodedEnvironment& environment) {
  light_.see(environment);
}

void History::light_with(LightCells environment) {
  light_.see(std::move(environment));
}

void History::light_with(std::vector<set::Light> lamps) {
  light_.see(std::move(lamps));
}

void History::reserve(Frame& frame) {
  const std::size_t points = deforming_points(frame.stances);
  const std::size_t pixels = static_cast<std::size_t>(frame.view.lens.width) *
                             static_cast<std::size_t>(frame.view.lens.height);
  const Purpose purpose = for_average(frame.view.lens);
  const auto grow = [&](Buffer& buffer, std::size_t bytes) {
    if (buffer.size < bytes) buffer = create_picture_buffer(device_, purpose, bytes);
  };
  constexpr std::size_t point_bytes = 2 * sizeof(gpu::vec4);
  grow(frame.points, std::max<std::size_t>(points, 1) * point_bytes);
  grow(bent_places_, (points > 0 ? pixels : 1) * sizeof(gpu::vec3));
  grow(covers_, pixels * sizeof(float));
  grow(befores_, pixels * sizeof(gpu::vec2));
  if (pixels <= frame.pixels) return;
  frame.pixels = 0;  // stays 0 if an allocation below throws
  for (Buffer* buffer : {&frame.places, &frame.lights})
    *buffer = create_picture_texels(device_, purpose, pixels * sizeof(gpu::vec4),
                                    vk::Format::eR32G32B32A32Sfloat);
  for (Buffer* buffer :
       {&frame.things, &frame.spreads, &frame.albedos, &frame.others, &frame.caustics})
    *buffer = create_picture_texels(device_, purpose, pixels * sizeof(gpu::uvec2),
                                    vk::Format::eR32G32Uint);
  frame.pixels = pixels;
}

void History::begin(const View& view, std::vector<GpuScene::Stance> stances) {
  shorten(light_.frames());
  if (frames_[now_].is_shown) {
    now_ = 1 - now_;
  } else {
    // A frame that nobody saw leaves what it should have shortened to the next one.
    shortened_ = std::min(shortened_, shortened_now_);
  }
  shortened_now_ = std::exchange(shortened_, std::numeric_limits<double>::infinity());
  Frame& now = frames_[now_];
  now.view = view;
  now.stances = std::move(stances);
  now.is_shown = false;
  samples_.reset();
  reserve(now);
  if (frames_[1 - now_].pixels == 0) {
    frames_[1 - now_].view = view;
    reserve(frames_[1 - now_]);
  }
}

// Returns the number of frames that the past counts as.
double History::frames_that_stay() const {
  const Frame &now = frames_[now_], &past = frames_[1 - now_];
  if (!past.is_shown || past.stances.size() != now.stances.size()) return 0;
  const double frames = std::min(most_frames, shortened_now_);
  return frames < least_frames ? 0 : frames;
}

MovedInstances History::moved() const {
  const Frame &now = frames_[now_], &past = frames_[1 - now_];
  if (!past.is_shown || past.stances.size() != now.stances.size()) return {};
  return moved_instances(past.stances, now.stances, glm::dvec3(now.view.world_from_camera[3]));
}

std::vector<gpu::GpuMotion> History::motions() const {
  const Frame &now = frames_[now_], &past = frames_[1 - now_];
  // Nothing deforms unless it is said below: there may be no memory for its points.
  gpu::GpuMotion unknown{};
  unknown.points = gpu::NO_INDEX;
  std::vector<gpu::GpuMotion> result(std::max<std::size_t>(now.stances.size(), 1), unknown);
  if (!past.is_shown || past.stances.size() != now.stances.size()) return result;
  const glm::dvec3 camera_now(now.view.world_from_camera[3]);
  const glm::dvec3 camera_before(past.view.world_from_camera[3]);
  std::uint32_t points = 0;
  for (std::size_t i = 0; i < now.stances.size(); ++i) {
    const glm::dmat4& is = now.stances[i].world_from_object;
    const glm::dmat4& was = past.stances[i].world_from_object;
    // What stands still is moved by the camera alone, without the rounding of an inverse.
    const glm::dmat4 world = is == was ? glm::dmat4(1.0) : was * glm::inverse(is);
    const glm::dvec3 offset = glm::dvec3(world * glm::dvec4(camera_now, 1.0)) - camera_before;
    for (int r = 0; r < 3; ++r)
      result[i].before_from_now[r] = glm::vec4(world[0][r], world[1][r], world[2][r], offset[r]);
    bool is_finite = true;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 4; ++c) is_finite &= std::isfinite(result[i].before_from_now[r][c]);
    const GpuScene::Stance &stance = now.stances[i], &before = past.stances[i];
    result[i].is_known = is_finite && are_comparable(stance, before) ? 1 : 0;
    if (!before.deformed) continue;
    if (result[i].is_known == 1 && stance.deformed->shape != before.deformed->shape)
      result[i].points = points - stance.deformed->first_vertex;
    points += before.deformed->vertices;
  }
  return result;
}

gpu::GpuHistory History::constants(std::int64_t samples, const MovedInstances& moved) const {
  const Frame &now = frames_[now_], &past = frames_[1 - now_];
  gpu::GpuHistory result{};
  const PinholeIntrinsics& k = past.view.lens;
  result.width = static_cast<std::uint32_t>(now.view.lens.width);
  result.height = static_cast<std::uint32_t>(now.view.lens.height);
  result.width_before = static_cast<std::uint32_t>(k.width);
  result.height_before = static_cast<std::uint32_t>(k.height);
  set_rotation(result.camera_from_world, glm::transpose(glm::dmat3(past.view.world_from_camera)));
  result.forward = glm::vec3(now.view.world_from_camera[2]);
  result.focal_px = {k.fx, k.fy};
  result.principal_px = {k.cx, k.cy};
  result.radial = {k.k1, k.k2, k.k3};
  result.radial_divisor = {k.k4, k.k5, k.k6};
  result.tangential = {k.p1, k.p2};
  result.white_ratio = static_cast<float>(past.view.white / now.view.white);
  result.samples = static_cast<float>(samples);
  double frames = std::min(frames_that_stay(), frames_after(moved.rest));
  // Without photons caustics are traced, and are in the same mean as all other light.
  if ((*features_ & gpu::FEATURE_PHOTONS) == 0)
    frames = std::min(frames, frames_after(moved.throws_caustics));
  result.most_samples = static_cast<float>(frames) * result.samples;
  result.most_caustic_samples =
      static_cast<float>(std::min(frames, frames_after(moved.throws_caustics))) * result.samples;
  result.moved_count = static_cast<std::uint32_t>(moved.moved.size());
  result.most_drift = static_cast<float>(most_drift);
  return result;
}

void History::find_surfaces(const Buffers& scene, std::uint32_t features, std::int64_t samples) {
  if (samples_ == samples) return;
  if (features_ != features) {
    features_.reset();  // stays empty if creating the kernel throws
    make_kernels({&surface_, &cover_, &blend_}, device_, frame_passes, features);
    features_ = features;
  }
  Frame& now = frames_[now_];
  const MovedInstances moved_now = moved();
  std::vector<gpu::GpuArrival> from;
  if (!moved_now.moved.empty()) from = arrivals(light_.environment(), light_.lamps());
  gpu::GpuHistory values = constants(samples, moved_now);
  values.arrival_count = static_cast<std::uint32_t>(from.size());
  const Purpose purpose = for_average(now.view.lens);
  upload_storage(device_, purpose, history_, std::vector{values});
  upload_storage(device_, purpose, moves_, moved_now.moved);
  upload_storage(device_, purpose, arrivals_, from);
  upload_storage(device_, purpose, motions_, motions());
  Buffers buffers = scene;
  buffers["history"] = &history_;
  buffers["motions"] = &motions_;
  buffers["moves"] = &moves_;
  buffers["arrivals"] = &arrivals_;
  buffers["places"] = &now.places;
  buffers["things"] = &now.things;
  buffers["befores"] = &befores_;
  buffers["bent_places"] = &bent_places_;
  buffers["past_points"] = &frames_[1 - now_].points;
  buffers["covers"] = &covers_;
  const auto width = static_cast<std::uint32_t>(now.view.lens.width);
  const auto height = static_cast<std::uint32_t>(now.view.lens.height);
  const std::uint32_t most_rows = std::max(most_pixels_at_once / width, 1u);
  device_.record([&](const vk::raii::CommandBuffer& commands) {
    for (Kernel* pass : {&surface_, &cover_})
      for (std::uint32_t y = 0; y < height; y += most_rows) {
        const std::uint32_t rows = std::min(most_rows, height - y);
        pass->dispatch({commands, gpu::GpuBatch{0, y, width, rows, 0, 0, 0, 0}, buffers},
                       width * rows);
      }
    keep_points(commands, *buffers.at("vertices"));
  });
  samples_ = samples;
  now.is_shown = true;
}

// Copies the vertices that deform, in whose shape the next frame will look for its past.
void History::keep_points(const vk::raii::CommandBuffer& commands, const Buffer& vertices) {
  const Frame& now = frames_[now_];
  constexpr vk::DeviceSize bytes = 2 * sizeof(gpu::vec4);  // of a vertex
  vk::DeviceSize points = 0;
  for (const GpuScene::Stance& stance : now.stances) {
    if (!stance.deformed || stance.deformed->vertices == 0) continue;
    const vk::DeviceSize count = stance.deformed->vertices;
    commands.copyBuffer(
        vertices.buffer, now.points.buffer,
        vk::BufferCopy(stance.deformed->first_vertex * bytes, points * bytes, count * bytes));
    points += count;
  }
  if (points > 0) device_.submissions().barrier(commands);
}

void History::record(const vk::raii::CommandBuffer& commands, gpu::GpuShow constants, int width,
                     const Denoiser::Band& band, Buffers band_buffers) {
  Frame &now = frames_[now_], &past = frames_[1 - now_];
  constants.in_band = 0;
  constants.count = static_cast<std::uint32_t>((band.bottom - band.top) * width);
  band_buffers.insert({{"history", &history_},
                       {"motions", &motions_},
                       {"places", &now.places},
                       {"things", &now.things},
                       {"covers", &covers_},
                       {"kept_lights", &now.lights},
                       {"kept_spreads", &now.spreads},
                       {"kept_albedos", &now.albedos},
                       {"kept_others", &now.others},
                       {"kept_caustics", &now.caustics},
                       {"befores", &befores_},
                       {"bent_places", &bent_places_},
                       {"past_places", &past.places},
                       {"past_things", &past.things},
                       {"past_lights", &past.lights},
                       {"past_spreads", &past.spreads},
                       {"past_albedos", &past.albedos},
                       {"past_others", &past.others},
                       {"past_caustics", &past.caustics}});
  for (Kernel* pass : {&blend_, &show_})
    pass->dispatch({commands, constants, band_buffers}, constants.count);
}

}  // namespace previz::render
