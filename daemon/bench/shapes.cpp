#include "daemon/bench/shapes.hpp"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <map>
#include <random>
#include <utility>

namespace previz::bench {
namespace {

void append(scene::Mesh& to, const scene::Mesh& from, const glm::vec3& offset) {
  const auto first = static_cast<std::uint32_t>(to.positions.size());
  for (const glm::vec3& p : from.positions) to.positions.push_back(p + offset);
  for (const glm::uvec3& t : from.triangles) to.triangles.push_back(t + first);
}

scene::Mesh icosahedron() {
  const float g = 1.61803399f;
  scene::Mesh mesh;
  mesh.positions = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                    {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  mesh.triangles = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                    {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                    {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                    {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  return mesh;
}

void subdivide(scene::Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
  const auto middle = [&](std::uint32_t a, std::uint32_t b) {
    const auto [it, fresh] = middles.try_emplace(std::pair(std::min(a, b), std::max(a, b)),
                                                 static_cast<std::uint32_t>(mesh.positions.size()));
    if (fresh) mesh.positions.push_back((mesh.positions[a] + mesh.positions[b]) * 0.5f);
    return it->second;
  };
  std::vector<glm::uvec3> finer;
  for (const glm::uvec3& t : mesh.triangles) {
    const std::uint32_t a = middle(t.x, t.y), b = middle(t.y, t.z), c = middle(t.z, t.x);
    finer.insert(finer.end(), {{t.x, a, c}, {t.y, b, a}, {t.z, c, b}, {a, b, c}});
  }
  mesh.triangles = std::move(finer);
}

void fill_normals(scene::Mesh& mesh) {
  mesh.normals.assign(mesh.positions.size(), glm::vec3(0));
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::vec3& a = mesh.positions[t.x];
    const glm::vec3 n = glm::cross(mesh.positions[t.y] - a, mesh.positions[t.z] - a);
    for (int corner = 0; corner < 3; ++corner) mesh.normals[t[corner]] += n;
  }
  for (glm::vec3& n : mesh.normals) {
    const float length = glm::length(n);
    n = length > 0 ? n / length : glm::vec3(0, 0, 1);
  }
}

// Where the spheres of a field of about so many triangles are.
struct Field {
  struct Sphere {
    glm::dvec3 centre;
    double radius;
  };

  explicit Field(std::size_t triangles)
      : levels(triangles < 50'000    ? 3
               : triangles < 300'000 ? 4
                                     : 5) {
    const std::size_t each = std::size_t{20} << (2 * levels);
    const std::size_t count = std::max<std::size_t>(1, triangles / each);
    side = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(count))));
    std::mt19937 random(7);
    std::uniform_real_distribution<double> radius(0.25, 0.6);
    const double middle = 0.5 * static_cast<double>(side - 1);
    for (std::size_t i = 0; i < count; ++i) {
      const double r = radius(random);
      const std::size_t column = i % side, row = i / side;
      spheres.push_back(
          {{static_cast<double>(column) - middle, static_cast<double>(row) - middle, r}, r});
    }
  }

  float edge() const { return static_cast<float>(side) + 2.0f; }

  int levels;
  std::size_t side = 0;
  std::vector<Sphere> spheres;
};

}  // namespace

scene::Mesh grid(float edge, int cells) {
  scene::Mesh mesh;
  for (int y = 0; y <= cells; ++y)
    for (int x = 0; x <= cells; ++x)
      mesh.positions.emplace_back(edge * (static_cast<float>(x) / static_cast<float>(cells) - 0.5f),
                                  edge * (static_cast<float>(y) / static_cast<float>(cells) - 0.5f),
                                  0.0f);
  const auto row = static_cast<std::uint32_t>(cells + 1);
  for (std::uint32_t y = 0; y + 1 < row; ++y) {
    for (std::uint32_t x = 0; x + 1 < row; ++x) {
      const std::uint32_t i = y * row + x;
      mesh.triangles.emplace_back(i, i + 1, i + row + 1);
      mesh.triangles.emplace_back(i, i + row + 1, i + row);
    }
  }
  fill_normals(mesh);
  return mesh;
}

scene::Mesh bumpy_sphere(int levels, double radius, double bumps, std::uint32_t seed) {
  scene::Mesh mesh = icosahedron();
  for (int i = 0; i < levels; ++i) subdivide(mesh);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0, 6.28);
  const glm::dvec3 p(phase(random), phase(random), phase(random));
  for (glm::vec3& position : mesh.positions) {
    const glm::dvec3 n = glm::normalize(glm::dvec3(position));
    const double wave = (std::sin(5 * n.x + p.x) + std::sin(7 * n.y + p.y) +
                         std::sin(11 * n.z + p.z) + 0.5 * std::sin(23 * n.x + 19 * n.y)) /
                        3.5;
    position = glm::vec3(n * radius * (1 + bumps * wave));
  }
  fill_normals(mesh);
  return mesh;
}

scene::Mesh sphere_field(std::size_t triangles) {
  const Field field(triangles);
  scene::Mesh mesh = grid(field.edge(), 8);
  for (std::size_t i = 0; i < field.spheres.size(); ++i) {
    const Field::Sphere& sphere = field.spheres[i];
    append(mesh, bumpy_sphere(field.levels, sphere.radius, 0.2, static_cast<std::uint32_t>(i)),
           glm::vec3(sphere.centre));
  }
  fill_normals(mesh);
  return mesh;
}

scene::Scene instanced_field(std::size_t triangles) {
  const Field field(triangles);
  scene::Scene scene = scene_of(grid(field.edge(), 8));
  for (std::uint32_t shape = 0; shape < 4; ++shape)
    scene.meshes.push_back(bumpy_sphere(field.levels, 1.0, 0.2, shape));
  for (std::size_t i = 0; i < field.spheres.size(); ++i) {
    const Field::Sphere& sphere = field.spheres[i];
    scene::Instance instance;
    instance.mesh = 1 + static_cast<std::uint32_t>(i % 4);
    instance.world_from_object = glm::dmat4(sphere.radius);
    instance.world_from_object[3] = glm::dvec4(sphere.centre, 1.0);
    scene.instances.push_back(instance);
  }
  return scene;
}

scene::Mesh random_triangles(std::size_t count, float extent, float size, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-extent, extent), edge(-size, size);
  scene::Mesh mesh;
  for (std::uint32_t i = 0; i < count; ++i) {
    const glm::vec3 centre(place(random), place(random), place(random));
    for (int corner = 0; corner < 3; ++corner)
      mesh.positions.push_back(centre + glm::vec3(edge(random), edge(random), edge(random)));
    mesh.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
  }
  fill_normals(mesh);
  return mesh;
}

scene::Scene scene_of(scene::Mesh mesh) {
  scene::Scene scene;
  scene.meshes.push_back(std::move(mesh));
  scene.materials.emplace_back();
  scene::Instance instance;
  instance.name = "mesh";
  scene.instances.push_back(instance);
  return scene;
}

scene::Scene field_with_a_virtual_sphere(std::size_t triangles) {
  scene::Scene scene = scene_of(sphere_field(triangles));
  scene.meshes.push_back(bumpy_sphere(3, 0.5, 0.2, 99));
  scene::Instance sphere;
  sphere.name = "virtual";
  sphere.mesh = 1;
  sphere.presence = scene::world_mixed;
  sphere.world_from_object = glm::translate(glm::dmat4(1), glm::dvec3(0, 0, 1.4));
  scene.instances.push_back(sphere);
  return scene;
}

glm::dmat4 view_of_field(const scene::Scene& scene) {
  double edge = 0;
  for (const glm::vec3& p : scene.meshes[0].positions)
    edge = std::max(edge, static_cast<double>(p.x));
  const glm::dvec3 eye(-0.55 * edge, -0.75 * edge, 0.45 * edge);
  glm::dmat4 pose = glm::inverse(glm::lookAt(eye, glm::dvec3(0), glm::dvec3(0, 0, 1)));
  pose[1] = -pose[1];  // OpenGL's axes to OpenCV's
  pose[2] = -pose[2];
  return pose;
}

ObserverCalibration camera_of(int width, int height) {
  ObserverCalibration calibration;
  PinholeIntrinsics& lens = calibration.intrinsics;
  lens.width = width;
  lens.height = height;
  lens.fx = lens.fy = height;
  lens.cx = 0.5 * (width - 1);
  lens.cy = 0.5 * (height - 1);
  return calibration;
}

}  // namespace previz::bench
