// The rig's desk: what the actions have set so far. No thread, no device, no clock.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/pipeline/edits.hpp"
#include "daemon/render/views.hpp"
#include "daemon/rig/mode.hpp"
#include "daemon/set/actions.hpp"
#include "daemon/set/set.hpp"

namespace previz::rig {

// What the pipeline is to do with the next frame. Published as a whole, never changed.
struct Look {
  State state;
  int samples = 16;
  bool governed = false;  // quality.fps decides the samples, as long as nobody asks for a number
  set::Estimator estimator = set::Estimator::paired;
  set::LightMode light_mode = set::LightMode::image;
  render::View view = render::View::composite;
  bool osd = true;
  pipeline::Edits edits;
  std::uint64_t plays = 0;  // of the animations, begun anew so far
  bool animations_held = false;
  int exposure_steps = 0;               // asked for so far, up less down
  std::uint64_t snapshots = 0;          // asked for so far of live pictures
  std::uint64_t refined_snapshots = 0;  // and of refined ones
  std::uint64_t refinements = 0;        // begun so far
};

// Only somebody with devices and files can do these.
enum class Request { start_take, stop_take, mark_good, reload_set, next_set, previous_set };

struct Outcome {
  std::string said;  // for display, log and whoever asked
  bool refused = false;
  std::optional<Request> request;
};

// P6: what samples_up and samples_down go through.
inline constexpr int sample_steps[] = {1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 50};

class Controls {
 public:
  explicit Controls(const set::Set& set);

  const Look& look() const { return look_; }
  // "vase", or empty where the set has none.
  std::string selected_object() const;
  std::string selected_light() const;

  // Performs what D-Bus or previzctl asks for, or a press once its kind is known.
  // `ended_refinement`: the press has ended a refinement itself, and was meant for it.
  Outcome perform(const set::Action& action, bool ended_refinement = false);
  // A button went down: a refinement ends at once, before it is known what was pressed. Returns
  // true if one did; a mode that the same press asks for is then not wanted.
  bool pushed();
  static bool is_mode(const set::Action& action);

  Outcome happened(Event event);

 private:
  Outcome change(Event event);
  Outcome snapshot(std::uint64_t Look::*of);
  Outcome apply(const set::ToMode& effect);
  Outcome apply(const set::Record& effect);
  Outcome apply(const set::MarkGood& effect);
  Outcome apply(const set::Snapshot& effect);
  Outcome apply(const set::ReloadSet& effect);
  Outcome apply(const set::OtherSet& effect);
  Outcome apply(const set::ChangeSamples& effect);
  Outcome apply(const set::NextEstimator& effect);
  Outcome apply(const set::NextLightMode& effect);
  Outcome apply(const set::NextView& effect);
  Outcome apply(const set::ToggleOsd& effect);
  Outcome apply(const set::SelectObject& effect);
  Outcome apply(const set::MoveObject& effect);
  Outcome apply(const set::TurnObject& effect);
  Outcome apply(const set::ScaleObject& effect);
  Outcome apply(const set::ResetObject& effect);
  Outcome apply(const set::PlayAnimations& effect);
  Outcome apply(const set::HoldAnimations& effect);
  Outcome apply(const set::SelectLight& effect);
  Outcome apply(const set::DimLight& effect);
  Outcome apply(const set::TintLight& effect);
  Outcome apply(const set::ResetLight& effect);
  Outcome apply(const set::ChangeExposure& effect);

  const set::Control control_;
  std::vector<std::string> objects_;  // the virtual ones
  std::vector<std::string> lights_;
  const bool is_animated_;
  std::size_t object_ = 0, light_ = 0;
  Look look_;
};

}  // namespace previz::rig
