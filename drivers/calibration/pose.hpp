// Reads and checks rigid transforms that a file gives by hand.
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace previz {

// A matrix passes as a rotation if no |entry| of R^T R - 1 is larger; people type poses with 6
// digits.
inline constexpr double rigid_tolerance = 1e-4;

// Turns about world X by angles.x, then Y, then Z (radians; Rz Ry Rx, Blender's "XYZ Euler"), then
// moves to `position`.
glm::dmat4 pose(const glm::dvec3& position, const glm::dvec3& angles_rad);

// Returns how far the upper 3x3 is from a rotation: the largest |entry| of R^T R - 1; infinite if
// it mirrors.
double rigidity_error(const glm::dmat4& transform);

// Returns what is wrong with a transform that has to be a rotation and a shift, and what is
// allowed; "" if nothing is wrong.
std::string rigidity_fault(const glm::dmat4& transform);

// Returns `transform` with its upper 3x3 replaced by the nearest rotation (polar decomposition by
// Newton's iteration, Higham 1986). The upper 3x3 must be regular.
glm::dmat4 nearest_rigid(const glm::dmat4& transform);

// A pose as a file gives it, before it is known which of its two forms was meant.
struct PoseDraft {
  std::optional<glm::dvec3> position;
  std::optional<glm::dvec3> rotation;
  std::optional<glm::dmat4> matrix;
};

// The keys that a file gives, by name, and whether their values could be read.
using GivenKeys = std::map<std::string, bool>;

// A key by its name, what is wrong with it and what is allowed.
struct KeyFault {
  std::string key, what;
};

// Returns what is wrong with a rigid pose given by position_m and rotation_deg or by `matrix_key`.
std::vector<KeyFault> faults(const PoseDraft& draft, const GivenKeys& given,
                             const std::string& matrix_key);

// Returns the transform of a draft without faults. A matrix is brought to the nearest rigid one.
glm::dmat4 rigid_transform(const PoseDraft& draft);

}  // namespace previz
