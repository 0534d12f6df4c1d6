// Samples the white paper of printed tags: a grey card that is in the picture of every set.
#pragma once

#include <memory>
#include <string>

#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/tools/calibrate/sensor/surface_pixels.hpp"

namespace previz::calibrate {

// The name of all tags' paper among surfaces, and its albedo: that of office paper, neutral.
inline constexpr const char* paper_name = "paper";
inline constexpr double paper_albedo = 0.79;

// Looks at the tags of the stage. A tag counts where two or more of its white cells
// are at least three pixels wide and not clipped, where it faces the camera, and where the model
// does not hide it. Its radiance under the light is rendered by itself, so that a tag that is small
// in the picture is as good as a large one.
class Paper {
 public:
  Paper(const set::Set& set, const ObserverCalibration& camera, const scene::Scene& scene,
        const std::shared_ptr<render::Device>& device, int samples);
  ~Paper();

  void look_at(const ProbedShot& shot);
  // The white pixels of all shots so far; each view of a tag is a tile of its own.
  const SurfacePixels& seen() const;
  // Returns why no paper was seen, in words that say what to do; "" where it was.
  std::string why_not() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::calibrate
