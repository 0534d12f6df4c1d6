// `previzd run`: the live pipeline, headless. Newest value only between stages; drops are counted.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <stop_token>

#include "daemon/pipeline/metrics.hpp"
#include "daemon/render/renderer.hpp"

namespace previz::rig {

struct LiveOptions {
  std::filesystem::path set_file;
  std::optional<int> samples;                      // quality.samples
  std::optional<std::filesystem::path> directory;  // output.directory
  bool loop = false;                               // replayed cameras start again at their end
  render::DeviceOptions device;
  std::stop_token stop;
};

// Runs until the observer's stream ends or a stop is requested. About once a second, and at the
// end, writes what a display would show, at the set's quality.scale, to DIR/picture.png and what
// the pipeline did to DIR/metrics.json. A frame whose pose is lost, or that comes before the first
// light, shows its plate untouched. Notes go to `out`. Throws previz::Error on anything that keeps
// the rig from running.
pipeline::MetricsSnapshot run_live(const LiveOptions& options, std::ostream& out);

}  // namespace previz::rig
