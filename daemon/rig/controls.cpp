#include "daemon/rig/controls.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/trigonometric.hpp>
#include <iterator>
#include <numbers>
#include <utility>
#include <variant>

#include "daemon/core/set/check.hpp"
#include "daemon/core/set/names.hpp"
#include "daemon/core/set/problems.hpp"

namespace previz::rig {
namespace {

// Returns the value after this one in the order of names, wrapping around at the end.
template <class E>
E next_named(E value) {
  const auto all = set::names(E{});
  const auto at = std::ranges::find_if(all, [&](const auto& name) { return name.second == value; });
  return (at == all.end() || at + 1 == all.end() ? all.begin() : at + 1)->second;
}

std::size_t around(std::size_t index, int next, std::size_t size) {
  return (index + size + static_cast<std::size_t>(next + static_cast<int>(size))) % size;
}

Outcome only_live() {
  return {"only the live picture can be marked", true, {}};
}

Outcome none_of(const char* what) {
  return {std::string("this set has no ") + what, true, {}};
}

}  // namespace

Controls::Controls(const set::Set& set, pipeline::Edits edits, const scene::Scene& scene)
    : control_(set.control),
      fps_(set.quality.fps),
      set_samples_(set.quality.samples),
      is_animated_(std::ranges::any_of(
          set.objects, [](const set::Object& object) { return !object.animation.empty(); })),
      has_tags_(std::ranges::find(scene.instances, scene::TagPart::printed,
                                  &scene::Instance::tag) != scene.instances.end()),
      hides_tags_(set.hides_tags),
      has_environment_(set.lighting.environment.has_value()),
      look_(live::first_look(set)) {
  for (const set::Object& object : set.objects)
    if (object.presence == set::Presence::virtual_object) objects_.push_back(object.name);
  for (const scene::Variants& variants : scene.variants) {
    const set::Object& object = set.objects[variants.object];
    Looks looks{variants.names, variants.own, object.variant};
    if (looks.own.empty()) looks.names.insert(looks.names.begin(), "");
    looks_.emplace(object.name, std::move(looks));
  }
  for (const set::Light& light : set.lights) set_lights_.push_back(light.name);
  for (const set::CapturedLamp& lamp : set.captured_lamps) set_lights_.push_back(lamp.name);
  look_.edits = std::move(edits);
}

std::string Controls::selected_object() const {
  return objects_.empty() ? "" : objects_[object_];
}

std::vector<std::string> Controls::lights() const {
  std::vector<std::string> names = set_lights_;
  for (const pipeline::FoundLamp& lamp : found_) names.push_back(lamp.name);
  return names;
}

std::string Controls::selected_light() const {
  if (!light_.empty()) return light_;
  const std::vector<std::string> names = lights();
  return names.empty() ? "" : names.front();
}

void Controls::use_found(std::vector<pipeline::FoundLamp> found) {
  std::vector<std::string> changed;
  std::vector<glm::dvec3> towards;
  for (const auto& [name, edit] : edits().lights)
    if (edit.found_towards) changed.push_back(name), towards.push_back(*edit.found_towards);
  // A lamp that was changed keeps the name of its change, whatever number it has now, and no other
  // lamp gets that name.
  std::vector<bool> is_named(found.size());
  const auto meant = pipeline::lamps_meant(towards, found);
  for (std::size_t i = 0; i < meant.size(); ++i)
    if (meant[i]) {
      found[*meant[i]].name = changed[i];
      is_named[*meant[i]] = true;
    }
  std::vector<std::string> taken = set_lights_;
  taken.insert(taken.end(), changed.begin(), changed.end());
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (is_named[i]) continue;
    std::string& name = found[i].name;
    const auto is_taken = [&] { return std::ranges::find(taken, name) != taken.end(); };
    for (int number = 1; is_taken(); ++number) name = "found " + std::to_string(number);
    taken.push_back(name);
  }
  std::ranges::stable_sort(found, {}, [](const pipeline::FoundLamp& lamp) {
    return std::pair(lamp.name.size(), lamp.name);  // by number
  });
  // A selected lamp that is gone for a moment stays selected, if only by its name.
  found_ = std::move(found);
}

// Returns why the selected lamp cannot be changed, if it cannot.
std::optional<Outcome> Controls::no_lamp() const {
  const std::string name = selected_light();
  if (name.empty()) return none_of("lamp");
  const std::vector<std::string> names = lights();
  const bool is_there = std::ranges::find(names, name) != names.end();
  if (is_there || edits().lights.contains(name)) return std::nullopt;
  return Outcome{name + " is not in the current light", true, {}};
}

// Returns the change of the selected lamp; a found one is meant by its direction.
pipeline::LightEdit& Controls::light_edit() {
  const std::string name = selected_light();
  pipeline::LightEdit& edit = edits().lights[name];
  const auto found = std::ranges::find(found_, name, &pipeline::FoundLamp::name);
  if (found != found_.end()) {
    if (!edit.found_towards) edit.found_towards = found->direction;
    edit.found_from_camera = found->from_camera;
    edit.found_radius_rad = found->radius_from_camera_rad;
  }
  return edit;
}

Outcome Controls::perform(const set::Action& action, bool ended_refinement) {
  if (ended_refinement && std::holds_alternative<set::Snapshot>(action.effect))
    return snapshot(&live::Look::refined_snapshots);
  if (ended_refinement) aim_.reset();  // it is of the picture before the refinement
  return std::visit([this](const auto& effect) { return apply(effect); }, action.effect);
}

bool Controls::pushed() {
  const live::Mode before = look_.state.mode;
  change(live::Event::press);
  return look_.state.mode != before;
}

bool Controls::is_mode(const set::Action& action) {
  return std::holds_alternative<set::ToMode>(action.effect);
}

Outcome Controls::happened(live::Event event) {
  return change(event);
}

Outcome Controls::change(live::Event event) {
  const live::State before = look_.state;
  const bool asks_for_review =
      event == live::Event::wish_review || event == live::Event::toggle_review;
  if (asks_for_review && before.mode != live::Mode::review && !before.recording)
    if (auto refused = no_review()) return *refused;
  const live::Step taken = live::step(before, event);
  if (taken.refused) return {taken.refused, true, {}};
  look_.state = taken.state;
  // A refinement is of the picture that was shown before.
  if (taken.state.mode != live::Mode::refine)
    look_.of_take = taken.state.mode == live::Mode::review;
  if (event == live::Event::take_finished) look_.take_edits = {};
  if (taken.state.mode == live::Mode::refine && before.mode != live::Mode::refine)
    ++look_.refinements;
  Outcome outcome;
  if (taken.state.recording != before.recording) {
    outcome.request = taken.state.recording ? Request::start_take : Request::stop_take;
    outcome.said = taken.state.recording ? "recording" : "recording ended";
  } else {
    outcome.said = set::name_of(taken.state.mode);
  }
  return outcome;
}

// Returns why the last take cannot be played, where there is one.
std::optional<Outcome> Controls::no_review() const {
  if (take_.is_ending)
    return Outcome{
        fmt::format("{} is still being written: {:.1f} s", take_.name, take_.behind_s), true, {}};
  if (look_.state.has_take && !take_.is_of_this_set)
    return Outcome{take_.name +
                       " was recorded with another text of the set; previz render shows "
                       "it as it was, or restore that text",
                   true,
                   {}};
  return std::nullopt;
}

Outcome Controls::apply(const set::ToMode& effect) {
  switch (effect.mode) {
    case live::Mode::standby:
      return change(live::Event::toggle_standby);
    case live::Mode::live:
      return change(live::Event::wish_live);
    case live::Mode::refine:
      return change(live::Event::toggle_refine);
    case live::Mode::review:
      return change(live::Event::toggle_review);
  }
  return {};
}

Outcome Controls::apply(const set::Record&) {
  return change(live::Event::record_toggle);
}

Outcome Controls::apply(const set::MarkGood&) {
  if (look_.state.recording)
    return {"the running take is marked good when it is finished", false, Request::mark_good};
  if (take_.is_ending)
    return {take_.name + " is marked good when it is written", false, Request::mark_good};
  if (!look_.state.has_take) return {"no take recorded yet; nothing to mark", true, {}};
  return {"marking " + take_.name + " good", false, Request::mark_good};
}

Outcome Controls::apply(const set::Acknowledge&) {
  return {"noted", false, Request::acknowledge};
}

Outcome Controls::apply(const set::Snapshot&) {
  return snapshot(look_.state.mode == live::Mode::refine ? &live::Look::refined_snapshots
                                                         : &live::Look::snapshots);
}

Outcome Controls::snapshot(std::uint64_t live::Look::*of) {
  if (look_.state.mode == live::Mode::standby)
    return {"standby shows no picture; nothing to save", true, {}};
  if (!look_.state.has_good)
    return {"no frame with a pose and light yet; nothing to save", true, {}};
  ++(look_.*of);
  return {"saving a snapshot", false, Request::snapshot};
}

Outcome Controls::apply(const set::ReloadSet&) {
  if (look_.state.recording) return {"still recording; end the take first", true, {}};
  return {"reloading the set file", false, Request::reload_set};
}

Outcome Controls::apply(const set::KeepEdits&) {
  if (look_.state.recording) return {"still recording; end the take first", true, {}};
  if (look_.of_take)
    return {"changes to a take in review cannot be kept; only live changes can", true, {}};
  if (look_.edits == pipeline::Edits{})
    return {"buttons have changed nothing; nothing to keep", true, {}};
  return {"changes kept in the set file", false, Request::keep_edits};
}

Outcome Controls::apply(const set::OtherSet& effect) {
  if (look_.state.recording) return {"still recording; end the take first", true, {}};
  return {effect.next > 0 ? "next set" : "previous set", false,
          effect.next > 0 ? Request::next_set : Request::previous_set};
}

Outcome Controls::apply(const set::ChangeSamples& effect) {
  if (look_.governed && governed_samples_ > 0) look_.samples = governed_samples_;
  look_.governed = false;
  const int* const end = std::end(sample_steps);
  if (effect.next > 0) {
    const int* const above = std::upper_bound(std::begin(sample_steps), end, look_.samples);
    if (above != end) look_.samples = *above;
  } else {
    const int* const at = std::lower_bound(std::begin(sample_steps), end, look_.samples);
    if (at != std::begin(sample_steps)) look_.samples = *(at - 1);
  }
  return {set::plural(std::uint64_t(look_.samples), "sample"), false, {}};
}

Outcome Controls::apply(const set::HoldRate&) {
  if (!(fps_ > 0)) return {"quality.fps is 0 in this set file", true, {}};
  look_.governed = true;
  look_.samples = set_samples_;
  return {fmt::format("holding {:g} frames per second", fps_), false, {}};
}

Outcome Controls::apply(const set::ToggleAccumulation&) {
  look_.accumulates = !look_.accumulates;
  return {look_.accumulates ? "frame averaging on" : "frame averaging off", false, {}};
}

Outcome Controls::apply(const set::NextEstimator&) {
  look_.estimator = next_named(look_.estimator);
  return {std::string("estimator: ") + set::name_of(look_.estimator), false, {}};
}

Outcome Controls::apply(const set::NextLightMode&) {
  look_.light_mode = next_named(look_.light_mode);
  return {std::string("light: ") + set::name_of(look_.light_mode), false, {}};
}

Outcome Controls::apply(const set::TurnEnvironment& effect) {
  if (!has_environment_) return {"no environment file lights this set; nothing to turn", true, {}};
  if (look_.state.mode != live::Mode::live) return only_live();
  double& turn = look_.edits.environment_turn_rad;
  turn = std::remainder(turn + effect.steps * control_.turn_step_rad, 2 * std::numbers::pi);
  return {fmt::format("environment turned by {:+.0f} degrees", glm::degrees(turn)), false, {}};
}

Outcome Controls::apply(const set::NextView&) {
  const auto at = std::ranges::find(render::all_views, look_.view);
  look_.view = at + 1 == render::all_views.end() ? render::all_views.front() : *(at + 1);
  return {std::string("view: ") + render::name_of(look_.view), false, {}};
}

Outcome Controls::apply(const set::ToggleOsd&) {
  look_.osd = !look_.osd;
  return {look_.osd ? "overlay on" : "overlay off", false, {}};
}

// Whoever asks for the times while the overlay is hidden wants to see them.
Outcome Controls::apply(const set::TogglePassTimes&) {
  look_.pass_times = !look_.pass_times || !look_.osd;
  if (look_.pass_times) look_.osd = true;
  return {look_.pass_times ? "pass times on" : "pass times off", false, {}};
}

Outcome Controls::apply(const set::ToggleGuides&) {
  look_.guides = !look_.guides;
  return {look_.guides ? "guides on" : "guides off", false, {}};
}

Outcome Controls::apply(const set::ToggleMarking&) {
  live::Marking& marking = look_.marking;
  if (!marking.is_on && look_.state.mode != live::Mode::live) return only_live();
  marking.is_on = !marking.is_on;
  return {marking.is_on ? "aim the cross at " + marking.selected() : "marking off", false, {}};
}

// The first press shows the cross, which has to be aimed first.
Outcome Controls::apply(const set::MarkCorner&) {
  live::Marking& marking = look_.marking;
  if (!marking.is_on) return apply(set::ToggleMarking{});
  if (look_.state.mode != live::Mode::live) return only_live();
  if (!look_.state.recording)
    return {"marks are kept in a take; start one with record, then mark", true, {}};
  if (!aim_) return {"not marked: the picture was not live; aim and mark again", true, {}};
  if (!aim_->ray) return {"not marked: no tag in the picture shows where the camera is", true, {}};
  std::string before;
  if (!marking.take.empty() && marking.take != take_.name) {
    before = "marks so far are in " + marking.take + "; mark its boxes again; ";
    marking.begin();
  }
  marking.take = take_.name;
  Outcome outcome{"", false, {}, marking.mark(*aim_)};
  outcome.said = before + outcome.mark->point + ": " + live::Marking::words_of(*marking.last());
  if (const std::string box = marking.words_of_box(); !box.empty()) outcome.said += "; " + box;
  return outcome;
}

Outcome Controls::apply(const set::Unmark&) {
  live::Marking& marking = look_.marking;
  if (marking.last() && (!look_.state.recording || marking.take != take_.name))
    return {"the take with these marks has ended", true, {}};
  std::optional<session::MarkEvent> withdrawn = marking.withdraw();
  if (!withdrawn) return {"no corner is marked", true, {}};
  const std::string said =
      withdrawn->point + ": mark withdrawn, " + live::Marking::words_of(marking.selected_corner());
  return {said, false, {}, std::move(withdrawn)};
}

Outcome Controls::apply(const set::NextCorner&) {
  look_.marking.next_corner();
  return {"mark " + look_.marking.selected(), false, {}};
}

Outcome Controls::apply(const set::NextBox&) {
  const std::size_t before = look_.marking.boxes().size();
  look_.marking.next_box();
  const bool is_new = look_.marking.boxes().size() > before;
  return {"mark " + look_.marking.selected() + (is_new ? ", of a new box" : ""), false, {}};
}

Outcome Controls::apply(const set::SelectObject& effect) {
  if (objects_.empty()) return none_of("virtual object");
  object_ = around(object_, effect.next, objects_.size());
  return {"object: " + selected_object(), false, {}};
}

Outcome Controls::apply(const set::MoveObject& effect) {
  if (objects_.empty()) return none_of("virtual object");
  glm::dvec3& offset = edits().objects[selected_object()].offset_m;
  offset += control_.move_step_m * effect.steps;
  return {fmt::format("{} moved by {:+.3f} {:+.3f} {:+.3f} m", selected_object(), offset.x,
                      offset.y, offset.z),
          false,
          {}};
}

Outcome Controls::apply(const set::TurnObject& effect) {
  if (objects_.empty()) return none_of("virtual object");
  glm::dmat3& turn = edits().objects[selected_object()].turn;
  turn = glm::dmat3(glm::rotate(glm::dmat4(1), control_.turn_step_rad * glm::length(effect.steps),
                                glm::normalize(effect.steps))) *
         turn;
  // Rounded, so that no angle is -0.
  const glm::dvec3 angles =
      glm::round(pipeline::angles_of(turn) * (1800 / std::numbers::pi)) / 10.0;
  return {fmt::format("{} turned by {:+.1f} {:+.1f} {:+.1f} degrees", selected_object(),
                      angles.x + 0.0, angles.y + 0.0, angles.z + 0.0),
          false,
          {}};
}

Outcome Controls::apply(const set::ScaleObject& effect) {
  if (objects_.empty()) return none_of("virtual object");
  double& scale = edits().objects[selected_object()].scale;
  scale *= effect.steps > 0 ? control_.scale_step : 1 / control_.scale_step;
  return {fmt::format("{} scaled to {:.3g}", selected_object(), scale), false, {}};
}

// Returns the name of the look that an object with looks is shown in.
std::string Controls::variant_shown(const std::string& object) const {
  const Looks& looks = looks_.at(object);
  std::string shown = looks.as_set;
  const auto recorded = recorded_.variants.find(object);
  if (look_.of_take && recorded != recorded_.variants.end()) shown = recorded->second;
  const auto edit = edits().objects.find(object);
  if (edit != edits().objects.end() && edit->second.variant) shown = *edit->second.variant;
  return shown.empty() ? looks.own : shown;
}

Outcome Controls::apply(const set::ChangeVariant& effect) {
  if (objects_.empty()) return none_of("virtual object");
  const std::string object = selected_object();
  const auto looks = looks_.find(object);
  if (looks == looks_.end()) return {object + " has no variants in its file", true, {}};
  const std::vector<std::string>& names = looks->second.names;
  const auto at = std::ranges::find(names, variant_shown(object));
  // A take may have been recorded in a variant that the file no longer has.
  const std::size_t index = at == names.end() ? 0
                                              : around(static_cast<std::size_t>(at - names.begin()),
                                                       effect.next, names.size());
  edits().objects[object].variant = names[index];
  const std::string named =
      names[index].empty() ? "no variant" : "variant \"" + set::printable(names[index]) + '"';
  return {fmt::format("{}: {} ({} of {})", object, named, index + 1, names.size()), false, {}};
}

Outcome Controls::apply(const set::ResetObject&) {
  if (objects_.empty()) return none_of("virtual object");
  edits().objects.erase(selected_object());
  return {
      selected_object() + " is back as the " + (look_.of_take ? "take" : "set file") + " has it",
      false,
      {}};
}

Outcome Controls::apply(const set::ToggleTags&) {
  if (!has_tags_)
    return {"no phantom of this set has printed tags; previz model makes one", true, {}};
  const bool without = look_.of_take && recorded_.hides_tags ? *recorded_.hides_tags : hides_tags_;
  std::optional<bool>& hides = edits().hides_tags;
  const bool wanted = !hides.value_or(without);
  hides.reset();
  if (wanted != without) hides = wanted;
  return {wanted ? "tags hidden" : "tags shown", false, {}};
}

Outcome Controls::apply(const set::PlayAnimations&) {
  if (!is_animated_) return none_of("animation");
  ++look_.plays;
  look_.animations_held = false;
  return {"animations restarted", false, {}};
}

Outcome Controls::apply(const set::HoldAnimations&) {
  if (!is_animated_) return none_of("animation");
  look_.animations_held = !look_.animations_held;
  return {look_.animations_held ? "animations paused" : "animations continue", false, {}};
}

Outcome Controls::apply(const set::SelectLight& effect) {
  const std::vector<std::string> names = lights();
  if (names.empty()) return none_of("lamp");
  const auto at = std::ranges::find(names, selected_light());
  // Behind a lamp that is gone comes the first, before it the last.
  const std::size_t from = at != names.end() ? static_cast<std::size_t>(at - names.begin())
                           : effect.next > 0 ? names.size() - 1
                                             : 0;
  light_ = names[around(from, effect.next, names.size())];
  return {"lamp: " + selected_light(), false, {}};
}

Outcome Controls::apply(const set::DimLight& effect) {
  if (auto refused = no_lamp()) return *refused;
  double& stops = light_edit().stops;
  stops += effect.steps * control_.light_step_stops;
  return {fmt::format("{} {:+.2f} stops", selected_light(), stops), false, {}};
}

Outcome Controls::apply(const set::TintLight& effect) {
  if (auto refused = no_lamp()) return *refused;
  pipeline::LightEdit& edit = light_edit();
  edit.warm_stops += effect.warmer * control_.tint_step_stops;
  edit.green_stops += effect.greener * control_.tint_step_stops;
  return {fmt::format("{} warm {:+.2f} green {:+.2f} stops", selected_light(), edit.warm_stops,
                      edit.green_stops),
          false,
          {}};
}

Outcome Controls::apply(const set::ResetLight&) {
  if (auto refused = no_lamp()) return *refused;
  edits().lights.erase(selected_light());
  return {
      selected_light() + " is reset to the " + (look_.of_take ? "take" : "set file"), false, {}};
}

Outcome Controls::apply(const set::ChangeExposure& effect) {
  look_.exposure_steps += effect.steps;
  return {
      fmt::format("exposure {:+.2f} stops", look_.exposure_steps * control_.exposure_step_stops),
      false,
      {}};
}

}  // namespace previz::rig
