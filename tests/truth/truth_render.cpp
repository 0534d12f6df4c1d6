#include "tests/truth/truth_render.hpp"

#include <chrono>
#include <iostream>

#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/output/exr.hpp"
#include "daemon/core/output/png.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/tools/post/render.hpp"
#include "drivers/error.hpp"
#include "tests/truth/cpu_tracer.hpp"
#include "tests/truth/truth_take.hpp"

namespace previz::truth {

RenderedFrame render_truth_frame(const TruthSet& set, int frame, const RenderSettings& settings,
                                 const std::filesystem::path& directory) {
  const std::uint64_t index = session_index(set, frame);
  post::RenderOptions options;
  options.session = directory / "session";
  options.frames = post::FrameRange{index, index};
  options.samples = settings.samples;
  options.adaptive = settings.adaptive;
  options.denoise = settings.denoise;
  options.neighbours = settings.neighbours;
  options.seed = settings.seed;
  options.directory = directory / "render";
  options.exr = options.png = true;
  options.video = false;
  options.force = true;
  options.device.name = settings.device;
  const post::RenderReport report = post::render_session(options, std::cerr);
  if (report.frames.empty()) {
    throw Error(set.name + ": frame " + std::to_string(frame) + " was not rendered");
  }
  const auto place = [&](const char* extension) {
    return directory / (frame_name(frame) + extension);
  };
  for (const char* extension : {".exr", ".png"}) {
    std::filesystem::rename(
        directory / "render" / (frame_name(static_cast<int>(index)) + extension), place(extension));
  }

  RenderedFrame out;
  out.record = report.frames.front();
  out.estimate.picture = output::read_png(place(".png"));
  render::Layers layers = output::read_exr(place(".exr"));
  out.estimate.composite = std::move(layers.composite);
  out.estimate.mixed = std::move(layers.mixed);
  out.estimate.real = std::move(layers.real);
  out.estimate.diff = std::move(layers.diff);
  out.estimate.mask = std::move(layers.mask);
  return out;
}

RenderedFrame trace_truth_frame(const TruthSet& set, int frame, int samples) {
  const auto begin = std::chrono::steady_clock::now();
  const TruthFrame truth = load_truth_frame(set, frame);
  const set::Set objects = set_of(set);
  const scene::Scene scene = scene::load_scene(objects);
  const lighting::Lighting lighting = lighting::load_environment(objects.lighting);
  CpuTracer tracer(scene, lighting.environment);
  // The same random numbers in both worlds: what the virtual objects do not touch cancels.
  const auto half = [&](std::uint64_t seed) {
    const auto trace = [&](std::uint32_t world) {
      return tracer.trace(set.observer, observer_frame(set, frame).world_from_camera, world,
                          samples / 2, seed);
    };
    const TracedPicture mixed = trace(scene::world_mixed), real = trace(scene::world_real);
    EstimatedFrame out;
    out.mixed.assign(mixed.mean.begin(), mixed.mean.end());
    out.real.assign(real.mean.begin(), real.mean.end());
    out.mask.assign(mixed.mask.begin(), mixed.mask.end());
    for (std::size_t i = 0; i < out.mask.size(); ++i)
      out.diff.push_back(out.mixed[i] - out.real[i]);
    return composited(truth, out);
  };
  const EstimatedFrame a = half(1), b = half(2);
  RenderedFrame out{a, {}, chance_between(truth, a, b)};
  for (std::size_t i = 0; i < a.mask.size(); ++i) {
    out.estimate.mixed[i] = 0.5F * (a.mixed[i] + b.mixed[i]);
    out.estimate.real[i] = 0.5F * (a.real[i] + b.real[i]);
    out.estimate.diff[i] = 0.5F * (a.diff[i] + b.diff[i]);
    out.estimate.mask[i] = 0.5F * (a.mask[i] + b.mask[i]);
  }
  out.estimate = composited(truth, out.estimate);
  out.record.samples = samples;
  out.record.render_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return out;
}

}  // namespace previz::truth
