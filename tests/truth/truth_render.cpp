#include "tests/truth/truth_render.hpp"

#include <iostream>

#include "daemon/output/exr.hpp"
#include "daemon/output/png.hpp"
#include "daemon/post/render.hpp"
#include "drivers/error.hpp"
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

}  // namespace previz::truth
