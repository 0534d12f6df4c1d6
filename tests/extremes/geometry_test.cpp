// Triangles that are hardly there, not there, or far too many: shaded or dropped, and counted.
#include "daemon/core/scene/bvh.hpp"
#include "tests/support/gltf_test.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::geometry_test {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

// A square of the given side at z = 0 in strips that end at these heights, from -1 to 1 over the
// whole of it.
scene::Mesh strips(float side, const std::vector<float>& heights) {
  scene::Mesh mesh;
  mesh.name = "strips";
  for (const float y : heights) {
    mesh.positions.emplace_back(-0.5f * side, 0.5f * side * y, 0);
    mesh.positions.emplace_back(0.5f * side, 0.5f * side * y, 0);
  }
  mesh.normals.assign(mesh.positions.size(), {0, 0, 1});
  for (std::uint32_t i = 0; i + 3 < mesh.positions.size(); i += 2) {
    mesh.triangles.emplace_back(i, i + 1, i + 3);
    mesh.triangles.emplace_back(i, i + 3, i + 2);
  }
  return mesh;
}

View seen_from_above(scene::Mesh mesh, const scene::Material& material) {
  View view = empty_view({0.01, -0.02, 2}, {0, 0, 0}, pinhole(48, 36, 0.5), glm::vec3(1));
  add(view.scene, std::move(mesh), material);
  return view;
}

Rendered show(const View& view, int samples = 16) {
  return render_clean(view, samples, up_to_depth(4), set::LightSampling::bsdf);
}

// White slivers down to 1e-7 of their length, under a white sky: 1 everywhere, through no gap and
// with no shadow of a triangle on itself.
TEST(ExtremeGeometry, SliversAreShadedLikeAnythingElse) {
  std::vector<float> heights = {-1, -0.5f, -0.1f};
  for (float y = 1e-7f; y < 0.2f; y *= 2) heights.push_back(y);
  for (int i = 1; i < 400; ++i) heights.push_back(0.2f + 0.8f * static_cast<float>(i) / 400);
  heights.push_back(1);
  const View view = seen_from_above(strips(4, heights), diffuse(glm::vec3(1)));
  for (const glm::vec3& pixel : show(view).layers.mixed) ASSERT_NEAR(pixel.g, 1, 1e-4);
}

// The renderer's own guard, behind the loader's: triangles of no area, of no number and of no
// vertex, lit and glowing, change no bit of the picture.
TEST(ExtremeGeometry, WhatCannotBeTracedChangesNoBit) {
  for (const scene::Material& material :
       {diffuse(glm::vec3(0.5f)), emitter(glm::vec3(2)), glass(1.5f)}) {
    scene::Mesh clean = box_mesh({0.5, 0.5, 0.5});
    scene::Mesh dirty = clean;
    const auto first = static_cast<std::uint32_t>(dirty.positions.size());
    for (const glm::vec3& p : {glm::vec3(nan, 0, 0), glm::vec3(0, nan, 1),
                               glm::vec3(std::numeric_limits<float>::infinity(), 0, 0),
                               glm::vec3(0, 0, 0), glm::vec3(0.1f, 0, 0)}) {
      dirty.positions.push_back(p);
      dirty.normals.emplace_back(0, 0, 1);
      dirty.uvs.emplace_back(0);
    }
    dirty.triangles.insert(dirty.triangles.end(), {{first, 0, 1},
                                                   {0, first + 1, 1},
                                                   {first + 2, 0, 1},
                                                   {0, 0, 1},
                                                   {first + 3, first + 4, first + 3}});
    EXPECT_EQ(scene::build_mesh_bvh(dirty).dropped_triangles, 5u);
    const auto scene_with = [&](const scene::Mesh& mesh, bool with_empty) {
      View view = seen_from_above(rectangle_mesh({4, 4}), diffuse(glm::vec3(0.7f)));
      add(view.scene, mesh, material, at({0.1, 0, 0.3}), scene::world_mixed);
      if (with_empty) {
        scene::Mesh empty;
        empty.name = "empty";
        add(view.scene, empty, 1u, glm::dmat4(1), scene::world_mixed);
      }
      return view;
    };
    const render::Layers expected = show(scene_with(clean, false)).layers;
    const render::Layers layers = show(scene_with(dirty, true)).layers;
    EXPECT_EQ(layers.mask, expected.mask) << material.name;
    EXPECT_EQ(layers.depth, expected.depth) << material.name;
    EXPECT_EQ(layers.mixed, expected.mixed) << material.name;
  }
}

TEST(ExtremeGeometry, ASceneOfNothingShowsTheLightAround) {
  View view;
  scene::Mesh empty;
  add(view.scene, empty, emitter(glm::vec3(1)), glm::dmat4(1), scene::world_mixed);
  view.environment = uniform_environment({0.25f, 0.5f, 2});
  view.calibration = pinhole(17, 9, 0.7);
  for (const glm::vec3& pixel : show(view, 2).layers.mixed)
    EXPECT_EQ(pixel, glm::vec3(0.25f, 0.5f, 2));
}

// A million triangles that cover less than one pixel: its mask is the share they cover, and white
// they show what is around.
TEST(ExtremeGeometry, AMillionTrianglesInOnePixel) {
  View view;
  const double distance = 5, radius = 0.003;
  view.calibration = pinhole(33, 33, 0.066);  // pixels of 1 cm there
  const auto ball = add_mesh(view.scene, uv_sphere_mesh(radius, 1000, 501));
  EXPECT_EQ(view.scene.meshes[ball].triangles.size(), 1'000'000u);
  add_instance(view.scene, ball, add_material(view.scene, diffuse(glm::vec3(1))),
               at({0, 0, distance}), scene::world_mixed);
  view.environment = uniform_environment(glm::vec3(1));
  constexpr int samples = 1024;
  const Rendered result = show(view, samples);
  const PinholeIntrinsics& k = view.calibration.intrinsics;
  const double covered = std::numbers::pi * std::pow(radius / distance * k.fx, 2);
  double sum = 0;
  for (std::size_t i = 0; i < result.layers.mask.size(); ++i) {
    sum += static_cast<double>(result.layers.mask[i]);
    EXPECT_NEAR(result.layers.mixed[i].g, 1, 1e-5);
  }
  EXPECT_NEAR(result.layers.mask[16 * 33 + 16], covered,
              4 * std::sqrt(covered * (1 - covered) / samples));
  EXPECT_FLOAT_EQ(static_cast<float>(sum), result.layers.mask[16 * 33 + 16]);
}

class GltfGeometry : public GltfTest {};

// From the file to the picture: what is left out is counted in the notes, the rest is shown.
TEST_F(GltfGeometry, BadTrianglesAreCountedAndTheRestIsShown) {
  gltf.root(
      "a", gltf.mesh(
               {{"attributes",
                 {{"POSITION",
                   gltf.positions(
                       {{-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, {-1, 0, -1}, {nan, 0, 0}, {3, 0, 1}})}}},
                {"indices", gltf.indices({0, 1, 2, 0, 2, 3,  // a square facing up
                                          0, 1, 4,           // NaN
                                          0, 1, 5,           // no area
                                          1, 1, 2})}}));
  gltf.root("none", gltf.mesh({{"attributes", {{"POSITION", gltf.positions({3, {1, 1, 1}})}}}}));
  View view = empty_view({0, -0.1, 1}, {0, 0, 0}, pinhole(32, 24, 0.5), glm::vec3(1));
  view.scene = load();
  EXPECT_THAT(view.scene.notes, Contains(HasSubstr("1 triangle has a position that is not")));
  EXPECT_THAT(view.scene.notes, Contains(HasSubstr("2 triangles have no area; dropped")));
  EXPECT_THAT(view.scene.notes, Contains(HasSubstr("is empty; skipped")));
  const Rendered result = show(view, 2);
  for (const float depth : result.layers.depth) EXPECT_GT(depth, 0);
}

}  // namespace previz::test::geometry_test
