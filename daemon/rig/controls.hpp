// Holds what the actions have set so far and performs them, without a thread, device or clock.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/live/look.hpp"
#include "daemon/core/pipeline/edits.hpp"
#include "daemon/core/pipeline/relight.hpp"
#include "daemon/core/render/picture/views.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/actions.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::rig {

// Requests that Controls cannot carry out, because they need devices or files.
enum class Request {
  start_take,
  stop_take,
  mark_good,
  snapshot,
  acknowledge,
  reload_set,
  keep_edits,
  next_set,
  previous_set
};

struct Outcome {
  std::string said;  // words for the display, the log and whoever asked
  bool refused = false;
  std::optional<Request> request;
  std::optional<session::MarkEvent> mark = {};  // for the running take
};

// The take that is recorded, or was last, as far as it is known.
struct LastTake {
  std::string name;            // empty: none yet
  bool is_ending = false;      // recording has ended, and it is not whole on the disk yet
  double behind_s = 0;         // of it that is not on the disk
  bool is_of_this_set = true;  // it was recorded with the text of the running set
};

// samples_up and samples_down step through these numbers (P6).
inline constexpr int sample_steps[] = {1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 50};

class Controls {
 public:
  // `edits` are those that were made before the set was read again; `scene` is the set's.
  explicit Controls(const set::Set& set, pipeline::Edits edits = {},
                    const scene::Scene& scene = {});

  const live::Look& look() const { return look_; }
  // Both return a name such as "vase", or nothing if the set has none.
  std::string selected_object() const;
  std::string selected_light() const;

  // Takes the lamps that were found in the light of the shown picture. They can be selected after
  // the set's own, under names that stay theirs as long as they are changed.
  void use_found(std::vector<pipeline::FoundLamp> found);

  // Takes what the frame of the take in review was recorded with.
  void use_recorded(pipeline::RecordedLook recorded) { recorded_ = std::move(recorded); }

  // Takes what the cross of the shown picture is on; nothing: no picture was shown yet.
  void use_aim(const std::optional<live::Aim>& aim) { aim_ = aim; }

  void use_take(LastTake take) { take_ = std::move(take); }

  // Forgets the marks, because another take begins.
  void begin_marks() { look_.marking.begin(); }
  // Withdraws the last mark, which no take has.
  void drop_mark() { look_.marking.withdraw(); }

  // Takes the samples per pixel that hold the set's frame rate, from which the buttons go on; 0:
  // not known.
  void use_governed(int samples) { governed_samples_ = samples; }

  // Performs an action that D-Bus, previzctl or a press asks for. `ended_refinement` means that the
  // press itself has ended a refinement, which the action then concerns.
  Outcome perform(const set::Action& action, bool ended_refinement = false);
  // Call this when a button goes down: it ends a refinement at once, before the kind of press is
  // known. Returns true if it did; a mode that the same press asks for is then not wanted.
  bool pushed();
  static bool is_mode(const set::Action& action);

  Outcome happened(live::Event event);

 private:
  Outcome change(live::Event event);
  Outcome snapshot(std::uint64_t live::Look::*of);
  Outcome apply(const set::ToMode& effect);
  Outcome apply(const set::Record& effect);
  Outcome apply(const set::MarkGood& effect);
  Outcome apply(const set::Acknowledge& effect);
  Outcome apply(const set::Snapshot& effect);
  Outcome apply(const set::ReloadSet& effect);
  Outcome apply(const set::KeepEdits& effect);
  Outcome apply(const set::OtherSet& effect);
  Outcome apply(const set::ChangeSamples& effect);
  Outcome apply(const set::HoldRate& effect);
  Outcome apply(const set::ToggleAccumulation& effect);
  Outcome apply(const set::NextEstimator& effect);
  Outcome apply(const set::NextLightMode& effect);
  Outcome apply(const set::TurnEnvironment& effect);
  Outcome apply(const set::NextView& effect);
  Outcome apply(const set::ToggleOsd& effect);
  Outcome apply(const set::TogglePassTimes& effect);
  Outcome apply(const set::ToggleGuides& effect);
  Outcome apply(const set::ToggleMarking& effect);
  Outcome apply(const set::MarkCorner& effect);
  Outcome apply(const set::Unmark& effect);
  Outcome apply(const set::NextCorner& effect);
  Outcome apply(const set::NextBox& effect);
  Outcome apply(const set::SelectObject& effect);
  Outcome apply(const set::MoveObject& effect);
  Outcome apply(const set::TurnObject& effect);
  Outcome apply(const set::ScaleObject& effect);
  Outcome apply(const set::ChangeVariant& effect);
  Outcome apply(const set::ResetObject& effect);
  Outcome apply(const set::ToggleTags& effect);
  Outcome apply(const set::PlayAnimations& effect);
  Outcome apply(const set::HoldAnimations& effect);
  Outcome apply(const set::SelectLight& effect);
  Outcome apply(const set::DimLight& effect);
  Outcome apply(const set::TintLight& effect);
  Outcome apply(const set::ResetLight& effect);
  Outcome apply(const set::ChangeExposure& effect);

  pipeline::Edits& edits() { return look_.of_take ? look_.take_edits : look_.edits; }
  const pipeline::Edits& edits() const { return look_.of_take ? look_.take_edits : look_.edits; }
  std::string variant_shown(const std::string& object) const;
  std::vector<std::string> lights() const;
  std::optional<Outcome> no_lamp() const;
  std::optional<Outcome> no_review() const;
  pipeline::LightEdit& light_edit();

  const set::Control control_;
  const double fps_;       // quality.fps
  const int set_samples_;  // quality.samples
  int governed_samples_ = 0;
  // The looks that an object can be shown in, in the order of the buttons.
  struct Looks {
    std::vector<std::string> names;  // "" is the file as it is, where no variant looks like that
    std::string own;                 // the one that the file has without a variant
    std::string as_set;              // "" may stand for `own`
  };

  std::vector<std::string> objects_;  // names of the virtual objects
  std::map<std::string, Looks> looks_;
  pipeline::RecordedLook recorded_;
  std::optional<live::Aim> aim_;
  LastTake take_;
  std::vector<std::string> set_lights_;
  std::vector<pipeline::FoundLamp> found_;
  const bool is_animated_;
  const bool has_tags_;    // a phantom has printed tags
  const bool hides_tags_;  // as the set has it
  const bool has_environment_;
  std::size_t object_ = 0;
  // The selected lamp, which stays so while it is not found in the light; empty: the first there
  // is.
  std::string light_;
  live::Look look_;
};

}  // namespace previz::rig
