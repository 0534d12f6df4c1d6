// Declares the table of actions: everything that a button, D-Bus or previzctl can ask the rig to
// do. A new action is one row in actions.cpp; its effect is described here as data, and daemon/rig
// carries it out.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace previz::set {

enum class Mode {
  standby,  // cameras open, nothing tracked, rendered or shown
  live,     // the preview follows the camera
  refine,   // the last good frame, pose and light are frozen and get more samples
  review    // the last take is played
};

// The effects that an action can have. The sizes of steps come from the set's [control] table.
struct ToMode {  // enters the mode, or leaves it for live
  Mode mode = Mode::live;
};
struct Record {};  // starts a take, or stops it
struct MarkGood {};
struct Acknowledge {};
struct Snapshot {};
struct ReloadSet {};
struct KeepEdits {};  // writes what buttons have changed into the set file
struct OtherSet {     // loads the next set file by name in the running set's folder
  int next = 1;
};
struct ChangeSamples {
  int next = 1;  // moves along 1, 2, 3, 4, 6 ... 50 samples per pixel
};
struct HoldRate {};  // gives samples and size back to quality.fps
struct ToggleAccumulation {};
struct NextEstimator {};
struct NextLightMode {};
struct TurnEnvironment {
  int steps = 1;  // counter-clockwise, seen from above
};
struct NextView {};
struct ToggleOsd {};
struct TogglePassTimes {};
struct ToggleGuides {};
struct ToggleMarking {};  // shows the cross with which corners are marked, or hides it
struct MarkCorner {};     // marks the selected corner of a real box where the cross is
struct Unmark {};         // withdraws the last mark
struct NextCorner {};
struct NextBox {};
struct SelectObject {
  int next = 1;
};
struct MoveObject {
  glm::dvec3 steps{0};  // along the stage's axes
};
struct TurnObject {
  glm::dvec3 steps{0};  // about the stage's axes, through the object's origin
};
struct ScaleObject {
  int steps = 1;
};
struct ChangeVariant {
  int next = 1;  // moves along the variants of the selected object's materials
};
struct ResetObject {};
struct ToggleTags {};      // hides the printed tags in the picture, or shows them
struct PlayAnimations {};  // starts them from the beginning
struct HoldAnimations {};  // pauses them, or lets them go on
struct SelectLight {
  int next = 1;
};
struct DimLight {
  int steps = 1;
};
struct TintLight {
  int warmer = 0, greener = 0;  // steps
};
struct ResetLight {};
struct ChangeExposure {
  int steps = 1;
};

using Effect =
    std::variant<ToMode, Record, MarkGood, Acknowledge, Snapshot, ReloadSet, KeepEdits, OtherSet,
                 ChangeSamples, HoldRate, ToggleAccumulation, NextEstimator, NextLightMode,
                 TurnEnvironment, NextView, ToggleOsd, TogglePassTimes, ToggleGuides, ToggleMarking,
                 MarkCorner, Unmark, NextCorner, NextBox, SelectObject, MoveObject, TurnObject,
                 ScaleObject, ChangeVariant, ResetObject, ToggleTags, PlayAnimations,
                 HoldAnimations, SelectLight, DimLight, TintLight, ResetLight, ChangeExposure>;

struct Action {
  const char* name;
  const char* about;  // one line for the crew
  Effect effect;
};

std::span<const Action> actions();
// Returns null if there is no such action.
const Action* find_action(const std::string& name);
// Returns the names of all actions, in the table's order.
std::span<const char* const> action_names();

}  // namespace previz::set
