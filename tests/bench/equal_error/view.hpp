// One frame of a ground truth set, at a size of its own, as renderers and references take it.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/scene/scene.hpp"
#include "tests/truth/truth_set.hpp"

namespace previz::bench {

struct View {
  std::string set;
  int frame = 0;
  scene::Scene scene;
  lighting::EnvironmentMap environment;
  std::vector<set::Light> lamps;  // taken out of it, by the mode of its light
  ObserverCalibration camera;
  glm::dmat4 world_from_camera{1.0};
  double exposure = 1;
};

// The set's objects under its true environment; `frame` absent: the first with truth. The picture
// is `width` pixels wide and shows what the set's does. Throws previz::Error naming what is
// missing.
View load_view(const std::filesystem::path& set, std::optional<int> frame, int width,
               set::LightMode light = set::LightMode::image);

// Returns the scene of one world alone: things that are not in that world are gone, and the rest is
// no longer compared with the other world.
scene::Scene world_alone(const scene::Scene& scene, std::uint32_t world);

}  // namespace previz::bench
