#include "tests/bench/equal_error/view.hpp"

#include <algorithm>

#include "daemon/core/lighting/light_mode.hpp"
#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/error.hpp"
#include "tests/support/lighting.hpp"
#include "tests/truth/cpu_camera.hpp"

namespace previz::bench {
namespace {

int chosen_frame(const truth::TruthSet& set, std::optional<int> frame) {
  if (set.truth_frames.empty()) throw Error(set.directory.string() + ": has no truth frame");
  if (!frame) return set.truth_frames.front();
  if (std::ranges::find(set.truth_frames, *frame) == set.truth_frames.end())
    throw Error(set.directory.string() + ": has no truth of frame " + std::to_string(*frame));
  return *frame;
}

}  // namespace

View load_view(const std::filesystem::path& directory, std::optional<int> frame, int width,
               set::LightMode light) {
  const truth::TruthSet truth = truth::load_truth_set(directory);
  View view;
  view.set = truth.name;
  view.frame = chosen_frame(truth, frame);
  set::Set set = truth::set_of(truth);
  view.scene = scene::load_scene(set);
  set.lighting.mode = light;
  lighting::Lighting lighting = lighting::load_environment(set.lighting);
  lighting::SourceTracker tracker(0);
  lighting::apply_mode(lighting, set.lighting, tracker, 0);
  view.lamps = lighting::lamps_of(lighting.sources, glm::dvec3(0), lighting::at_infinity);
  view.environment = std::move(lighting.environment);
  view.camera = truth::resized(truth.observer, 1.0 * width / truth.observer.intrinsics.width);
  view.world_from_camera = truth::observer_frame(truth, view.frame).world_from_camera;
  view.exposure = truth.exposure;
  return view;
}

scene::Scene world_alone(const scene::Scene& scene, std::uint32_t world) {
  scene::Scene alone = scene;
  std::erase_if(alone.instances,
                [&](const scene::Instance& instance) { return (instance.presence & world) == 0; });
  for (scene::Instance& instance : alone.instances) instance.presence = scene::world_both;
  for (set::Light& light : alone.lights) {
    if (world == scene::world_mixed) light.emission *= light.tint;
    light.tint = glm::dvec3(1);
    light.gain_mixed = light.gain_real =
        world == scene::world_mixed ? light.gain_mixed : light.gain_real;
  }
  return alone;
}

}  // namespace previz::bench
