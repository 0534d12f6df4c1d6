// Tags are put onto the surface of a phantom that is not quite where the tags' own plane is.
#include "daemon/tools/model/on_phantom.hpp"

#include "tests/support/scenes.hpp"
#include "tests/support/test.hpp"

namespace previz::test {
namespace {

// A phantom's table, 0.3 mm above the plane of the tags at x = 0 and 1 mm above it at x = 0.1, and
// on it a box 8 mm high.
class OnPhantom : public testing::Test {
 protected:
  OnPhantom() {
    set_.objects.resize(1);
    set_.objects[0].presence = set::Presence::phantom;
    scene::Mesh table = rectangle_mesh({1, 1});
    for (glm::vec3& p : table.positions) p.z = 3e-4f + 7e-3f * p.x;
    const std::uint32_t grey = add_material(scene_, diffuse(glm::vec3(0.5)));
    add_instance(scene_, add_mesh(scene_, table), grey, glm::dmat4(1));
    scene::Mesh box = rectangle_mesh({0.02, 0.02});
    add_instance(scene_, add_mesh(scene_, box), grey, at({0.05, 0.05, 0.008}));
    for (scene::Instance& instance : scene_.instances) instance.object = 0;
    for (const double x : {-0.05, 0.0, 0.05})
      for (const double y : {-0.05, 0.0, 0.05}) {
        tag_.mesh.positions.emplace_back(x, y, 1e-5);
        tag_.mesh.normals.emplace_back(0, 0, 1);
      }
  }
  set::Set set_;
  scene::Scene scene_;
  model::NamedMesh tag_{"under tag 3", {}};
};

TEST_F(OnPhantom, TagsFollowItsSurfaceAtTheirHeight) {
  const auto most = model::PhantomSurface(scene_, set_).put(tag_, {});
  ASSERT_TRUE(most);
  EXPECT_NEAR(*most, 3e-4 + 7e-3 * 0.05, 1e-6);
  for (const glm::vec3& p : tag_.mesh.positions) {
    const double median = 3e-4;  // where the box stands
    const bool at_box = p.x > 0.04 && p.y > 0.04;
    EXPECT_NEAR(p.z, (at_box ? median : 3e-4 + 7e-3 * p.x) + 1e-5, 1e-6) << p.x << ' ' << p.y;
  }
}

TEST_F(OnPhantom, TagsStayWhereItHasNoSurface) {
  for (glm::vec3& p : tag_.mesh.positions) p.x += 3;
  const std::vector<glm::vec3> before = tag_.mesh.positions;
  EXPECT_EQ(model::PhantomSurface(scene_, set_).put(tag_, {}), std::nullopt);
  EXPECT_EQ(tag_.mesh.positions, before);
}

// The phantom's own paper is no table, nor is anything that is only in the picture.
TEST_F(OnPhantom, TagsAreNotPutOntoTagsOrVirtualThings) {
  scene_.instances[0].tag = scene::TagPart::printed;
  scene_.instances[1].tag = scene::TagPart::printed;
  EXPECT_EQ(model::PhantomSurface(scene_, set_).put(tag_, {}), std::nullopt);
  scene_.instances[0].tag = scene::TagPart::none;
  set_.objects[0].presence = set::Presence::virtual_object;
  EXPECT_EQ(model::PhantomSurface(scene_, set_).put(tag_, {}), std::nullopt);
}

}  // namespace
}  // namespace previz::test
