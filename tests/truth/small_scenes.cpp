#include "tests/truth/small_scenes.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace previz::truth {
namespace {

std::size_t add_instance(scene::Scene& scene, scene::Mesh mesh, const scene::Material& material) {
  scene::Instance instance;
  instance.name = material.name;
  instance.mesh = static_cast<std::uint32_t>(scene.meshes.size());
  instance.material = static_cast<std::uint32_t>(scene.materials.size());
  scene.meshes.push_back(std::move(mesh));
  scene.materials.push_back(material);
  scene.instances.push_back(instance);
  return scene.instances.size() - 1;
}

}  // namespace

std::size_t add_quad(scene::Scene& scene, const glm::vec3& centre, const glm::vec3& half_u,
                     const glm::vec3& half_v, const scene::Material& material) {
  scene::Mesh mesh;
  mesh.name = "quad";
  mesh.positions = {centre - half_u - half_v, centre + half_u - half_v, centre + half_u + half_v,
                    centre - half_u + half_v};
  mesh.normals.assign(4, glm::normalize(glm::cross(half_u, half_v)));
  mesh.uvs = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return add_instance(scene, std::move(mesh), material);
}

std::size_t add_sphere(scene::Scene& scene, const glm::vec3& centre, float radius, int n,
                       const scene::Material& material) {
  scene::Mesh mesh;
  mesh.name = "sphere";
  const int columns = 2 * n;
  for (int row = 0; row <= n; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const double theta = std::numbers::pi * row / n;
      const double phi = 2 * std::numbers::pi * column / columns;
      const glm::vec3 normal(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                             std::cos(theta));
      mesh.normals.push_back(normal);
      mesh.positions.push_back(centre + radius * normal);
      mesh.uvs.emplace_back(static_cast<float>(column) / static_cast<float>(columns),
                            static_cast<float>(row) / static_cast<float>(n));
    }
  }
  const auto at = [&](int row, int column) {
    return static_cast<std::uint32_t>(row * (columns + 1) + column);
  };
  for (int row = 0; row < n; ++row) {
    for (int column = 0; column < columns; ++column) {
      const auto a = at(row, column), b = at(row + 1, column);
      const auto c = at(row + 1, column + 1), d = at(row, column + 1);
      if (row + 1 < n) mesh.triangles.emplace_back(a, b, c);
      if (row > 0) mesh.triangles.emplace_back(a, c, d);
    }
  }
  return add_instance(scene, std::move(mesh), material);
}

scene::Material lambert(const glm::vec3& albedo) {
  scene::Material m;
  m.name = "lambert";
  m.base_color = albedo;
  m.specular = 0;
  return m;
}

scene::Material metal(const glm::vec3& f0, float roughness) {
  scene::Material m;
  m.name = "metal";
  m.base_color = f0;
  m.metallic = 1;
  m.roughness = roughness;
  return m;
}

scene::Material plastic(const glm::vec3& base_color, float roughness) {
  scene::Material m;
  m.name = "plastic";
  m.base_color = base_color;
  m.roughness = roughness;
  return m;
}

scene::Material glass(float ior) {
  scene::Material m;
  m.name = "glass";
  m.roughness = 0;
  m.transmission = 1;
  m.ior = ior;
  m.thin_walled = false;
  return m;
}

scene::Material emitter(const glm::vec3& radiance) {
  scene::Material m = lambert(glm::vec3(0));
  m.name = "emitter";
  m.emission = radiance;
  return m;
}

lighting::EnvironmentMap constant_environment(const glm::vec3& radiance, int size) {
  return {size, std::vector<glm::vec3>(static_cast<std::size_t>(size * size), radiance)};
}

ObserverCalibration pinhole(int width, int height, double focal_px) {
  ObserverCalibration calibration;
  calibration.intrinsics = {
      width, height, focal_px, focal_px, 0.5 * (width - 1), 0.5 * (height - 1)};
  return calibration;
}

ObserverCalibration one_pixel() {
  return pinhole(1, 1, 1e4);
}

glm::dmat4 look_at(const glm::dvec3& eye, const glm::dvec3& target) {
  const glm::dvec3 z = glm::normalize(target - eye);
  const glm::dvec3 up = std::abs(z.z) < 0.999 ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0);
  const glm::dvec3 x = glm::normalize(glm::cross(z, up));
  return {glm::dvec4(x, 0), glm::dvec4(glm::cross(z, x), 0), glm::dvec4(z, 0), glm::dvec4(eye, 1)};
}

}  // namespace previz::truth
