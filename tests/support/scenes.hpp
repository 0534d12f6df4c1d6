// Scenes made by code for tests of the renderer and of the CPU tracer: simple shapes, closed
// furnaces and whole random sets. World space, Z up, metres.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/scene/scene.hpp"
#include "drivers/calibration.hpp"

namespace previz::test {

// Shapes around the origin, with uvs; counter-clockwise seen from outside (rectangle: from +Z).
scene::Mesh rectangle_mesh(const glm::dvec2& size);
scene::Mesh box_mesh(const glm::dvec3& size);                        // flat normals
scene::Mesh uv_sphere_mesh(double radius, int segments, int rings);  // smooth normals
// 20 * 4^subdivisions triangles, smooth normals, no uvs.
scene::Mesh icosphere_mesh(double radius, int subdivisions);
// The same surface seen from the other side: winding and normals turned around.
scene::Mesh inside_out(scene::Mesh mesh);

scene::Material diffuse(const glm::vec3& albedo);  // Lambert: no specular at all
scene::Material plastic(const glm::vec3& base_color, float roughness, float ior = 1.5f);
scene::Material metal(const glm::vec3& f0, float roughness);
scene::Material glass(float ior);                                              // smooth, solid
scene::Material pane(const glm::vec3& tint = glm::vec3(1), float ior = 1.5f);  // smooth, thin
scene::Material emitter(const glm::vec3& radiance);                            // reflects nothing

std::uint32_t add_mesh(scene::Scene& scene, scene::Mesh mesh);
std::uint32_t add_material(scene::Scene& scene, scene::Material material);
std::uint32_t add_texture(scene::Scene& scene, scene::Texture texture);
// Each returns the instance's index; Instance::object counts instances.
std::uint32_t add_instance(scene::Scene& scene, std::uint32_t mesh, std::uint32_t material,
                           const glm::dmat4& world_from_object = glm::dmat4(1.0),
                           std::uint32_t presence = scene::world_both);
// The same for a mesh of its own, with a material of its own or one that is there.
std::uint32_t add(scene::Scene& scene, scene::Mesh mesh, scene::Material material,
                  const glm::dmat4& world_from_object = glm::dmat4(1.0),
                  std::uint32_t presence = scene::world_both);
std::uint32_t add(scene::Scene& scene, scene::Mesh mesh, std::uint32_t material,
                  const glm::dmat4& world_from_object = glm::dmat4(1.0),
                  std::uint32_t presence = scene::world_both);

// Moves the origin to a place.
glm::dmat4 at(const glm::dvec3& place);

// Texels are given row by row from the top.
scene::Texture texture_of(int width, int height, std::vector<glm::vec4> texels = {});
scene::Texture texture_of(const glm::vec4& texel);  // of a single one

// Squares of the given side at z = 0 (facing up) and z = gap (facing down).
scene::Scene facing_planes(double side_m, double gap_m, const scene::Material& lower,
                           const scene::Material& upper);
// Closed surfaces that face inwards; the sphere is an icosphere, so its radius is between
// 0.99 and 1 times the one given at 3 subdivisions.
scene::Scene furnace_box(const glm::dvec3& size, const scene::Material& wall);
scene::Scene furnace_sphere(double radius_m, int subdivisions, const scene::Material& wall);

// Lamps that are there in both worlds.
set::Light lamp(set::LightType type, const glm::dvec3& emission = glm::dvec3(1));
set::Light point_lamp(const glm::dvec3& position, const glm::dvec3& emission = glm::dvec3(1));
set::Light sphere_lamp(const glm::dvec3& position, double radius_m,
                       const glm::dvec3& emission = glm::dvec3(1));
// A rectangle that faces down, its width along X.
set::Light panel_lamp(const glm::dvec3& position, const glm::dvec2& size,
                      const glm::dvec3& emission = glm::dvec3(1));
// At infinity; the light travels in this direction.
set::Light sun_lamp(const glm::dvec3& direction, double angular_radius_rad = 0,
                    const glm::dvec3& emission = glm::dvec3(1));

lighting::EnvironmentMap uniform_environment(const glm::vec3& radiance, int size = 4);
// Bluish, with a side that is six times as bright.
lighting::EnvironmentMap one_sided_sky();

// All that a renderer is given for one picture.
struct View {
  scene::Scene scene;
  lighting::EnvironmentMap environment;
  ObserverCalibration calibration;
  glm::dmat4 world_from_camera{1.0};  // OpenCV axes
};

// World pose of a camera at `eye` that looks at `target`, picture up towards world Z (towards Y
// when it looks along Z).
glm::dmat4 look_at(const glm::dvec3& eye, const glm::dvec3& target);
// Square pixels, centred principal point, no distortion.
ObserverCalibration pinhole(int width, int height, double horizontal_fov_rad);

// Nothing but the sky, as a camera at `eye` sees it that looks at `target`.
View empty_view(const glm::dvec3& eye, const glm::dvec3& target, const ObserverCalibration& camera,
                const glm::vec3& sky = glm::vec3(0));

// A Lambert plane z = 0 in the dark, seen at the origin from the side by so narrow a picture that
// the whole of it shows one point.
View lit_point(double albedo, double side_m = 20);

struct RandomScene {
  int width = 160, height = 120;
  int real_objects = 4, virtual_objects = 4;  // together at most 12
  int removed_objects = 0;                    // further objects, in the real world only
  int lights = 0;                             // further set lights, of random types and gains
  bool tinted = false;                        // each set light has another colour when mixed
  bool lens = false;                          // thin lens focused on the table's centre
  int environment_size = 64;
};

// A table with real boxes and spheres (diffuse, textured, plastic), virtual objects that are
// diffuse, textured, plastic (roughness 0.1 to 0.6), rough metal, smooth metal or emissive, under a
// smooth environment with one to three lamp discs of 20 to 60 times the mean, seen by a camera that
// looks at the table from 25 to 55 degrees above it. Objects sink 2 mm into the table and do not
// touch each other. The same seed gives the same view on every machine; virtual object 0 of six
// consecutive seeds takes each of the six materials in turn.
View random_scene(std::uint32_t seed, const RandomScene& options = {});

}  // namespace previz::test
