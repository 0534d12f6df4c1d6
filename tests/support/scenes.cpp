#include "tests/support/scenes.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <map>
#include <numbers>
#include <utility>

namespace previz::test {

using std::numbers::pi;

scene::Mesh rectangle_mesh(const glm::dvec2& size) {
  const glm::vec2 half = 0.5 * size;
  scene::Mesh mesh;
  mesh.name = "rectangle";
  mesh.positions = {
      {-half.x, -half.y, 0}, {half.x, -half.y, 0}, {half.x, half.y, 0}, {-half.x, half.y, 0}};
  mesh.normals.assign(4, {0, 0, 1});
  mesh.uvs = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

scene::Mesh box_mesh(const glm::dvec3& size) {
  scene::Mesh mesh;
  mesh.name = "box";
  const glm::vec3 half = 0.5 * size;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.0f, 1.0f}) {
      glm::vec3 normal(0), u(0), v(0);
      normal[axis] = side;
      u[(axis + 1) % 3] = side;
      v[(axis + 2) % 3] = 1;
      const auto first = static_cast<std::uint32_t>(mesh.positions.size());
      const glm::vec2 corners[] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
      for (const glm::vec2& corner : corners) {
        mesh.positions.push_back(half * (normal + corner.x * u + corner.y * v));
        mesh.normals.push_back(normal);
        mesh.uvs.emplace_back(0.5f + 0.5f * corner.x, 0.5f - 0.5f * corner.y);
      }
      mesh.triangles.emplace_back(first, first + 1, first + 2);
      mesh.triangles.emplace_back(first, first + 2, first + 3);
    }
  }
  return mesh;
}

scene::Mesh uv_sphere_mesh(double radius, int segments, int rings) {
  scene::Mesh mesh;
  mesh.name = "uv sphere";
  const auto columns = static_cast<std::uint32_t>(segments) + 1;  // the seam has two uvs
  for (int ring = 0; ring <= rings; ++ring) {
    for (int segment = 0; segment <= segments; ++segment) {
      const double u = static_cast<double>(segment) / segments;
      const double v = static_cast<double>(ring) / rings;
      // The seam's two columns and each pole are one point, to the last bit.
      const double azimuth = segment == segments ? 0 : 2 * pi * u;
      const double across = ring == 0 || ring == rings ? 0 : std::sin(pi * v);
      const glm::dvec3 normal(across * std::cos(azimuth), across * std::sin(azimuth),
                              std::cos(pi * v));
      mesh.positions.emplace_back(radius * normal);
      mesh.normals.emplace_back(normal);
      mesh.uvs.emplace_back(u, v);
    }
  }
  for (std::uint32_t ring = 0; ring < static_cast<std::uint32_t>(rings); ++ring) {
    for (std::uint32_t segment = 0; segment + 1 < columns; ++segment) {
      const std::uint32_t upper = ring * columns + segment, lower = upper + columns;
      if (ring + 1 < static_cast<std::uint32_t>(rings))
        mesh.triangles.emplace_back(upper, lower, lower + 1);
      if (ring > 0) mesh.triangles.emplace_back(upper, lower + 1, upper + 1);
    }
  }
  return mesh;
}

scene::Mesh icosphere_mesh(double radius, int subdivisions) {
  const double t = std::numbers::phi;
  std::vector<glm::dvec3> points = {{-1, t, 0}, {1, t, 0}, {-1, -t, 0}, {1, -t, 0},
                                    {0, -1, t}, {0, 1, t}, {0, -1, -t}, {0, 1, -t},
                                    {t, 0, -1}, {t, 0, 1}, {-t, 0, -1}, {-t, 0, 1}};
  for (glm::dvec3& point : points) point = glm::normalize(point);
  std::vector<glm::uvec3> triangles = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                       {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                       {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                       {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int i = 0; i < subdivisions; ++i) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [at, is_new] =
          middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(points.size()));
      if (is_new) points.push_back(glm::normalize(points[a] + points[b]));
      return at->second;
    };
    std::vector<glm::uvec3> finer;
    for (const glm::uvec3& corner : triangles) {
      const std::uint32_t ab = middle(corner.x, corner.y);
      const std::uint32_t bc = middle(corner.y, corner.z);
      const std::uint32_t ca = middle(corner.z, corner.x);
      finer.insert(finer.end(),
                   {{corner.x, ab, ca}, {corner.y, bc, ab}, {corner.z, ca, bc}, {ab, bc, ca}});
    }
    triangles = std::move(finer);
  }
  scene::Mesh mesh;
  mesh.name = "icosphere";
  for (const glm::dvec3& point : points) {
    mesh.positions.emplace_back(radius * point);
    mesh.normals.emplace_back(point);
  }
  mesh.triangles = std::move(triangles);
  return mesh;
}

scene::Mesh inside_out(scene::Mesh mesh) {
  for (glm::vec3& normal : mesh.normals) normal = -normal;
  for (glm::uvec3& triangle : mesh.triangles) std::swap(triangle.y, triangle.z);
  return mesh;
}

scene::Material diffuse(const glm::vec3& albedo) {
  scene::Material material;
  material.name = "diffuse";
  material.base_color = albedo;
  material.specular = 0;
  return material;
}

scene::Material plastic(const glm::vec3& base_color, float roughness, float ior) {
  scene::Material material;
  material.name = "plastic";
  material.base_color = base_color;
  material.roughness = roughness;
  material.ior = ior;
  return material;
}

scene::Material metal(const glm::vec3& f0, float roughness) {
  scene::Material material;
  material.name = "metal";
  material.base_color = f0;
  material.metallic = 1;
  material.roughness = roughness;
  return material;
}

scene::Material glass(float ior) {
  scene::Material material;
  material.name = "glass";
  material.roughness = 0;
  material.transmission = 1;
  material.ior = ior;
  material.thin_walled = false;
  return material;
}

scene::Material pane(const glm::vec3& tint, float ior) {
  scene::Material material = glass(ior);
  material.thin_walled = true;
  material.base_color = tint;
  return material;
}

scene::Material emitter(const glm::vec3& radiance) {
  scene::Material material = diffuse(glm::vec3(0));
  material.name = "emitter";
  material.emission = radiance;
  return material;
}

std::uint32_t add_mesh(scene::Scene& scene, scene::Mesh mesh) {
  scene.meshes.push_back(std::move(mesh));
  return static_cast<std::uint32_t>(scene.meshes.size() - 1);
}

std::uint32_t add_material(scene::Scene& scene, scene::Material material) {
  scene.materials.push_back(std::move(material));
  return static_cast<std::uint32_t>(scene.materials.size() - 1);
}

std::uint32_t add_texture(scene::Scene& scene, scene::Texture texture) {
  scene.textures.push_back(std::move(texture));
  return static_cast<std::uint32_t>(scene.textures.size() - 1);
}

std::uint32_t add_instance(scene::Scene& scene, std::uint32_t mesh, std::uint32_t material,
                           const glm::dmat4& world_from_object, std::uint32_t presence) {
  scene::Instance instance;
  instance.name = scene.meshes[mesh].name;
  instance.mesh = mesh;
  instance.material = material;
  instance.presence = presence;
  instance.object = static_cast<std::uint32_t>(scene.instances.size());
  instance.world_from_object = world_from_object;
  scene.instances.push_back(std::move(instance));
  return scene.instances.back().object;
}

std::uint32_t add(scene::Scene& scene, scene::Mesh mesh, scene::Material material,
                  const glm::dmat4& world_from_object, std::uint32_t presence) {
  return add(scene, std::move(mesh), add_material(scene, std::move(material)), world_from_object,
             presence);
}

std::uint32_t add(scene::Scene& scene, scene::Mesh mesh, std::uint32_t material,
                  const glm::dmat4& world_from_object, std::uint32_t presence) {
  return add_instance(scene, add_mesh(scene, std::move(mesh)), material, world_from_object,
                      presence);
}

glm::dmat4 at(const glm::dvec3& place) {
  return glm::translate(glm::dmat4(1.0), place);
}

scene::Texture texture_of(int width, int height, std::vector<glm::vec4> texels) {
  scene::Texture texture;
  texture.width = width;
  texture.height = height;
  texture.texels = std::move(texels);
  return texture;
}

scene::Texture texture_of(const glm::vec4& texel) {
  return texture_of(1, 1, {texel});
}

scene::Scene facing_planes(double side_m, double gap_m, const scene::Material& lower,
                           const scene::Material& upper) {
  scene::Scene scene;
  const std::uint32_t square = add_mesh(scene, rectangle_mesh({side_m, side_m}));
  add_instance(scene, square, add_material(scene, lower));
  add_instance(scene, square, add_material(scene, upper),
               glm::rotate(at({0, 0, gap_m}), pi, glm::dvec3(1, 0, 0)));
  return scene;
}

scene::Scene furnace_box(const glm::dvec3& size, const scene::Material& wall) {
  scene::Scene scene;
  add(scene, inside_out(box_mesh(size)), wall);
  return scene;
}

scene::Scene furnace_sphere(double radius_m, int subdivisions, const scene::Material& wall) {
  scene::Scene scene;
  add(scene, inside_out(icosphere_mesh(radius_m, subdivisions)), wall);
  return scene;
}

set::Light lamp(set::LightType type, const glm::dvec3& emission) {
  set::Light light;
  light.name = "lamp";
  light.type = type;
  light.emission = emission;
  light.gain_real = 1;
  return light;
}

set::Light point_lamp(const glm::dvec3& position, const glm::dvec3& emission) {
  set::Light light = lamp(set::LightType::point, emission);
  light.position = position;
  return light;
}

set::Light sphere_lamp(const glm::dvec3& position, double radius_m, const glm::dvec3& emission) {
  set::Light light = lamp(set::LightType::sphere, emission);
  light.position = position;
  light.radius_m = radius_m;
  return light;
}

set::Light panel_lamp(const glm::dvec3& position, const glm::dvec2& size,
                      const glm::dvec3& emission) {
  set::Light light = lamp(set::LightType::rectangle, emission);
  light.position = position;
  light.width_m = size.x;
  light.height_m = size.y;
  return light;
}

set::Light sun_lamp(const glm::dvec3& direction, double angular_radius_rad,
                    const glm::dvec3& emission) {
  set::Light light = lamp(set::LightType::directional, emission);
  light.direction = direction;
  light.angular_radius_rad = angular_radius_rad;
  return light;
}

lighting::EnvironmentMap uniform_environment(const glm::vec3& radiance, int size) {
  return {size, std::vector<glm::vec3>(static_cast<std::size_t>(size) * size, radiance)};
}

lighting::EnvironmentMap one_sided_sky() {
  lighting::EnvironmentMap sky = uniform_environment({0.3f, 0.4f, 0.5f}, 8);
  for (std::size_t i = 9; i < 15; ++i) sky.radiance[i] *= 6.0f;
  return sky;
}

View empty_view(const glm::dvec3& eye, const glm::dvec3& target, const ObserverCalibration& camera,
                const glm::vec3& sky) {
  return {{}, uniform_environment(sky), camera, look_at(eye, target)};
}

View lit_point(double albedo, double side_m) {
  View view = empty_view({0, -1, 0.5}, {0, 0, 0}, pinhole(32, 32, 1e-3));
  add(view.scene, rectangle_mesh({side_m, side_m}), diffuse(glm::vec3(static_cast<float>(albedo))));
  return view;
}

glm::dmat4 look_at(const glm::dvec3& eye, const glm::dvec3& target) {
  const glm::dvec3 forward = glm::normalize(target - eye);
  const glm::dvec3 up = std::abs(forward.z) < 0.999 ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0);
  const glm::dvec3 right = glm::normalize(glm::cross(forward, up));
  return {glm::dvec4(right, 0), glm::dvec4(glm::cross(forward, right), 0), glm::dvec4(forward, 0),
          glm::dvec4(eye, 1)};
}

ObserverCalibration pinhole(int width, int height, double horizontal_fov_rad) {
  ObserverCalibration calibration;
  const double focal_px = 0.5 * width / std::tan(0.5 * horizontal_fov_rad);
  calibration.intrinsics.width = width;
  calibration.intrinsics.height = height;
  calibration.intrinsics.fx = calibration.intrinsics.fy = focal_px;
  calibration.intrinsics.cx = 0.5 * (width - 1);
  calibration.intrinsics.cy = 0.5 * (height - 1);
  return calibration;
}

}  // namespace previz::test
