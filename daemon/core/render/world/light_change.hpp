// Follows the light of a set from frame to frame, and says how far what was seen under it before is
// still true. What only trembles, a lamp on the mains or an estimate of a camera, is averaged; what
// changes ends the past (shaders/README.md, "Accumulation over time").
#pragma once

#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "daemon/core/render/world/gpu_environment.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::render {

// The past counts as no more frames than these: with so many, noise is that of a fifth to a sixth,
// and what nobody knew of is gone after as many.
constexpr double most_frames = 31;
// A past that counts as less than this many frames is none.
constexpr double least_frames = 0.25;
// By this share light may have changed over the frames that are averaged. Their mean age is half
// their number, so what is shown is off by half of it.
constexpr double most_drift = 0.04;

double largest_channel(const glm::dvec3& v);

// The light that arrives from all directions, in overlapping cells of the sphere whose sum is the
// sphere's mean radiance.
using LightCells = std::vector<glm::dvec3>;
LightCells light_cells(const EncodedEnvironment& environment);

// Return the share by which light differs: 0 for the same light, 1 and more for another one. Lamps
// are compared in their order.
double change_of_light(const LightCells& before, const LightCells& now);
double change_of_lamps(const std::vector<set::Light>& before, const std::vector<set::Light>& now);

class LightChange {
 public:
  void see(const EncodedEnvironment& environment);
  void see(LightCells environment);
  void see(std::vector<set::Light> lamps);
  // Compares the light that was seen last with the mean of what was seen before, of which each
  // frame has the weight that it has in what is shown. Returns as how many frames the past may
  // count, so that it is off by no more than 3 %: infinity where light is the same or only
  // trembles.
  double frames();
  // Return the light that was seen last.
  const LightCells& environment() const { return environment_; }
  const std::vector<set::Light>& lamps() const { return lamps_; }

 private:
  // A state of the light: what changes from frame to frame is a number beside others.
  struct State {
    // These hold the light of the environment and of directional lamps, wherever it was found.
    LightCells mixed, real;
    std::vector<set::Light> lamps;  // those that are somewhere; directional ones are in the cells
    std::vector<set::Light> suns;   // directional ones
  };
  static double change(const State& before, const State& now);
  State state() const;
  void follow(const State& now, double share);

  LightCells environment_;
  std::vector<set::Light> lamps_;
  bool is_seen_anew_ = false;  // since the last frame
  bool is_settled_ = false;    // the mean is what is there
  std::optional<State> mean_;
  double counted_ = 0;  // frames that are in the mean
};

}  // namespace previz::render
