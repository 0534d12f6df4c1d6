// A finished estimate of the light around the set, as the stages share it.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/render/world/gpu_environment.hpp"
#include "daemon/core/session/records.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::pipeline {

// The lamps that were found in an image and are still part of it, until somebody changes one.
struct ImageLamps {
  std::vector<set::Light> lamps;
  std::vector<int> regions;                        // of each lamp: index into `texels`
  std::vector<std::vector<std::uint32_t>> texels;  // those that a region's lamps are taken out of
  std::shared_ptr<const lighting::EnvironmentMap> without;  // the image without any of them
};

// A finished light estimate and the sequence numbers of the light frames it was made from.
struct Light {
  lighting::Lighting lighting;
  std::vector<set::Light> lamps;  // the sources as lamps, as the set has them; see relit()
  std::shared_ptr<const ImageLamps> image_lamps;  // null: the light has no image with lamps in it
  // Emission of the set's lamps that are as bright as the light camera sees them, by name.
  std::map<std::string, glm::dvec3> emissions;
  render::EncodedEnvironment encoded;    // made in advance, so that no frame waits for it
  glm::dvec3 camera_place{0};            // where the light camera stands; world, metres
  std::vector<std::uint64_t> sequences;  // empty: an environment given as a file
  session::CapturedLight record;         // the form in which a take carries the light
};
using LightPtr = std::shared_ptr<const Light>;

}  // namespace previz::pipeline
