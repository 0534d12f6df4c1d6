// What a SPIR-V module says about itself, and what is left of it when features are switched off.
#include "daemon/core/render/device/spirv.hpp"

#include <set>
#include <spirv-tools/libspirv.hpp>

#include "daemon/core/render/device/kernel.hpp"
#include "daemon/core/render/passes/passes.hpp"
#include "daemon/core/render/world/feature.hpp"
#include "shaders/accumulate.spv.h"
#include "shaders/extend.spv.h"
#include "shaders/generate.spv.h"
#include "shaders/lib/render_shared.h"
#include "shaders/refit_nodes.spv.h"
#include "shaders/shade.spv.h"
#include "tests/support/render_fixture.hpp"

namespace previz::test::spirv_test {

using render::describe_spirv;
using render::specialise_spirv;
using render::SpirvInfo;

constexpr std::uint32_t every_feature = (gpu::FEATURE_TANGENTS << 1) - 1;

TEST(Spirv, NamesTheBuffersThatAreUsed) {
  const SpirvInfo info = describe_spirv(generate_spv);
  EXPECT_EQ(info.group_size, gpu::WORKGROUP_SIZE);
  const auto has = [&](const std::string& name, render::BufferKind kind) {
    return std::ranges::any_of(info.bindings, [&](const SpirvInfo::Binding& binding) {
      return binding.name == name && binding.kind == kind;
    });
  };
  EXPECT_TRUE(has("control", render::BufferKind::storage));
  EXPECT_FALSE(has("vertices",
                   render::BufferKind::texels));  // declared in a header, and not used by this pass
  const SpirvInfo shade = describe_spirv(shade_spv);
  EXPECT_TRUE(std::ranges::any_of(shade.bindings, [](const SpirvInfo::Binding& binding) {
    return binding.name == "vertices" && binding.kind == render::BufferKind::texels;
  }));
}

// A device that reads storage needs no texels at all.
TEST(Spirv, WhatIsFetchedIsTexelsOrStorageByTheDevice) {
  const auto bindings_for = [](std::uint32_t device) {
    return describe_spirv(
               specialise_spirv(shade_spv, std::array<std::uint32_t, 2>{every_feature, device}))
        .bindings;
  };
  const auto kinds_of = [](const std::vector<SpirvInfo::Binding>& bindings,
                           const std::string& name) {
    std::vector<render::BufferKind> kinds;
    for (const SpirvInfo::Binding& binding : bindings)
      if (binding.name == name) kinds.push_back(binding.kind);
    return kinds;
  };
  const auto names_of = [](const std::vector<SpirvInfo::Binding>& bindings) {
    std::set<std::string> names;
    for (const SpirvInfo::Binding& binding : bindings) names.insert(binding.name);
    return names;
  };
  const auto as_texels = bindings_for(0), as_storage = bindings_for(gpu::DEVICE_READS_STORAGE);
  EXPECT_EQ(names_of(as_texels), names_of(as_storage));
  EXPECT_EQ(names_of(as_storage).size(), as_storage.size());
  for (const char* const name : {"vertices", "triangles", "texels", "environment"}) {
    EXPECT_THAT(kinds_of(as_texels, name), ElementsAre(render::BufferKind::texels)) << name;
    EXPECT_THAT(kinds_of(as_storage, name), ElementsAre(render::BufferKind::storage)) << name;
  }
  // The state of paths is written, too.
  EXPECT_THAT(
      kinds_of(as_texels, "ray_origin"),
      testing::UnorderedElementsAre(render::BufferKind::texels, render::BufferKind::storage));
  EXPECT_THAT(kinds_of(as_storage, "ray_origin"), ElementsAre(render::BufferKind::storage));
  EXPECT_TRUE(std::ranges::none_of(
      as_storage, [](render::BufferKind kind) { return kind == render::BufferKind::texels; },
      &SpirvInfo::Binding::kind));
}

// With all features, each pass of a card has no more storage buffers than Mesa's CPU device allows,
// on which cards are tested.
TEST(Spirv, APassOfACardNeedsFewStorageBuffers) {
  constexpr std::uint32_t card = gpu::DEVICE_IS_CARD | gpu::DEVICE_READS_STORAGE;
  for (const render::Pass& pass : render::passes_for(every_feature, card)) {
    const SpirvInfo info = describe_spirv(render::module_of(pass, every_feature, card));
    EXPECT_LE(info.bindings.size(), 32u) << pass.name;
  }
}

TEST(Spirv, KnowsTheFeaturesThatAPassAsksAbout) {
  EXPECT_EQ(describe_spirv(refit_nodes_spv).asked_bits, 0u);
  const std::uint32_t extend = describe_spirv(extend_spv).asked_bits;
  EXPECT_EQ(extend & ~every_feature, 0u);
  EXPECT_NE(extend & gpu::FEATURE_ALPHA, 0u);
  EXPECT_EQ(extend & gpu::FEATURE_PHOTONS, 0u);  // rays are traced alike with a map and without
  const std::uint32_t shade = describe_spirv(shade_spv).asked_bits;
  EXPECT_EQ(shade & ~every_feature, 0u);
  for (const std::uint32_t bit : {gpu::FEATURE_GLOSSY, gpu::FEATURE_SHEEN, gpu::FEATURE_PHOTONS})
    EXPECT_NE(shade & bit, 0u) << bit;
}

// The path tracer's heaviest pass, for a scene of plain paint: the driver gets a quarter of it.
TEST(Spirv, LeavesOutWhatIsSwitchedOff) {
  const std::array<std::uint32_t, 1> none = {0}, all = {every_feature};
  const std::size_t whole = specialise_spirv(shade_spv, all).size();
  const std::size_t plain = specialise_spirv(shade_spv, none).size();
  EXPECT_LT(4 * plain, whole);
  EXPECT_EQ(specialise_spirv(shade_spv, none), specialise_spirv(shade_spv, none));
}

// A card whose driver can be asked to keeps the lanes of a subgroup together, on which the queues
// rest.
TEST(Spirv, AsksForSubgroupsThatMeetAgain) {
  spvtools::SpirvTools tools(SPV_ENV_VULKAN_1_3);
  std::string complaint;
  tools.SetMessageConsumer([&](spv_message_level_t, const char*, const spv_position_t&,
                               const char* message) { complaint += message; });
  spvtools::ValidatorOptions options;
  options.SetScalarBlockLayout(true);
  const auto text = [&](const std::vector<std::uint32_t>& module) {
    EXPECT_TRUE(tools.Validate(module.data(), module.size(), options)) << complaint;
    std::string result;
    EXPECT_TRUE(tools.Disassemble(module, &result));
    return result;
  };
  EXPECT_THAT(text(render::with_uniform_subgroups(shade_spv)),
              AllOf(HasSubstr("OpExtension \"SPV_KHR_subgroup_uniform_control_flow\""),
                    HasSubstr("OpExecutionMode %main SubgroupUniformControlFlowKHR")));
  const std::vector<std::uint32_t> extend(std::begin(extend_spv), std::end(extend_spv));
  EXPECT_EQ(render::with_uniform_subgroups(extend), extend);  // it asks nothing of its subgroup
}

TEST(Spirv, APassIsCompiledOnceForFeaturesThatItDoesNotAskAbout) {
  const std::uint32_t asked = describe_spirv(extend_spv).asked_bits;
  ASSERT_NE(asked & gpu::FEATURE_ALPHA, 0u);
  const render::Kernel kernel(*shared_device(), "extend", extend_spv,
                              {gpu::FEATURE_ALPHA | gpu::FEATURE_PHOTONS});
  const std::array<std::uint32_t, 1> masked = {gpu::FEATURE_ALPHA};
  const auto compiled = shared_device()->programs().get(extend_spv, masked, [] {
    ADD_FAILURE() << "it is compiled again";
    return std::make_shared<const render::Program>();
  });
  EXPECT_FALSE(compiled->bindings.empty());
  EXPECT_EQ(render::validation_messages(*shared_device()), 0u);
}

TEST(Spirv, TheLastPassOfASampleAsksOnlyWhetherThereAreACameraTexturesOrPhotons) {
  EXPECT_EQ(describe_spirv(accumulate_spv).asked_bits, gpu::FEATURE_CAMERA | gpu::FEATURE_TEXTURES |
                                                           gpu::FEATURE_VERTEX_COLORS |
                                                           gpu::FEATURE_PHOTONS);
}

// The picture of a scene of plain paint, with only what it needs compiled in and with every feature
// that can be carried. What is carried is multiplied by nothing and adds no random number, so that
// the pictures are equal bit for bit (daemon/core/render/world/feature.hpp).
TEST(Spirv, NoPixelDependsOnAFeatureThatIsOnlyCompiledIn) {
  View view = empty_view({0, -2, 1.2}, {0, 0, 0.2}, pinhole(12, 8, 0.8), glm::vec3(0.3f));
  add(view.scene, box_mesh(glm::dvec3(0.5)), diffuse(glm::vec3(0.5)));
  std::uint32_t carried = 0;
  for (const render::Feature& feature : render::features())
    if (feature.can_be_carried) carried |= feature.bit;
  const auto layers_with = [&](std::uint32_t features) {
    SetRenderer renderer(view, up_to_depth(3));
    renderer.carry(features);
    render::Layers layers = renderer.rendered_clean(2);
    EXPECT_NE(carried & ~renderer.needed(), 0u);
    return layers;
  };
  const render::Layers masked = layers_with(0), whole = layers_with(carried);
  EXPECT_EQ(masked.mixed, whole.mixed);
  EXPECT_EQ(masked.real, whole.real);
  EXPECT_EQ(masked.mask, whole.mask);
}

}  // namespace previz::test::spirv_test
