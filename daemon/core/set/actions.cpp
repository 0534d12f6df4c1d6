#include "daemon/core/set/actions.hpp"

#include <algorithm>
#include <array>

namespace previz::set {
namespace {

// clang-format off
constexpr Action action_table[] = {
    {"live", "Live preview.", ToMode{Mode::live}},
    {"refine", "Freeze the last good frame and refine it; press again for live.", ToMode{Mode::refine}},
    {"review", "Play the last take; press again for live.", ToMode{Mode::review}},
    {"standby", "Switch the picture off but keep the cameras open; press again for live.", ToMode{Mode::standby}},
    {"record", "Start a take; press again to end it.", Record{}},
    {"mark_good", "Mark the running take, or the last one, as good, also while it is still being written.", MarkGood{}},
    {"acknowledge", "Acknowledge that a recording was cut off; clears the alarm.", Acknowledge{}},
    {"snapshot", "Write the next picture as EXR and PNG; the answer names the files.", Snapshot{}},
    {"reload_set", "Reload the set file; if it has a mistake, the old one stays in use.", ReloadSet{}},
    {"keep", "Write what buttons changed (objects' places and variants, lamps' brightness and colour, hidden tags) into the set file; the old file is kept beside it.", KeepEdits{}},
    {"next_set", "Change to the next set file of the folder.", OtherSet{1}},
    {"previous_set", "Change to the previous set file of the folder.", OtherSet{-1}},
    {"samples_up", "More samples per pixel: less noise, lower frame rate.", ChangeSamples{1}},
    {"samples_down", "Fewer samples per pixel.", ChangeSamples{-1}},
    {"hold_rate", "Let quality.fps decide the samples again, after samples_up or samples_down.", HoldRate{}},
    {"accumulate", "Switch frame averaging off; press again to switch it on.", ToggleAccumulation{}},
    {"estimator", "Next estimator: paired, difference.", NextEstimator{}},
    {"light_mode", "Next way to use the light camera's picture: image, sources, hybrid.", NextLightMode{}},
    {"environment_left", "Turn the environment file that lights the set a step counter-clockwise, seen from above.", TurnEnvironment{1}},
    {"environment_right", "Turn the environment file a step clockwise.", TurnEnvironment{-1}},
    {"debug_view", "Show the next layer in place of the composite.", NextView{}},
    {"osd", "Hide the overlay; press again to show it.", ToggleOsd{}},
    {"pass_times", "Show on the overlay how long each pass of the graphics card takes (a hidden overlay comes back); press again to hide the times.", TogglePassTimes{}},
    {"guides", "Show lines over the picture: the model's edges, tags, horizon and axes; press again to hide them.", ToggleGuides{}},
    {"marking", "Show a cross in the middle of the picture, for marking corners of real boxes; press again to hide it.", ToggleMarking{}},
    {"mark", "Mark the corner that the cross is on, in the running take, for previz model.", MarkCorner{}},
    {"unmark", "Withdraw the last mark.", Unmark{}},
    {"next_corner", "Select the next corner of the box to mark.", NextCorner{}},
    {"next_box", "Select the next box to mark.", NextBox{}},
    {"next_object", "Select the next virtual object.", SelectObject{1}},
    {"previous_object", "Select the previous virtual object.", SelectObject{-1}},
    {"move_left", "Move the selected object a step along -X.", MoveObject{{-1, 0, 0}}},
    {"move_right", "Move the selected object a step along +X.", MoveObject{{1, 0, 0}}},
    {"move_back", "Move the selected object a step along -Y.", MoveObject{{0, -1, 0}}},
    {"move_forward", "Move the selected object a step along +Y.", MoveObject{{0, 1, 0}}},
    {"move_down", "Move the selected object a step along -Z.", MoveObject{{0, 0, -1}}},
    {"move_up", "Move the selected object a step along +Z.", MoveObject{{0, 0, 1}}},
    {"turn_left", "Turn the selected object a step counter-clockwise, seen from above.", TurnObject{{0, 0, 1}}},
    {"turn_right", "Turn the selected object a step clockwise, seen from above.", TurnObject{{0, 0, -1}}},
    {"tilt_forward", "Turn the selected object a step about +X.", TurnObject{{1, 0, 0}}},
    {"tilt_back", "Turn the selected object a step about -X.", TurnObject{{-1, 0, 0}}},
    {"roll_right", "Turn the selected object a step about +Y.", TurnObject{{0, 1, 0}}},
    {"roll_left", "Turn the selected object a step about -Y.", TurnObject{{0, -1, 0}}},
    {"scale_up", "Make the selected object a step larger.", ScaleObject{1}},
    {"scale_down", "Make the selected object a step smaller.", ScaleObject{-1}},
    {"next_variant", "Show the selected object in its next material variant.", ChangeVariant{1}},
    {"previous_variant", "Show the selected object in its previous material variant.", ChangeVariant{-1}},
    {"reset_object", "Reset the selected object to its place and variant in the set file.", ResetObject{}},
    {"tags", "Hide the printed tags in the picture, or show them again.", ToggleTags{}},
    {"play", "Play the objects' animations from their beginning.", PlayAnimations{}},
    {"hold", "Pause the objects' animations; press again to continue.", HoldAnimations{}},
    {"next_light", "Select the next lamp of the set.", SelectLight{1}},
    {"previous_light", "Select the previous lamp of the set.", SelectLight{-1}},
    {"light_up", "Make the selected lamp a step brighter.", DimLight{1}},
    {"light_down", "Make the selected lamp a step darker.", DimLight{-1}},
    {"light_warmer", "Make the selected lamp a step warmer.", TintLight{1, 0}},
    {"light_cooler", "Make the selected lamp a step cooler.", TintLight{-1, 0}},
    {"light_greener", "Make the selected lamp a step greener.", TintLight{0, 1}},
    {"light_pinker", "Make the selected lamp a step pinker.", TintLight{0, -1}},
    {"reset_light", "Reset the selected lamp to its values in the set file.", ResetLight{}},
    {"exposure_up", "Make the film camera's shutter time a step longer.", ChangeExposure{1}},
    {"exposure_down", "Make the film camera's shutter time a step shorter.", ChangeExposure{-1}},
};
// clang-format on

constexpr auto action_list = [] {
  std::array<const char*, std::size(action_table)> list{};
  std::ranges::transform(action_table, list.begin(), &Action::name);
  return list;
}();

}  // namespace

std::span<const Action> actions() {
  return action_table;
}

const Action* find_action(const std::string& name) {
  const auto* found =
      std::ranges::find_if(action_table, [&](const Action& a) { return a.name == name; });
  return found == std::end(action_table) ? nullptr : found;
}

std::span<const char* const> action_names() {
  return action_list;
}

}  // namespace previz::set
