// Meshes that deform on the GPU: the vertices are those that the CPU computes, the tree follows
// them, and the picture is that of the same mesh in the same shape for good.
#include <glm/gtc/matrix_transform.hpp>

#include "daemon/core/render/world/deformer.hpp"
#include "tests/support/bvh_decode.hpp"
#include "tests/support/figure.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::deform_test {

constexpr int joints = 6;

// One mesh that deforms, alone in the buffers that a scene would have.
struct Alone {
  explicit Alone(scene::Scene scene_of_one)
      : scene(std::move(scene_of_one)), deformer(*shared_device()) {
    bvh = deformer.add(scene, scene.deformations[0]);
    const scene::Mesh& mesh = scene.meshes[0];
    std::vector<glm::vec4> texels;
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      texels.emplace_back(mesh.positions[i], 0.25f);
      texels.emplace_back(mesh.normals[i], 0.75f);
    }
    const render::Purpose purpose{"a test", ""};
    render::upload_texels(*shared_device(), purpose, records, bvh.texels,
                          vk::Format::eR32G32B32A32Uint);
    render::upload_texels(*shared_device(), purpose, vertices, texels,
                          vk::Format::eR32G32B32A32Sfloat);
    deformer.upload({{&bvh, 0, 0}});
  }

  void deform(const scene::Shape& shape) { deformer.deform({&shape, 1}, records, vertices); }

  // The tree as it is on the GPU.
  scene::MeshBvh tree() const {
    scene::MeshBvh now = bvh;
    now.texels = render::download<glm::uvec4>(*shared_device(), records, bvh.texels.size());
    return now;
  }
  std::vector<glm::vec4> shaped() const {
    return render::download<glm::vec4>(*shared_device(), vertices,
                                       2 * scene.meshes[0].positions.size());
  }

  scene::Scene scene;
  render::Deformer deformer;
  scene::MeshBvh bvh;
  render::Buffer records, vertices;
};

scene::Scene limb_alone(int rings = 24, int segments = 12) {
  scene::Scene scene;
  add_limb(scene, limb_mesh(rings, segments, joints), joints,
           add_material(scene, diffuse(glm::vec3(0.5f))), glm::dmat4(1));
  return scene;
}

scene::Scene ball_alone() {
  scene::Scene scene;
  add_squeezed_ball(scene, squeezed_ball_mesh(0.3, 24, 12),
                    add_material(scene, diffuse(glm::vec3(0.5f))), glm::dmat4(1));
  return scene;
}

// A vertex is a sum of at most 8 products of numbers up to 2 m and of weights, each rounded to
// 2^-24 of itself, with joints that are rounded, too: at most 16 roundings of 2.
constexpr float position_rounding = 16 * 2 * 6e-8f;
// A unit normal is off by this much: it is made of as many terms as a place, and of differences of
// products of the rows.
constexpr float normal_rounding = 64 * 6e-8f;

void expect_shape(const Alone& alone, const scene::Shape& shape) {
  const scene::DeformedVertices expected = scene::deformed(alone.scene.meshes[0].undeformed, shape);
  const std::vector<glm::vec4> got = alone.shaped();
  for (std::size_t i = 0; i < expected.positions.size(); ++i)
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_NEAR(got[2 * i][axis], expected.positions[i][axis], position_rounding) << i;
      ASSERT_NEAR(got[2 * i + 1][axis], expected.normals[i][axis], normal_rounding) << i;
    }
  // Texture coordinates stay.
  for (std::size_t i = 0; i < got.size(); ++i) ASSERT_EQ(got[i].w, i % 2 == 0 ? 0.25f : 0.75f);
}

// Every triangle is in the tree once, where its vertices are, in boxes that hold it and are no
// wider than the rounding of their planes.
void expect_tree_follows(const Alone& alone) {
  const scene::MeshBvh tree = alone.tree();
  const std::vector<glm::vec4> vertices = alone.shaped();
  const std::vector<glm::uvec3>& triangles = alone.scene.meshes[0].triangles;
  const float scale = std::ldexp(1.0f, tree.grid_exponent);
  std::vector<int> found(triangles.size());
  int moved = 0, outside = 0, wide = 0;
  const std::uint32_t not_inverted = visit(tree, [&](const DecodedRecord& record) {
    scene::Aabb tight;
    for (const DecodedTriangle& triangle : record.triangles) {
      ++found[triangle.primitive];
      for (int i = 0; i < 3; ++i) {
        const glm::vec3& p = triangle.corners[static_cast<std::size_t>(i)];
        const glm::vec4& vertex = vertices[2 * std::size_t{triangles[triangle.primitive][i]}];
        moved += p != scale * glm::vec3(vertex);
        outside += glm::any(glm::lessThan(p, record.bounds.low)) ||
                   glm::any(glm::greaterThan(p, record.bounds.high));
        tight.low = glm::min(tight.low, p);
        tight.high = glm::max(tight.high, p);
      }
    }
    if (record.triangles.empty()) return;
    // The parent's extent is below 2^24, of which a plane's step is at most 1/128.
    const glm::vec3 step(std::ldexp(1.0f, 17));
    wide += glm::any(glm::lessThan(record.bounds.low, tight.low - step)) ||
            glm::any(glm::greaterThan(record.bounds.high, tight.high + step));
  });
  EXPECT_EQ(std::ranges::count(found, 1), static_cast<std::ptrdiff_t>(found.size()));
  EXPECT_EQ(moved, 0);
  EXPECT_EQ(outside, 0);
  EXPECT_EQ(wide, 0);
  EXPECT_EQ(not_inverted, 0u);
}

TEST(Deforming, SkinsFollowTheirJoints) {
  Alone alone(limb_alone());
  for (const double angle : {0.0, 0.3, -0.7}) {
    const scene::Shape shape = bent_limb(alone.scene.deformations[0], angle);
    alone.deform(shape);
    expect_shape(alone, shape);
    expect_tree_follows(alone);
  }
}

TEST(Deforming, MorphTargetsAreAddedByTheirWeights) {
  Alone alone(ball_alone());
  for (const double weight : {1.0, 0.25, -0.5}) {
    const scene::Shape shape{{weight}, {}};
    alone.deform(shape);
    expect_shape(alone, shape);
    expect_tree_follows(alone);
  }
}

// A mesh without normals has those of its triangles in every shape; and a skin may stretch.
TEST(Deforming, FlatMeshesStayFlatAndNormalsFollowAStretch) {
  scene::Scene flat = ball_alone();
  scene::Mesh& mesh = flat.meshes[0];
  scene::Undeformed& undeformed = mesh.undeformed;
  scene::Undeformed split{{}, {}, true, {scene::MorphTarget{}}, 0, {}};
  for (glm::uvec3& triangle : mesh.triangles)
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t from = triangle[i];
      triangle[i] = static_cast<std::uint32_t>(split.positions.size());
      split.positions.push_back(undeformed.positions[from]);
      split.normals.push_back(undeformed.normals[from]);
      split.targets[0].positions.push_back(undeformed.targets[0].positions[from]);
    }
  mesh.positions = split.positions;
  mesh.normals = split.normals;
  mesh.undeformed = split;
  Alone ball(flat);
  ball.deform({{0.6}, {}});
  expect_shape(ball, {{0.6}, {}});

  Alone limb(limb_alone());
  scene::Shape stretched = bent_limb(limb.scene.deformations[0], 0.2);
  for (glm::dmat4& joint : stretched.joints)
    joint = joint * glm::scale(glm::dmat4(1), glm::dvec3(1, 0.25, 1.5));
  limb.deform(stretched);
  expect_shape(limb, stretched);
  expect_tree_follows(limb);
}

// A joint that no vertex follows may be anywhere, past single precision too: unused influences name
// some joint with a weight of 0.
TEST(Deforming, AJointOfNoWeightHasNoEffect) {
  scene::Scene scene = limb_alone();
  for (scene::Influence& influence : scene.meshes[0].undeformed.influences)
    influence.joints[2] = joints;
  scene::Deformation& limb = scene.deformations[0];
  limb.joints.push_back({});
  Alone alone(scene);
  scene::Shape shape = bent_limb(limb, 0.3);
  shape.joints[joints] = glm::dmat4(1e300);
  alone.deform(shape);
  shape.joints[joints] = glm::dmat4(1);
  expect_shape(alone, shape);
  expect_tree_follows(alone);
}

// Refitted in the shape that it was built for, a tree is the one that was built, to the last bit:
// its boxes are as tight as the builder's.
TEST(Deforming, ATreeInItsOwnShapeIsTheBuilders) {
  Alone alone(ball_alone());
  const std::vector<glm::uvec4> built = alone.bvh.texels;
  alone.deform({{0.5}, {}});
  EXPECT_NE(alone.tree().texels, built);
  alone.deform({{0.0}, {}});
  EXPECT_EQ(alone.tree().texels, built);
}

TEST(Deforming, BoundsHoldEveryVertexInEveryShape) {
  Alone limb(limb_alone());
  for (const double angle : {0.0, 0.4, 1.0}) {
    limb.deform(bent_limb(limb.scene.deformations[0], angle));
    const std::vector<glm::vec4> vertices = limb.shaped();
    for (std::size_t i = 0; i < vertices.size(); i += 2)
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_GE(vertices[i][axis], limb.bvh.bounds.low[axis]);
        ASSERT_LE(vertices[i][axis], limb.bvh.bounds.high[axis]);
      }
    // They are the boxes of six joints' parts: no wider than twice the limb.
    EXPECT_LT(glm::length(limb.bvh.bounds.high - limb.bvh.bounds.low), 2.2f);
  }
}

// A limb that is rolled up crosses itself, where its tree was straight: it is built anew, once, in
// a thread. What rays hit is the same above either tree.
TEST(Deforming, ABadTreeIsBuiltAnewAndChangesNoPicture) {
  View view = empty_view({0.2, -1.6, 0.8}, {0.1, 0, 0.3}, pinhole(64, 48, 0.9), glm::vec3(1));
  view.scene = limb_alone(96, 24);
  SetRenderer renderer(view);
  const scene::Deformation& limb = view.scene.deformations[0];
  const auto picture = [&](double angle) {
    renderer.deform({bent_limb(limb, angle)});
    return renderer.rendered(2);
  };
  const render::Layers before = picture(1.3);
  int tries = 0;
  for (; renderer.counters().rebuilt_trees == 0 && tries < 2000; ++tries)
    renderer.deform({bent_limb(limb, 1.3 + 1e-3 * (tries % 2))});
  EXPECT_EQ(renderer.counters().rebuilt_trees, 1u) << tries << " shapes";
  picture(1.0);
  EXPECT_EQ(renderer.counters().rebuilt_trees, 1u) << "since the first picture was begun";
  const render::Layers after = picture(1.3);
  EXPECT_EQ(before.mixed, after.mixed);
  EXPECT_EQ(before.depth, after.depth);
}

// Folded up at rest, a mesh has no surface by which the cost of its tree could be judged. The tree
// that was built there is replaced once there is a surface.
TEST(Deforming, ATreeOfNoSurfaceIsBuiltAnew) {
  View view;
  view.scene = limb_alone(24, 12);
  scene::Deformation& limb = view.scene.deformations[0];
  for (scene::Deformation::Joint& joint : limb.joints)
    joint.file_from_joint = glm::scale(joint.file_from_joint, glm::dvec3(0));
  view.scene.meshes[0].positions =
      scene::deformed(view.scene.meshes[0].undeformed, scene::shape_at_rest(limb)).positions;
  view.environment = uniform_environment(glm::vec3(1));
  view.calibration = pinhole(16, 16, 0.9);
  SetRenderer renderer(view);
  int tries = 0;
  for (; renderer.counters().rebuilt_trees == 0 && tries < 2000; ++tries)
    renderer.deform({bent_limb(limb, 1e-3 * (tries % 2))});
  EXPECT_EQ(renderer.counters().rebuilt_trees, 1u) << tries << " shapes";
  // The new tree is as good as any, and is kept.
  for (int i = 0; i < 50; ++i) renderer.deform({bent_limb(limb, 1e-3 * (i % 2))});
  EXPECT_EQ(renderer.counters().rebuilt_trees, 1u);
}

// A limb and a ball on a floor between walls, which hold them in every shape, so that the extent of
// the scene, by which lights are chosen, is the same whoever deforms the meshes.
View figures(std::uint32_t presence) {
  View view = empty_view({0, -1.9, -0.4}, {0, 0, -1.1}, pinhole(48, 36, 0.9));
  add(view.scene, inside_out(box_mesh({4, 4, 3})), diffuse(glm::vec3(0.7f, 0.6f, 0.5f)));
  add_limb(view.scene, limb_mesh(24, 16, joints), joints,
           add_material(view.scene, diffuse(glm::vec3(0.8f, 0.2f, 0.1f))), at({-0.4, 0.1, -1.4}),
           presence);
  add_squeezed_ball(view.scene, squeezed_ball_mesh(0.3, 32, 16),
                    add_material(view.scene, plastic(glm::vec3(0.1f, 0.4f, 0.7f), 0.4f)),
                    at({0.5, -0.2, -1.1}), presence);
  view.scene.lights = {sphere_lamp({0.3, -1, 1}, 0.2, glm::dvec3(20))};
  return view;
}

struct BothWays {
  render::Layers by_gpu, for_good;
};

// Renders a view in some shapes, and again with meshes that have other shapes for good.
BothWays pictures(const View& moving, const std::vector<scene::Shape>& shapes,
                  const std::vector<scene::Shape>& shapes_for_good) {
  View still = moving;
  still.scene = posed(moving.scene, shapes_for_good);
  SetRenderer by_gpu(moving), for_good(still);
  by_gpu.deform(shapes);
  return {by_gpu.rendered_clean(4), for_good.rendered(4)};
}

// What the picture shows of surfaces is the same but for rounding; where a silhouette runs through
// the sample the two may differ.
void expect_same_surfaces(const BothWays& both) {
  const render::Layers &a = both.by_gpu, &b = both.for_good;
  int differing = 0;
  for (std::size_t i = 0; i < a.depth.size(); ++i)
    // 2 m away, positions that are rounded by 1e-6 m and normals by 4e-6.
    differing +=
        std::abs(a.depth[i] - b.depth[i]) > 1e-5f || glm::length(a.normal[i] - b.normal[i]) > 1e-4f;
  EXPECT_LE(differing, 2) << "of " << a.depth.size() << " pixels";
}

TEST(Deforming, ShowsWhatTheSameMeshesShowInTheirShapeForGood) {
  const View moving = figures(scene::world_both);
  const std::vector<scene::Shape> shapes = {bent_limb(moving.scene.deformations[0], 0.25),
                                            {{0.8}, {}}};
  const auto both = pictures(moving, shapes, shapes);
  expect_same_surfaces(both);
  const render::Layers &a = both.by_gpu, &b = both.for_good;
  expect_near(mean(a.mixed), mean(b.mixed), 2e-3 * mean(b.mixed));
}

// A mesh whose bounds are past all numbers keeps its shape, at rest already, and moves nothing of
// the others' joints.
TEST(Deforming, AShapeThatCannotBeTracedChangesNoOther) {
  View view = figures(scene::world_both);
  add_limb(view.scene, limb_mesh(24, 16, joints), joints, 1, at({0.1, 0.4, -1.4}));
  const scene::Shape upright = bent_limb(view.scene.deformations[0], 0);
  const scene::Shape bent = bent_limb(view.scene.deformations[0], 0.25);
  view.scene.deformations[0].joints[0].file_from_joint[3].x = 1e25;
  const scene::Shape impossible = scene::shape_at_rest(view.scene.deformations[0]);
  expect_same_surfaces(
      pictures(view, {impossible, {{0.8}, {}}, bent}, {upright, {{0.8}, {}}, bent}));
}

// Shaders read the vertices as texels, of which there may be more than a storage buffer holds, as
// which they are written. 32 bytes a vertex.
TEST(Deforming, NeedsVerticesThatFitIntoAStorageBuffer) {
  const std::uint64_t most = shared_device()->limits().maxStorageBufferRange;
  if (most > (1u << 28)) GTEST_SKIP() << "a mesh of " << most << " bytes is too large for a test";
  scene::Scene scene = limb_alone();
  scene::Mesh large = rectangle_mesh({1, 1});
  large.positions.resize(most / 32, glm::vec3(0));
  large.normals.resize(most / 32, glm::vec3(0, 0, 1));
  large.uvs.clear();
  add(scene, large, 0u);
  render::Renderer renderer(shared_device(), {}, pinhole(16, 16, 0.9));
  EXPECT_THROW(renderer.set_scene(scene), Error);
  if (shared_device()->reads_storage()) return;  // every vertex is then in one
  scene.deformations.clear();
  EXPECT_NO_THROW(renderer.set_scene(scene));
}

// A lamp that deforms is sampled where it is.
TEST(Deforming, AGlowingMeshLightsFromItsShape) {
  View view = figures(scene::world_both);
  view.scene.lights.clear();
  view.scene.materials[view.scene.instances[1].material] = emitter(glm::vec3(5));
  const std::vector<scene::Shape> shapes = {bent_limb(view.scene.deformations[0], 0.3),
                                            {{0.5}, {}}};
  View still = view;
  still.scene = posed(view.scene, shapes);
  SetRenderer by_gpu(view), for_good(still);
  by_gpu.deform(shapes);
  const double expected = mean(for_good.rendered_clean(8).mixed).g;
  EXPECT_NEAR(mean(by_gpu.rendered_clean(8).mixed).g, expected, 2e-3 * expected);
}

// A virtual figure's difference follows it: where it was there is none any more.
TEST(Deforming, TheDifferenceFollows) {
  View view = figures(scene::world_mixed);
  SetRenderer renderer(view);
  const auto covered = [&](const scene::Shape& limb) {
    renderer.deform({limb, {{0.0}, {}}});
    return renderer.rendered(1).mask;
  };
  const scene::Deformation& limb = view.scene.deformations[0];
  const auto upright = covered(bent_limb(limb, 0));
  scene::Shape away = bent_limb(limb, 0);
  for (glm::dmat4& joint : away.joints) joint = at({0, 3, 0}) * joint;  // behind the wall
  const auto gone = covered(away);
  EXPECT_GT(std::ranges::count(upright, 1.0f), std::ranges::count(gone, 1.0f) + 20);
  EXPECT_EQ(covered(bent_limb(limb, 0)), upright);
}

// A kept frame has its shapes with it, so that it is shown among others as well by an object in
// which no mesh has been deformed yet, or has another shape since.
TEST(Deforming, AKeptFrameIsInItsShapesAgain) {
  const View view = figures(scene::world_mixed);
  SetRenderer renderer(view), idle(view);
  std::vector<render::KeptFramePtr> frames;
  for (const double bend : {0.25, 0.2, 0.0}) {
    renderer.deform({bent_limb(view.scene.deformations[0], bend), {{bend}, {}}});
    renderer.begin({{}, 1.0, view.world_from_camera});
    renderer.render(2);
    frames.push_back(renderer.keep());
  }
  const Plate expected = renderer.show_among(frames, true);
  EXPECT_EQ(renderer.show_among(frames, true).samples, expected.samples);
  EXPECT_EQ(idle.show_among(frames, true).samples, expected.samples);
  std::swap(frames[0], frames[2]);
  EXPECT_NE(idle.show_among(frames, true).samples, expected.samples);
}

}  // namespace previz::test::deform_test
