// Live frames of a scene made by code, measured.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "daemon/bench/figures.hpp"
#include "daemon/core/render/renderer.hpp"
#include "drivers/display.hpp"

namespace previz::bench {

// Describes what is measured: a virtual glass ball among many real spheres under a sky, seen by a
// camera that moves a little from frame to frame.
struct FrameWish {
  int width = 1280, height = 720, samples = 1;
  std::size_t triangles = 5'000;  // about so many
};

class Frames {
 public:
  explicit Frames(std::shared_ptr<render::Device> device);
  ~Frames();

  // Returns how long the first picture took, from the scene on.
  double start_s() const { return start_s_; }
  // Returns how long measure() will take, by what was measured before.
  double expected_s(const FrameWish& wish) const;
  FrameFigures measure(const FrameWish& wish);
  // Returns why pictures are not shown; empty: they are.
  const std::string& no_display() const { return no_display_; }

 private:
  struct Stage;
  void make_stage(const FrameWish& wish);
  void open_display(int width, int height);
  void begin();
  render::ShowTo where() const;
  double interval_ms(int samples, int frames);
  void frame(int samples);

  std::shared_ptr<render::Device> device_;
  std::unique_ptr<Stage> stage_;
  std::unique_ptr<Display> display_;  // of the size of the pictures
  std::string no_display_;
  double start_s_ = 0;
  double s_a_pixel_ = 0;         // of a frame, without its samples
  double s_a_sample_ = 0;        // of a pixel
  double s_a_triangle_ = 20e-6;  // of building a tree, on a slow core
};

}  // namespace previz::bench
