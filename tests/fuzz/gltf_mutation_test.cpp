// Thousands of damaged copies of one glTF file, the same ones on every run. Each loads or is
// refused with a previz::Error; what loads keeps scene.hpp's promises, and neither costs much.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <random>

#include "daemon/render/feature.hpp"
#include "daemon/scene/bvh_refit.hpp"
#include "daemon/scene/placement.hpp"
#include "daemon/scene/scene.hpp"
#include "drivers/error.hpp"
#include "tests/support/gltf_writer.hpp"
#include "tests/support/temporary_directory.hpp"

namespace previz::test {
namespace gltf_mutation_test {

using Json = GltfWriter::Json;

// A pyramid with a skin and a morph target, and an animation "go" of both.
void add_figure(GltfWriter& gltf, Json attributes, int indices) {
  const std::vector<unsigned char> joints = {0, 1, 0, 0, 1, 0, 0, 0, 1, 1,
                                             0, 0, 0, 0, 0, 0, 1, 1, 1, 1};
  const std::vector<glm::vec4> weights(5, glm::vec4(0.75f, 0.25f, 0, 0));
  const std::vector<glm::mat4> inverse(2, glm::mat4(1));
  attributes["JOINTS_0"] = gltf.accessor(gltf.view(joints), 5121, "VEC4", 5);
  attributes["WEIGHTS_0"] =
      gltf.accessor(gltf.view(GltfWriter::bytes_of(weights)), 5126, "VEC4", 5);
  const std::vector<glm::vec3> offsets(5, glm::vec3(0, 0.5f, 0));
  const int mesh = gltf.mesh(
      {{"attributes", attributes},
       {"indices", indices},
       {"targets", {{{"POSITION", gltf.positions(offsets)}, {"NORMAL", gltf.normals(offsets)}}}}},
      "figure");
  const int tip = gltf.add("nodes", {{"translation", {0, 1, 0}}});
  gltf.root("foot", -1, {{"children", {tip}}});
  gltf.root("figure", mesh, {{"skin", 0}, {"weights", {0.5}}});
  const int bind =
      gltf.accessor(gltf.view(GltfWriter::bytes_of(inverse)), 5126, "MAT4", inverse.size());
  gltf.json["skins"] = {{{"joints", {tip + 1, tip}}, {"inverseBindMatrices", bind}}};
  const int times = gltf.values<float>(5126, "SCALAR", {0, 1});
  const int places = gltf.positions({{0, 1, 0}, {1, 1, 0}});
  const int changes = gltf.values<float>(5126, "SCALAR", {0, 1});
  gltf.json["animations"] = {
      {{"name", "go"},
       {"channels",
        {{{"sampler", 0}, {"target", {{"node", tip}, {"path", "translation"}}}},
         {{"sampler", 1}, {"target", {{"node", tip + 2}, {"path", "weights"}}}}}},
       {"samplers",
        {{{"input", times}, {"output", places}}, {{"input", times}, {"output", changes}}}}}};
}

// A bit of everything the loader reads.
GltfWriter sample() {
  GltfWriter gltf;
  std::vector<unsigned char> rgba;
  for (int i = 0; i < 4 * 4 * 4; ++i) rgba.push_back(static_cast<unsigned char>(37 * i));
  const int texture = gltf.texture(4, 4, rgba, {{"magFilter", 9728}, {"wrapS", 33071}});
  gltf.add(
      "materials",
      {{"name", "glass"},
       {"alphaMode", "BLEND"},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {1, 1, 0.5, 0.5}},
         {"baseColorTexture",
          {{"index", texture},
           {"texCoord", 0},
           {"extensions", {{"KHR_texture_transform", {{"offset", {0.5, 0}}, {"rotation", 1}}}}}}},
         {"metallicFactor", 0.5}}},
       {"emissiveFactor", {1, 0, 0}},
       {"extensions",
        {{"KHR_materials_transmission", {{"transmissionFactor", 1}}},
         {"KHR_materials_ior", {{"ior", 1.5}}},
         {"KHR_materials_volume", {{"thicknessFactor", 0.1}, {"attenuationDistance", 2}}},
         {"KHR_materials_emissive_strength", {{"emissiveStrength", 3}}}}}});
  gltf.add(
      "materials",
      {{"name", "cloth"},
       {"extensions",
        {{"KHR_materials_sheen",
          {{"sheenColorFactor", {0.5, 1, 0.25}}, {"sheenRoughnessFactor", 0.5}}},
         {"KHR_materials_anisotropy", {{"anisotropyStrength", 0.5}, {"anisotropyRotation", 1}}},
         {"KHR_materials_specular",
          {{"specularFactor", 0.5}, {"specularColorFactor", {1, 0.5, 2}}}},
         {"KHR_materials_clearcoat",
          {{"clearcoatFactor", 0.5}, {"clearcoatRoughnessFactor", 0.25}}}}}});
  gltf.add("materials", {{"name", "night"}, {"emissiveFactor", {0, 0, 1}}});
  const int positions =
      gltf.positions({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5f, 0.5f, 1}});
  const int sparse_indices = gltf.view(GltfWriter::bytes_of(std::vector<std::uint16_t>{4}));
  const int sparse_values = gltf.view(GltfWriter::bytes_of(std::vector<glm::vec3>{{0, 0, 2}}));
  gltf.json["accessors"][positions]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", sparse_indices}, {"componentType", 5123}}},
      {"values", {{"bufferView", sparse_values}}}};
  const Json attributes = {
      {"POSITION", positions},
      {"NORMAL", gltf.normals({{0, 0, -1}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}})},
      {"TEXCOORD_0", gltf.uvs({{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0.5f, 0.5f}})}};
  const int indices =
      gltf.values<std::uint16_t>(5123, "SCALAR", {0, 2, 1, 0, 3, 2, 0, 1, 4, 1, 2, 4});
  const Json looks = {
      {"KHR_materials_variants", {{"mappings", {{{"material", 2}, {"variants", {0, 1}}}}}}}};
  gltf.json["extensions"]["KHR_materials_variants"]["variants"] = {{{"name", "day"}},
                                                                   {{"name", "night"}}};
  const int pyramid = gltf.mesh(
      {{"attributes", attributes}, {"indices", indices}, {"material", 0}, {"extensions", looks}},
      "pyramid");
  const int strip =
      gltf.mesh({{"attributes", {{"POSITION", positions}}}, {"mode", 5}, {"material", 1}}, "strip");
  gltf.json["extensionsUsed"] = {"KHR_lights_punctual", "KHR_materials_variants",
                                 "KHR_texture_transform"};
  gltf.json["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "spot"}, {"intensity", 5}, {"spot", {{"outerConeAngle", 0.5}}}}};
  const int child =
      gltf.add("nodes", {{"mesh", strip}, {"rotation", {0, 0.6, 0, 0.8}}, {"scale", {1, -2, 1}}});
  gltf.root("pyramid", pyramid, {{"children", {child}}, {"translation", {0, 1, 0}}});
  gltf.root("lamp", -1, {{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  add_figure(gltf, attributes, indices);
  gltf.root("again", pyramid, {{"matrix", {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1}}});
  return gltf;
}

class Mutator {
 public:
  explicit Mutator(std::uint32_t seed) : engine_(seed) {}

  std::size_t below(std::size_t count) { return engine_() % count; }

  std::string bytes(std::string file) {
    for (std::size_t i = 0, times = 1 + below(4); i < times && file.size() > 8; ++i) {
      const std::size_t at = below(file.size());
      switch (below(10)) {
        default:
          file[at] = static_cast<char>(file[at] ^ (1 << below(8)));
          break;
        case 1:
          file[at] = static_cast<char>(below(256));
          break;
        case 2: {
          const std::uint32_t words[] = {0, 1, 0x7fffffff, 0x80000000, 0xffffffff, 0x7fc00000};
          if (at + 4 <= file.size()) std::memcpy(&file[at], &words[below(6)], 4);
          break;
        }
        case 3:
          file.resize(at);
          break;
        case 4:
          file.erase(at, 1 + below(16));
          break;
        case 5:
          file.insert(at, file, below(file.size()), 1 + below(16));
          break;
      }
    }
    return file;
  }

  // One value anywhere in the tree becomes another.
  void json(Json& root) {
    Json* at = &root;
    while (at->is_structured() && !at->empty() && (at == &root || below(5) > 0)) {
      auto child = at->begin();
      std::advance(child, static_cast<long>(below(at->size())));
      if (below(12) == 0) {
        at->erase(child);
        return;
      }
      at = &*child;
    }
    *at = value();
  }

 private:
  Json value() {
    const Json values[] = {nullptr,
                           true,
                           -1,
                           0,
                           1,
                           2,
                           5,
                           5121,
                           5123,
                           5125,
                           5126,
                           255,
                           65536,
                           1 << 20,
                           1 << 30,
                           2147483647,
                           4294967296,
                           -2147483648LL,
                           18446744073709551615ull,
                           0.5,
                           -1.5,
                           1e-300,
                           1e300,
                           "",
                           "VEC3",
                           "SCALAR",
                           "x",
                           Json::array(),
                           Json::object(),
                           {0, 0, 0},
                           {0, 1, 2, 3},
                           {{0}},
                           {{"index", 0}}};
    return values[below(std::size(values))];
  }

  std::mt19937_64 engine_;
};

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

  test::TemporaryDirectory directory_;
  const long peak_before_kib_ = peak_kib();
  int loaded_ = 0, refused_ = 0;
  double slowest_s_ = 0;
};

TEST_F(GltfMutations, OfBytesOfABinaryFile) {
  const std::filesystem::path file = directory_ / "mutant";
  sample().save(directory_ / "sample.glb");
  std::ifstream stream(directory_ / "sample.glb", std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(stream), {}};
  load(directory_ / "sample.glb");
  ASSERT_EQ(loaded_, 2);
  for (std::uint32_t seed = 0; seed < 4000; ++seed) {
    SCOPED_TRACE(seed);
    std::ofstream(file, std::ios::binary) << Mutator(seed).bytes(whole);
    load(file);
  }
  EXPECT_GT(loaded_, 100);
  EXPECT_GT(refused_, 1000);
}

TEST_F(GltfMutations, OfValuesOfTheJson) {
  const GltfWriter gltf = sample();
  for (std::uint32_t seed = 0; seed < 2500; ++seed) {
    SCOPED_TRACE(seed);
    Mutator mutator(seed);
    GltfWriter mutant = gltf;
    for (std::size_t i = 0, times = 1 + mutator.below(3); i < times; ++i) mutator.json(mutant.json);
    if (!mutant.json.is_object()) continue;
    const std::filesystem::path file = directory_ / (seed % 2 == 0 ? "mutant.gltf" : "mutant.glb");
    mutant.save(file);
    load(file);
  }
  EXPECT_GT(loaded_, 400);
  EXPECT_GT(refused_, 500);
}

TEST_F(GltfMutations, OfEveryTruncation) {
  sample().save(directory_ / "sample.glb");
  std::ifstream stream(directory_ / "sample.glb", std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(stream), {}};
  for (std::size_t size = 0; size < whole.size(); size += 7) {
    std::ofstream(directory_ / "short", std::ios::binary) << whole.substr(0, size);
    load(directory_ / "short");
  }
  EXPECT_EQ(loaded_, 0);
}

}  // namespace gltf_mutation_test
}  // namespace previz::test
