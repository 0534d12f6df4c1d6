#include "daemon/render/history.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <utility>

#include "shaders/history.spv.h"
#include "shaders/history_cover.spv.h"
#include "shaders/history_show.spv.h"
#include "shaders/history_surface.spv.h"

namespace previz::render {
namespace {

// The past counts as no more frames than these: with so many, noise is that of a fifth to a sixth,
// and what nobody knew of is gone after as many.
constexpr double most_frames = 31;
// A past that counts as less than this many frames is none.
constexpr double least_frames = 0.25;
// By this share light may have changed over the frames that are averaged. Their mean age is half
// their number, so the mean is off by half of it.
constexpr double most_drift = 0.04;
// What is seen on an instance, or in its shadow, may lag behind it by so many pixels.
constexpr double most_lag_px = 1;
// The light around the set is compared in this many cells a side, each 4 pi / 256 of the sphere.
constexpr std::size_t light_cells = 16;
// A lamp is another one if it moved by 1 / 20 of a radian or of a metre.
constexpr double lamp_moves = 20;

// A dispatch works on no more pixels than these: devices that allow 65,535 work groups at once
// could not do a picture of 3840x2160 in one.
constexpr std::uint32_t most_pixels_at_once = 1u << 21;

double largest_channel(const glm::dvec3& v) {
  return std::max({v.r, v.g, v.b});
}

std::vector<glm::dvec3> in_cells(const EncodedEnvironment& environment) {
  std::vector<glm::dvec3> cells(light_cells * light_cells, glm::dvec3(0));
  const std::size_t size = environment.size;
  for (std::size_t j = 0; j < size; ++j)
    for (std::size_t i = 0; i < size; ++i) {
      const glm::vec4& texel = environment.radiance[(j + 1) * (size + 2) + i + 1];
      cells[j * light_cells / size * light_cells + i * light_cells / size] +=
          glm::dvec3(texel) / static_cast<double>(size * size);
    }
  return cells;
}

glm::dvec3 brightness(const set::Light& lamp) {
  return glm::dvec3(lamp.emission) * (glm::dvec3(lamp.gain_real) + lamp.gain_mixed * lamp.tint);
}

double change_of_lamp(const set::Light& before, const set::Light& now) {
  const bool is_another = before.type != now.type || before.width_m != now.width_m ||
                          before.height_m != now.height_m || before.radius_m != now.radius_m ||
                          before.inner_cone_rad != now.inner_cone_rad ||
                          before.outer_cone_rad != now.outer_cone_rad;
  if (is_another) return 1;
  const auto relative = [](const glm::dvec3& a, const glm::dvec3& b) {
    const double most = largest_channel(glm::max(a, b));
    return most > 0 ? largest_channel(glm::abs(a - b)) / most : 0.0;
  };
  const glm::dvec3 mixed_before = before.gain_mixed * before.tint * before.emission;
  const glm::dvec3 mixed_now = now.gain_mixed * now.tint * now.emission;
  const double dimmed =
      std::max(relative(brightness(before), brightness(now)), relative(mixed_before, mixed_now));
  const double moved = glm::length(now.position - before.position) +
                       glm::length(now.direction - before.direction) +
                       glm::length(now.up - before.up) +
                       std::abs(now.angular_radius_rad - before.angular_radius_rad);
  return dimmed + lamp_moves * moved;
}

void set_rotation(gpu::vec4 (&rows)[3], const glm::dmat3& rotation) {
  for (int r = 0; r < 3; ++r)
    rows[r] = glm::vec4(rotation[0][r], rotation[1][r], rotation[2][r], 0.0);
}

std::array<glm::dvec3, 8> corners_of(const GpuScene::Stance& stance) {
  std::array<glm::dvec3, 8> corners;
  for (std::size_t i = 0; i < corners.size(); ++i)
    corners[i] = glm::dvec3((i & 1) != 0 ? stance.high.x : stance.low.x,
                            (i & 2) != 0 ? stance.high.y : stance.low.y,
                            (i & 4) != 0 ? stance.high.z : stance.low.z);
  return corners;
}

// Returns how far an instance has moved over the picture at most, in pixels.
double moved_px(const GpuScene::Stance& before, const GpuScene::Stance& now,
                const History::View& view) {
  const glm::dvec3 camera(view.world_from_camera[3]);
  double moved = 0, distance = std::numeric_limits<double>::infinity(), size = 0;
  const glm::dvec3 middle(now.world_from_object *
                          glm::dvec4(0.5 * glm::dvec3(now.low + now.high), 1.0));
  for (const glm::dvec3& corner : corners_of(now)) {
    const glm::dvec3 was(before.world_from_object * glm::dvec4(corner, 1.0));
    const glm::dvec3 is(now.world_from_object * glm::dvec4(corner, 1.0));
    moved = std::max(moved, glm::length(is - was));
    size = std::max(size, glm::length(is - middle));
  }
  distance = std::max(glm::length(middle - camera) - size, 0.1 * size);
  if (!(moved > 0)) return 0;
  return view.lens.fx * moved / std::max(distance, 1e-6);
}

}  // namespace

double change_of_light(const std::vector<glm::dvec3>& before, const std::vector<glm::dvec3>& now) {
  double change = 0, all_before = 0, all_now = 0;
  for (std::size_t i = 0; i < now.size(); ++i) {
    change += largest_channel(glm::abs(now[i] - before[i]));
    all_before += largest_channel(before[i]);
    all_now += largest_channel(now[i]);
  }
  const double all = std::max(all_before, all_now);
  return all > 0 ? change / all : 0;
}

double change_of_lamps(const std::vector<set::Light>& before, const std::vector<set::Light>& now) {
  if (before.size() != now.size()) return 1;
  double change = 0;
  for (std::size_t i = 0; i < now.size(); ++i)
    change = std::max(change, change_of_lamp(before[i], now[i]));
  return change;
}

History::History(Device& device)
    : device_(device),
      blend_(device, "history", history_spv),
      show_(device, "history_show", history_show_spv) {}

void History::forget() {
  shorten(0);
}

void History::shorten(double frames) {
  shortened_ = std::min(shortened_, frames);
}

void History::light_with(const EncodedEnvironment& environment) {
  std::vector<glm::dvec3> cells = in_cells(environment);
  if (environment_.empty())
    forget();
  else if (const double change = change_of_light(environment_, cells); change > 0)
    shorten(most_drift / change);
  environment_ = std::move(cells);
}

void History::light_with(std::vector<set::Light> lamps) {
  if (lamps_) {
    if (const double change = change_of_lamps(*lamps_, lamps); change > 0)
      shorten(most_drift / change);
  }
  lamps_ = std::move(lamps);
}

void History::reserve(Frame& frame) {
  const std::size_t pixels = static_cast<std::size_t>(frame.view.lens.width) *
                             static_cast<std::size_t>(frame.view.lens.height);
  if (pixels <= frame.pixels) return;
  frame.pixels = 0;  // stays 0 if an allocation below throws
  for (Buffer* buffer : {&frame.places, &frame.lights})
    *buffer =
        create_texel_buffer(device_, pixels * sizeof(gpu::vec4), vk::Format::eR32G32B32A32Sfloat);
  frame.classes = create_texel_buffer(device_, pixels * sizeof(float), vk::Format::eR32Sfloat);
  for (Buffer* buffer :
       {&frame.things, &frame.spreads, &frame.albedos, &frame.others, &frame.caustics})
    *buffer = create_texel_buffer(device_, pixels * sizeof(gpu::uvec2), vk::Format::eR32G32Uint);
  frame.pixels = pixels;
  if (covers_.size < pixels * sizeof(float))
    covers_ = create_storage_buffer(device_, pixels * sizeof(float));
}

void History::begin(const View& view, std::vector<GpuScene::Stance> stances) {
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
  double frames = std::min(most_frames, shortened_now_);
  for (std::size_t i = 0; i < now.stances.size(); ++i) {
    const GpuScene::Stance &is = now.stances[i], &was = past.stances[i];
    if (is == was) continue;
    if (is.material != was.material || is.presence != was.presence || is.shape != was.shape)
      return 0;
    if (is.low.x > is.high.x) continue;  // nothing is in it
    frames = std::min(frames, most_lag_px / std::max(moved_px(was, is, now.view), 1e-9));
  }
  return frames < least_frames ? 0 : frames;
}

std::vector<gpu::GpuMotion> History::motions() const {
  const Frame &now = frames_[now_], &past = frames_[1 - now_];
  std::vector<gpu::GpuMotion> result(std::max<std::size_t>(now.stances.size(), 1));
  if (!past.is_shown || past.stances.size() != now.stances.size()) return result;
  const glm::dvec3 camera_now(now.view.world_from_camera[3]);
  const glm::dvec3 camera_before(past.view.world_from_camera[3]);
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
    result[i].is_known = is_finite && now.stances[i].shape == past.stances[i].shape ? 1 : 0;
  }
  return result;
}

gpu::GpuHistory History::constants(std::int64_t samples) const {
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
  result.most_samples = static_cast<float>(frames_that_stay()) * result.samples;
  return result;
}

void History::find_surfaces(const Buffers& scene, std::uint32_t features, std::int64_t samples) {
  if (samples_ == samples) return;
  if (features_ != features) {
    features_.reset();  // stays empty if creating the kernel throws
    surface_ = Kernel(device_, "history_surface", history_surface_spv, {features});
    cover_ = Kernel(device_, "history_cover", history_cover_spv, {features});
    features_ = features;
  }
  Frame& now = frames_[now_];
  upload_storage(device_, history_, std::vector{constants(samples)});
  upload_storage(device_, motions_, motions());
  Buffers buffers = scene;
  buffers["history"] = &history_;
  buffers["motions"] = &motions_;
  buffers["places"] = &now.places;
  buffers["things"] = &now.things;
  buffers["classes"] = &now.classes;
  buffers["covers"] = &covers_;
  const auto width = static_cast<std::uint32_t>(now.view.lens.width);
  const auto height = static_cast<std::uint32_t>(now.view.lens.height);
  const std::uint32_t most_rows = std::max(most_pixels_at_once / width, 1u);
  device_.submit([&](const vk::raii::CommandBuffer& commands) {
    for (Kernel* pass : {&surface_, &cover_})
      for (std::uint32_t y = 0; y < height; y += most_rows) {
        const std::uint32_t rows = std::min(most_rows, height - y);
        pass->dispatch({commands, gpu::GpuBatch{0, y, width, rows, 0, 0, 0}, buffers},
                       width * rows);
      }
  });
  samples_ = samples;
  now.is_shown = true;
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
                       {"classes", &now.classes},
                       {"past_places", &past.places},
                       {"past_things", &past.things},
                       {"past_lights", &past.lights},
                       {"past_classes", &past.classes},
                       {"past_spreads", &past.spreads},
                       {"past_albedos", &past.albedos},
                       {"past_others", &past.others},
                       {"past_caustics", &past.caustics}});
  for (Kernel* pass : {&blend_, &show_})
    pass->dispatch({commands, constants, band_buffers}, constants.count);
}

}  // namespace previz::render
