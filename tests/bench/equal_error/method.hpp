// A way to make the difference of the two worlds: one renderer of both, or two of one each.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/core/render/renderer.hpp"
#include "tests/bench/equal_error/view.hpp"
#include "tests/truth/compare.hpp"

namespace previz::bench {

struct Method {
  std::string name;
  set::Estimation estimation;
  bool separate = false;  // each world alone, with random numbers of its own; estimator is ignored
  set::LightSampling sampling = set::LightSampling::importance;  // of the view's environment
  bool denoise = false;   // quality.denoise: diff and mixed are then what the composite shows
  bool adaptive = false;  // quality.adaptive: what was rendered before is rendered again
};

// A method at work on a view. Time is CPU time of all threads, of rendering alone.
class MethodRun {
 public:
  // Compiles its pipelines, which is not timed. An adaptive method is not separate.
  MethodRun(const std::shared_ptr<render::Device>& device, const View& view, const Method& method);

  // Forgets what was rendered and the time it took.
  void begin(std::uint32_t seed);
  void render(int samples);

  int samples() const { return samples_; }
  double cpu_s() const { return cpu_s_ + denoise_s_; }
  // Segments and shadow rays so far.
  render::Counters counters() const;
  // Without composite and picture; with method.separate the mask of the mixed world alone is 0.
  truth::EstimatedFrame estimate();

 private:
  void begin_frame();
  void render_anew();  // all samples so far, and the time of that alone
  void denoise(render::Layers& layers);

  glm::dmat4 world_from_camera_;
  double exposure_;
  bool adaptive_, denoise_;
  std::uint32_t seed_ = 0;
  std::vector<std::unique_ptr<render::Renderer>> renderers_;  // of both worlds; of mixed, of real
  int samples_ = 0;
  double cpu_s_ = 0, denoise_s_ = 0;
};

}  // namespace previz::bench
