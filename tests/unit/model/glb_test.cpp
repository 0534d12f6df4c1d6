// The model as a file: our own reader gets back what was written.
#include "daemon/tools/model/glb.hpp"

#include "daemon/core/scene/load.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/tools/model/solids.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::test {
namespace {

TEST(ModelGlb, IsReadBackAsItWas) {
  const TemporaryDirectory folder;
  const model::Solid sheet{"sheet", {{"face", {{0, 0, 1}, {2, 0, 1}, {2, 3, 1}, {0, 3, 1}}}}};
  std::ofstream(folder / "model.glb", std::ios::binary)
      << model::glb_of({model::mesh_of(sheet)}, {{"sheet", {0.2, 0.3, 0.4}}});
  const set::Set set = set::parse_set(
      "[set]\nname = \"x\"\n[[object]]\nname = \"o\"\nfile = \"model.glb\"\npresence = "
      "\"phantom\"\nnodes = [\"sheet\"]\n",
      folder / "set.toml");
  const scene::Scene scene = scene::load_scene(set);
  ASSERT_EQ(scene.materials.size(), 1u);
  EXPECT_EQ(scene.materials[0].name, "sheet");
  EXPECT_LT(glm::distance(glm::dvec3(scene.materials[0].base_color), glm::dvec3(0.2, 0.3, 0.4)),
            1e-6);
  ASSERT_EQ(scene.instances.size(), 1u);
  ASSERT_EQ(scene.meshes.size(), 1u);
  glm::dvec3 low(1e9), high(-1e9);
  for (const auto& vertex : scene.meshes[0].positions) {
    const glm::dvec3 p(scene.instances[0].world_from_object * glm::dvec4(vertex, 1));
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  EXPECT_LT(glm::distance(low, glm::dvec3(0, 0, 1)), 1e-6);
  EXPECT_LT(glm::distance(high, glm::dvec3(2, 3, 1)), 1e-6);
}

}  // namespace
}  // namespace previz::test
