// Thousands of damaged copies of one glTF file, the same ones on every run. Each loads or is
// refused with a previz::Error; what loads keeps scene.hpp's promises, and neither costs much.
#include <sys/resource.h>

#include "daemon/core/render/world/feature.hpp"
#include "daemon/core/scene/bvh_refit.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/scene/placement.hpp"
#include "tests/fuzz/mutators.hpp"
#include "tests/support/gltf_compressed.hpp"
#include "tests/support/gltf_sample.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::test::gltf_mutation_test {

std::string bytes_of(const GltfWriter& gltf, const std::filesystem::path& file) {
  gltf.save(file);
  return session::content_of(file);
}

void expect_sound(const scene::Scene& scene) {
  for (const scene::Mesh& mesh : scene.meshes) {
    ASSERT_FALSE(mesh.triangles.empty());
    ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
    ASSERT_TRUE(mesh.uvs.empty() || mesh.uvs.size() == mesh.positions.size());
    for (const glm::vec3& p : mesh.positions) ASSERT_TRUE(std::isfinite(p.x + p.y + p.z));
    for (const glm::vec3& n : mesh.normals) ASSERT_NEAR(glm::length(n), 1, 1e-5);
    for (const glm::vec2& uv : mesh.uvs) ASSERT_TRUE(std::isfinite(uv.x + uv.y));
    for (const glm::uvec3& t : mesh.triangles)
      ASSERT_LT(std::max({t.x, t.y, t.z}), mesh.positions.size());
  }
  session::SceneState state;
  state.animation_s = 0.5;
  const std::vector<scene::Shape> shapes = scene::place(scene, {}, state).shapes;
  for (std::size_t i = 0; i < scene.deformations.size(); ++i) {
    const scene::Mesh& mesh = scene.meshes.at(scene.deformations[i].mesh);
    ASSERT_EQ(scene::deformed(mesh.undeformed, shapes.at(i)).positions.size(),
              mesh.positions.size());
    const auto pairs = scene::deforming_pairs(mesh);
    ASSERT_GT(scene::build_refittable_bvh(pairs, mesh.positions).bvh.leaves, 0u);
    scene::deformed_bounds(scene::reach_of(mesh, shapes[i].joints.size()), shapes[i]);
  }
  for (const scene::Instance& instance : scene.instances) {
    ASSERT_LT(instance.mesh, scene.meshes.size());
    ASSERT_LT(instance.material, scene.materials.size());
    const double determinant = glm::determinant(glm::dmat3(instance.world_from_object));
    ASSERT_TRUE(std::isfinite(determinant) && determinant != 0);
  }
  scene::for_each_look(scene, [&](std::uint32_t mesh, std::uint32_t material) {
    ASSERT_LT(mesh, scene.meshes.size());
    ASSERT_LT(material, scene.materials.size());
  });
  for (const scene::Variants& variants : scene.variants)
    for (const scene::Variants::Part& part : variants.parts) {
      ASSERT_LT(part.instance, scene.instances.size());
      ASSERT_EQ(part.looks.size(), variants.names.size() + 1);
    }
  for (const scene::Material& m : scene.materials) {
    ASSERT_TRUE(m.ior >= 1 && m.roughness >= 0 && m.roughness <= 1 && m.alpha >= 0 && m.alpha <= 1);
    ASSERT_TRUE(std::isfinite(m.emission.x + m.emission.y + m.emission.z));
    ASSERT_TRUE(m.clearcoat >= 0 && m.clearcoat <= 1 && m.anisotropy >= 0 && m.anisotropy <= 1);
    ASSERT_TRUE(m.sheen_roughness > 0 && m.sheen_roughness <= 1);
    ASSERT_TRUE(std::isfinite(m.anisotropy_rotation_rad));
    for (int i = 0; i < 3; ++i) {
      ASSERT_TRUE(m.sheen_color[i] >= 0 && m.sheen_color[i] <= 1 && m.specular_color[i] >= 0);
      ASSERT_TRUE(std::isfinite(m.specular_color[i]));
    }
    for (const std::uint32_t texture :
         {m.base_color_texture, m.metallic_roughness_texture, m.emission_texture, m.normal_texture})
      ASSERT_TRUE(texture == scene::no_texture || texture < scene.textures.size());
  }
  for (const scene::Texture& texture : scene.textures)
    ASSERT_EQ(texture.texels.size(), static_cast<std::size_t>(texture.width * texture.height));
  for (const set::Light& light : scene.lights) {
    ASSERT_NEAR(glm::length(light.direction), 1, 1e-9);
    ASSERT_TRUE(std::isfinite(glm::length(light.position)));
    ASSERT_LE(light.inner_cone_rad, light.outer_cone_rad);
  }
}

class GltfMutations : public ::testing::Test {
 protected:
  void load(const std::filesystem::path& file) {
    load(file, "");
    load(file, "go");
  }

  void load_bytes(const std::string& bytes) {
    std::ofstream(directory_ / "mutant", std::ios::binary) << bytes;
    load(directory_ / "mutant");
  }

  void load(const std::filesystem::path& file, const std::string& animation) {
    set::Set set;
    set.objects.resize(1);
    set.objects[0].file = file;
    set.objects[0].animation = animation;
    const std::clock_t start = std::clock();
    try {
      const scene::Scene scene = scene::load_scene(set);
      expect_sound(scene);
      render::material_features(scene, set.estimation.specular_roughness);
      ++loaded_;
    } catch (const Error& refused) {
      EXPECT_EQ(std::string(refused.what()).rfind(file.string(), 0), 0u) << refused.what();
      ++refused_;
    }
    slowest_s_ = std::max(slowest_s_, static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
  }

  static long peak_kib() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;
  }

  // An accessor of zeros may have 2^22 elements: 48 MiB of positions, which split into three
  // normals and positions a triangle and are copied are some 500 MiB; a sanitizer that keeps what
  // was freed makes it twice.
  void TearDown() override {
    RecordProperty("loaded", loaded_);
    RecordProperty("refused", refused_);
    std::printf("%d loaded, %d refused, slowest %.3f s\n", loaded_, refused_, slowest_s_);
    EXPECT_LT(slowest_s_, 10);
    EXPECT_LT(peak_kib() - peak_before_kib_, 1 << 20);
  }

  TemporaryDirectory directory_;
  const long peak_before_kib_ = peak_kib();
  int loaded_ = 0, refused_ = 0;
  double slowest_s_ = 0;
};

TEST_F(GltfMutations, OfBytesOfABinaryFile) {
  const std::string whole = bytes_of(gltf_sample(), directory_ / "sample.glb");
  load(directory_ / "sample.glb");
  ASSERT_EQ(loaded_, 2);
  for (std::uint32_t seed = 0; seed < 1500; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    load_bytes(fuzz::mutate_bytes(whole, random));
  }
  EXPECT_GT(loaded_, 40);
  EXPECT_GT(refused_, 400);
}

TEST_F(GltfMutations, OfValuesOfTheJson) {
  for (const char* name : {"sample.gltf", "sample.glb"}) {
    const std::string whole = bytes_of(gltf_sample(), directory_ / name);
    for (std::uint32_t seed = 0; seed < 500; ++seed) {
      SCOPED_TRACE(name + (" by seed " + std::to_string(seed)));
      std::mt19937 random(seed);
      load_bytes(fuzz::mutate_gltf(fuzz::bytes_of(whole), random).value());
    }
  }
  EXPECT_GT(loaded_, 160);
  EXPECT_GT(refused_, 200);
}

// What is damaged here is mostly the compressed data, which the decoders must refuse themselves.
TEST_F(GltfMutations, OfCompressedMeshes) {
  for (const GltfWriter& gltf : {meshopt_grid(), draco_grid()}) {
    const std::string whole = bytes_of(gltf, directory_ / "whole.glb");
    const std::size_t data = whole.find("BIN\0", 0, 4) + 4;
    for (std::uint32_t seed = 0; seed < 1000; ++seed) {
      SCOPED_TRACE(seed);
      std::mt19937 random(seed);
      std::string mutant = fuzz::mutate_bytes(whole.substr(data), random);
      mutant.resize(whole.size() - data);
      load_bytes(whole.substr(0, data) + mutant);
    }
  }
  EXPECT_GT(loaded_, 40);
  EXPECT_GT(refused_, 400);
}

TEST_F(GltfMutations, OfEveryTruncation) {
  const std::string whole = bytes_of(gltf_sample(), directory_ / "sample.glb");
  for (std::size_t size = 0; size < whole.size(); size += 7) load_bytes(whole.substr(0, size));
  EXPECT_EQ(loaded_, 0);
}

}  // namespace previz::test::gltf_mutation_test
