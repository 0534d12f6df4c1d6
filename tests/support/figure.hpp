// Meshes that deform, made by code: a limb with joints in a row, and a ball that is squeezed by a
// morph target.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <vector>

#include "daemon/core/scene/scene.hpp"

namespace previz::test {

// A tube along Z from 0 to 1 m with a radius of 0.1 m, closed at neither end, whose vertices follow
// one or two of the joints, which stand above each other. 2 rings * segments triangles.
scene::Mesh limb_mesh(int rings, int segments, int joints);
// The joints of a limb, all at rest.
std::vector<scene::Deformation::Joint> limb_joints(int joints);
// A sphere whose only target makes it half as high and as much wider in X.
scene::Mesh squeezed_ball_mesh(double radius, int segments, int rings);

// Each adds a mesh of its own, its instance and its deformation, and returns the deformation's
// index.
std::uint32_t add_limb(scene::Scene& scene, const scene::Mesh& mesh, int joints,
                       std::uint32_t material, const glm::dmat4& world_from_object,
                       std::uint32_t presence = scene::world_both);
std::uint32_t add_squeezed_ball(scene::Scene& scene, const scene::Mesh& mesh,
                                std::uint32_t material, const glm::dmat4& world_from_object,
                                std::uint32_t presence = scene::world_both);

// The shape of a limb of which each joint is turned by this angle (about Y) against the one below.
scene::Shape bent_limb(const scene::Deformation& limb, double angle_rad);

// The scene with its meshes in these shapes for good.
scene::Scene posed(scene::Scene scene, const std::vector<scene::Shape>& shapes);

}  // namespace previz::test
