// This table lists the renderer's features: the name of each, when a frame needs it, which bit the
// shaders are specialised on, and what `previzd check` says about it. The pipelines, `check` and
// `trade` all use this table (shaders/README.md, "Only what the scene requires"). What draws an
// extension of materials is in the table of extensions (daemon/core/scene/material_extensions.hpp).
#pragma once

#include <bitset>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::render {

inline constexpr std::size_t max_features = 64;
// One bit per row of the table, in its order.
using MaterialFeatures = std::bitset<max_features>;

// What a frame requires of the renderer, as far as it is known.
struct Demand {
  const scene::Scene& scene;
  MaterialFeatures materials;  // material_features() of the scene
  const set::Estimation& estimation;
  set::LightSampling light_sampling = set::LightSampling::importance;
  bool shines_around = false;      // the light around the set is not black
  bool finds_lamps = false;        // lamps are taken out of the light around the set
  bool relights_captured = false;  // one of them is dimmed or tinted, by the set file
  bool lamps_shine = false;        // a lamp of the scene or a glowing surface gives light
  bool has_aperture = false;       // the observer's calibration has a thin lens
  bool has_plate = false;          // the camera has a picture for this frame
  bool denoises = false;
};

struct Feature {
  const char* name;             // in `check`, and as a variant in `trade`
  std::uint32_t bit = 0;        // FEATURE_* of the shaders; 0: no pipeline depends on it
  bool can_be_carried = false;  // `trade` may time it in a frame that does not need it, whose
                                // picture is then the same, bit for bit
  // Returns whether a material asks for the feature. Null: no material does.
  bool (*in_material)(const scene::Material&, const scene::Scene&, double specular_alpha) = nullptr;
  bool (*of_extension)(const scene::Material&) = nullptr;  // instead, of scene::MaterialFeature
  // Returns whether a frame needs the feature, given whether a material in use asks for it. Null: a
  // frame needs it exactly where a material asks for it.
  bool (*in_frame)(bool in_material, const Demand&) = nullptr;
  const char* used;  // what `check` says, in words for a film crew, about a set that uses it
};

std::span<const Feature> features();

// Returns which rows the materials of the scene ask for. Only materials of instances count,
// including instances that are in neither world, and the materials of all their variants: when a
// lost carrier's object comes back, or an object gets another look, no pipeline must be compiled
// for it. May read every texel.
MaterialFeatures material_features(const scene::Scene& scene, double specular_alpha);

// `feature` is a row of features().
bool is_needed(const Feature& feature, const Demand& demand);

// Returns the FEATURE_* bits of all rows that are needed.
std::uint32_t needed_bits(const Demand& demand);

// Returns what the frames of a set ask for before any of them is known: the light around the set
// counts as shining wherever it may shine. `materials` is material_features() with the set's
// specular threshold.
Demand demand_of(const set::Set& set, const scene::Scene& scene, const MaterialFeatures& materials);

// Returns the different FEATURE_* bits that the live pictures of a set can need, whatever its
// buttons are pressed for: first those that the set file asks for, then those of the other
// estimator, and last those with lamps that were found in the light around the set. From the first
// such lamp on, pictures are rendered for any number of them (Renderer::set_sources()).
// `has_aperture` says whether the observer's lens has an aperture. May read every texel.
std::vector<std::uint32_t> reachable_bits(const set::Set& set, const scene::Scene& scene,
                                          bool has_aperture);

}  // namespace previz::render
