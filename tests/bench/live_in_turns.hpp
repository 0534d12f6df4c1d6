// Live frames of a few scenes that differ in one property, rendered in turns, so that other work on
// the machine weighs on all of them alike; by parts of the frame and by passes of the device.
#pragma once

#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/render/renderer.hpp"
#include "tests/bench/measure.hpp"

namespace previz::bench {

// What happens before each frame, which is `round` of its scene, from 0; it is measured.
struct Step {
  std::string name;
  std::function<void(int round)> run;
};

struct LiveScene {
  std::string name;
  std::unique_ptr<render::Renderer> renderer;
  render::FrameInput frame;
  std::vector<Step> steps = {};
};

// CPU ms of each frame, by part; and ms of the device's clock, by pass.
struct LiveTimes {
  std::map<std::string, std::vector<double>> parts, passes;
  std::vector<double> whole;
};

inline void render_live(LiveScene& scene, int round, LiveTimes& times) {
  double whole = 0;
  const auto part = [&](const std::string& name, const auto& run) {
    const double cpu_ms = time_of(run).cpu_ms;
    times.parts[name].push_back(cpu_ms);
    whole += cpu_ms;
  };
  for (const Step& step : scene.steps) part(step.name, [&] { step.run(round); });
  part("begin", [&] { scene.renderer->begin(scene.frame); });
  part("sample", [&] {
    scene.renderer->render(1);
    scene.renderer->wait();
  });
  part("picture", [&] { scene.renderer->show(true); });
  times.whole.push_back(whole);
  for (const auto& pass : scene.renderer->take_times().passes)
    times.passes[pass.name].push_back(pass.ms);
}

// Renders so many frames of each scene, after some that make pipelines, buffers and history.
inline std::vector<LiveTimes> live_in_turns(std::vector<LiveScene>& scenes, int frames) {
  constexpr int warm = 3;
  std::vector<LiveTimes> times(scenes.size());
  for (int round = 0; round < warm + frames; ++round)
    for (std::size_t i = 0; i < scenes.size(); ++i) {
      if (round == warm) times[i] = {};
      render_live(scenes[i], round, times[i]);
    }
  return times;
}

inline void print_row(const std::string& name, const std::vector<double>& values) {
  std::printf("| %s |", name.c_str());
  for (const double value : values)
    if (value > 0)
      std::printf(" %.2f |", value);
    else
      std::printf(" |");
  std::printf("\n");
}

// Prints the medians: the parts in the order of the last scene's, which has all of them, then the
// passes that take a hundredth of a frame or more.
inline void print_live(const std::vector<LiveScene>& scenes, const std::vector<LiveTimes>& times) {
  std::vector<double> whole, over;
  for (const LiveTimes& one : times) {
    whole.push_back(median(one.whole));
    over.push_back(whole.back() / whole.front());
  }
  std::printf("| CPU ms |");
  for (const LiveScene& scene : scenes) std::printf(" %s |", scene.name.c_str());
  std::printf("\n| --- |");
  for (std::size_t i = 0; i < scenes.size(); ++i) std::printf(" --- |");
  std::printf("\n");
  using Kind = std::map<std::string, std::vector<double>> LiveTimes::*;
  const auto medians = [&](Kind kind, const std::string& name) {
    std::vector<double> values;
    for (const LiveTimes& one : times) {
      const auto found = (one.*kind).find(name);
      values.push_back(found == (one.*kind).end() ? 0 : median(found->second));
    }
    return values;
  };
  std::vector<std::string> parts;
  for (const Step& step : scenes.back().steps) parts.push_back(step.name);
  parts.insert(parts.end(), {"begin", "sample", "picture"});
  for (const std::string& name : parts) print_row(name, medians(&LiveTimes::parts, name));
  print_row("whole frame", whole);
  print_row("over the first", over);
  std::map<std::string, std::vector<double>> passes;
  for (const LiveTimes& one : times)
    for (const auto& [name, all] : one.passes)
      if (median(all) >= 0.01 * whole.front()) passes[name] = medians(&LiveTimes::passes, name);
  for (const auto& [name, values] : passes) print_row("ms of " + name, values);
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace previz::bench
