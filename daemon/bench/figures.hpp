// Holds what `previzd bench` measures, and writes it as a table for a terminal and as JSON.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/render/device/gpu.hpp"

namespace previz::bench {

// A live frame, as `previzd run` makes it of the camera's bytes: averaged with those before it,
// denoised, and shown by a display without a screen (headless), for which it comes down into the
// computer's memory only if it has to. All times are means over `frames` frames.
struct FrameFigures {
  int width = 0, height = 0, samples = 0;
  std::size_t triangles = 0;
  int frames = 0;
  double ms = 0;         // of the whole frame, on the clock, from the camera's bytes to its picture
  double begin_ms = 0;   // of these, until the bytes and the scene are on their way up
  double record_ms = 0;  // until all commands are recorded
  double show_ms = 0;    // until the picture is there, waiting for the device included
  double waited_ms = 0;  // of this, waiting for the device
  double cpu_ms = 0;     // of all the computer's cores
  double screen_ms = 0;  // after `ms`, until the display has the picture; 0: there is none
  bool comes_down = true;  // the picture, to be shown
  // From one picture to the next where frames follow at once: the next one is begun before the
  // picture of the last one is there.
  double interval_ms = 0;
  // Passes of the device, timed by its own clock, the longest first; empty: it has none.
  std::vector<render::DeviceTimes::Pass> passes;
  std::uint64_t rays = 0, shadow_rays = 0;  // a frame
  render::DeviceWork work;                  // a frame's, rounded up

  // Returns the time from the arrival of a frame to the display. The camera's readout, tracking,
  // and what is left until the screen's next refresh come on top.
  double latency_ms() const { return ms + screen_ms; }
  double rate() const { return interval_ms > 0 ? 1000 / interval_ms : 0; }
  double passes_ms() const;
  double ms_of(const std::string& pass) const;  // 0: it did not run
};

// Why something was not measured.
struct LeftOut {
  std::string what, why;
};

struct SetFigures {
  std::string set;
  int width = 0, height = 0, samples = 0;
  double ms = 0;      // of a frame of the set, from the camera's bytes to the picture
  double fps = 0;     // that the set asks for (quality.fps); 0: for none
  double camera_fps;  // of its take
};

struct BenchReport {
  std::string date, version;
  render::DeviceFacts device;
  std::string processor;
  unsigned cores = 0;
  double start_s = 0;  // until the first picture: the passes were compiled, or taken from a cache
  std::optional<double> up_bytes_s, down_bytes_s;  // of a copy; absent: the memory is shared
  std::vector<FrameFigures> by_size, by_samples, by_triangles;
  std::optional<SetFigures> set;
  std::vector<LeftOut> left_out;
  double took_s = 0;
  bool interrupted = false;

  // The frame that stands for the device: the largest of those of one sample up to 1920x1080.
  const FrameFigures* typical() const;
  std::string tracing_units() const;  // the device's that trace rays, in words
};

std::string bench_table(const BenchReport& report);
std::string bench_json(const BenchReport& report);

}  // namespace previz::bench
