// The rig's verbs: the one table of everything that a button, D-Bus and previzctl can ask for.
// A new action is one entry in actions.cpp; what it does is data here, and done in daemon/rig.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace previz::set {

enum class Mode {
  standby,  // cameras open, nothing tracked, rendered or shown
  live,     // the preview follows the camera (P6)
  refine,   // the last good frame, pose and light are frozen and get more samples (P7)
  review    // the last take is played
};

// What an action does. Steps are those of the set's [control].
struct ToMode {  // and from there back to live
  Mode mode = Mode::live;
};
struct Record {};  // start, and stop
struct MarkGood {};
struct Snapshot {};
struct ReloadSet {};
struct OtherSet {  // of the running set's folder, by name
  int next = 1;
};
struct ChangeSamples {
  int next = 1;  // of the steps 1, 2, 3, 4, 6 ... 50
};
struct NextEstimator {};
struct NextLightMode {};
struct NextView {};
struct ToggleOsd {};
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
struct ResetObject {};
struct PlayAnimations {};  // from their beginning
struct HoldAnimations {};  // and go on
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
    std::variant<ToMode, Record, MarkGood, Snapshot, ReloadSet, OtherSet, ChangeSamples,
                 NextEstimator, NextLightMode, NextView, ToggleOsd, SelectObject, MoveObject,
                 TurnObject, ScaleObject, ResetObject, PlayAnimations, HoldAnimations, SelectLight,
                 DimLight, TintLight, ResetLight, ChangeExposure>;

struct Action {
  const char* name;
  const char* about;  // one line for the crew
  Effect effect;
};

std::span<const Action> actions();
// Null where there is no such action.
const Action* find_action(const std::string& name);
// The names alone, in the table's order.
std::span<const char* const> action_names();

}  // namespace previz::set
