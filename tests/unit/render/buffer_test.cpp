// Every buffer is made for something, and where a device has no memory for it the error says for
// what, how much it is, and what to do.
#include "daemon/core/render/device/buffer.hpp"

#include <map>
#include <regex>

#include "tests/support/figure.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::buffer_test {

using render::Buffer;
using render::Device;
using render::Purpose;

std::shared_ptr<Device> as_gpu() {
  return render::open_device(
      {.validation = true, .name = "", .as_gpu = true, .hardware_rays = false});
}

PFN_vkAllocateMemory& allocate_of(Device& device) {
  using Table = std::remove_cvref_t<decltype(*device.vk().getDispatcher())>;
  return const_cast<Table*>(device.vk().getDispatcher())->vkAllocateMemory;
}

// Lets a device have no memory for one of its allocations, through its table of functions, which is
// the test's own.
struct FullAt {
  FullAt(Device& of, int nth) : device(of) {
    left = nth;
    real = std::exchange(allocate_of(of), &allocate);
  }
  ~FullAt() { allocate_of(device) = real; }

  static VKAPI_ATTR VkResult VKAPI_CALL allocate(VkDevice vk, const VkMemoryAllocateInfo* info,
                                                 const VkAllocationCallbacks* callbacks,
                                                 VkDeviceMemory* memory) {
    if (left-- == 0) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    return real(vk, info, callbacks, memory);
  }

  Device& device;
  static inline PFN_vkAllocateMemory real;
  static inline int left;
};

constexpr int width = 48, height = 36;

// A textured floor, and above it a glass ball and one that deforms, under a lamp.
View balls_on_texture() {
  View view = empty_view({0, -0.8, 1}, {0, 0, 0.05}, pinhole(width, height, 0.8), glm::vec3(0.1f));
  scene::Material floor = diffuse(glm::vec3(0.7f));
  floor.base_color_texture = add_texture(view.scene, texture_of(1, 1, {glm::vec4(0.5f)}));
  add(view.scene, rectangle_mesh({2, 2}), floor);
  add(view.scene, icosphere_mesh(0.2, 2), glass(1.5f), at({0, 0, 0.25}), scene::world_mixed);
  add_squeezed_ball(view.scene, squeezed_ball_mesh(0.1, 8, 6), 0, at({-0.4, 0, 0.2}));
  view.scene.lights.push_back(sphere_lamp({0.3, 0, 1}, 0.1, glm::dvec3(2)));
  return view;
}

// A frame that uses all that makes buffers.
void render_live(const std::shared_ptr<Device>& device) {
  SetRenderer renderer(
      balls_on_texture(),
      {.real_radiance = set::RealRadiance::camera, .photons = 4, .filter_textures = true},
      set::LightSampling::importance, device);
  renderer.deform({{.weights = {0.5}, .joints = {}}});
  renderer.begin({.plate = std::make_shared<const Plate>(random_plate(width, height, 8)),
                  .exposure = 0.5,
                  .world_from_camera = look_at({0, -0.8, 1}, {0, 0, 0.05}),
                  .accumulates = true});
  renderer.render(2);
  renderer.show(true);
}

// Whichever buffer does not fit.
TEST(Buffers, ThatDoNotFitSayForWhatAndWhatToDo) {
  const auto device = as_gpu();
  std::map<std::string, std::string> advice;  // by what the buffer is for
  for (int nth = 0;; ++nth) {
    const FullAt full(*device, nth);
    const std::string error = error_of([&] { render_live(device); });
    if (error.empty()) break;
    std::smatch parts;
    ASSERT_TRUE(std::regex_match(error, parts,
                                 std::regex("Vulkan: (.*) is out of memory for a buffer of [0-9.]+ "
                                            "(?:bytes|MB) for (.*); (.*)")))
        << error;
    EXPECT_EQ(parts.str(1), device->name());
    advice[parts.str(2)] = parts.str(3);
  }
  const std::map<std::string, const char*> expected = {
      {"copies to and from the graphics card", "close other programs"},
      {"the average over frames of a picture of 48x36", "quality.accumulate"},
      {"the bounds of virtual objects", "use fewer objects"},
      {"the camera's radiance", "estimator.real_radiance"},
      {"the camera's response", "close other programs"},
      {"the counters of paths", "close other programs"},
      {"the dither pattern", "close other programs"},
      {"the environment light", "use a smaller environment map"},
      {"the frame's settings", "close other programs"},
      {"the lamps and the triangles that emit light", "simplify the meshes"},
      {"the light of photons of a picture of 48x36", "make the picture smaller"},
      {"the materials", "use fewer materials"},
      {"the meshes that deform", "simplify the meshes"},
      {"the noise filter", "quality.denoise"},
      {"the paths of a picture of 48x36", "make the picture smaller"},
      {"the photons", "lower estimator.photons"},
      {"the plate", "choose a smaller picture of the camera"},
      {"the rays of a picture of 48x36", "make the picture smaller"},
      {"the scene's objects", "use fewer objects"},
      {"the scene's textures", "use smaller textures"},
      {"the shown picture", "make the picture smaller"},
      {"the triangles", "simplify the meshes"},
      {"the triangles' tree", "simplify the meshes"}};
  for (const auto& [what, order] : expected) EXPECT_THAT(advice[what], HasSubstr(order)) << what;
  EXPECT_EQ(advice.size(), expected.size()) << testing::PrintToString(advice);
  EXPECT_EQ(render::validation_messages(*device), 0u);
}

TEST(Buffers, ThatDoNotFitSayTheirSize) {
  const auto device = as_gpu();
  const Purpose purpose{"the plate", "do without", 8, 6};
  const auto error_of_size = [&](vk::DeviceSize bytes) {
    const FullAt full(*device, 0);
    return error_of([&] { render::create_storage_buffer(*device, purpose, bytes); });
  };
  const std::string begin = "Vulkan: " + device->name() + " is out of memory for a buffer of ";
  const std::string end = " for the plate of a picture of 8x6; do without";
  EXPECT_EQ(error_of_size(1000), begin + "1008 bytes" + end);
  EXPECT_EQ(error_of_size(34'100'000), begin + "34.1 MB" + end);
}

std::shared_ptr<Device> integrated() {
  return render::open_device(
      {.validation = true, .name = "", .as_gpu = true, .as_integrated = true});
}

TEST(MappedMemory, IsWrittenWithoutACopyWhileTheDeviceHasNothingToDo) {
  for (const auto& device : {integrated(), as_gpu()}) {
    const Purpose purpose{"a test", ""};
    const bool is_mapped = device->memory().mapped_types() != 0;
    const std::vector<std::uint32_t> first{1, 2, 3}, second{4, 5, 6};
    Buffer buffer;
    render::upload_storage(*device, purpose, buffer, first);
    EXPECT_EQ(device->submissions().is_idle(), is_mapped);
    EXPECT_EQ(render::download<std::uint32_t>(*device, buffer, 3), first);
    render::upload_storage(*device, purpose, buffer, second);
    EXPECT_EQ(device->submissions().is_idle(), is_mapped);
    EXPECT_EQ(render::download<std::uint32_t>(*device, buffer, 3), second);
    EXPECT_EQ(render::validation_messages(*device), 0u);
  }
}

TEST(MappedMemory, IsCopiedToBehindWhatTheDeviceHasToDo) {
  const auto device = integrated();
  if (device->memory().mapped_types() == 0)
    GTEST_SKIP() << "the host cannot write the device's memory";
  const Purpose purpose{"a test", ""};
  const std::vector<std::uint32_t> first{1, 2, 3}, second{4, 5, 6};
  Buffer buffer, untouched;
  render::upload_storage(*device, purpose, buffer, first);
  render::upload_storage(*device, purpose, untouched, first);
  std::vector<std::uint32_t> before(3);
  render::Downloads downloads;
  downloads.add(*device, buffer, std::as_writable_bytes(std::span(before)));
  render::upload_storage(*device, purpose, buffer, second);  // only recorded is what reads it
  device->submissions().flush();
  render::upload_storage(*device, purpose, untouched, second);  // it may be under way
  EXPECT_FALSE(device->submissions().is_idle());
  downloads.finish();
  EXPECT_EQ(before, first);
  EXPECT_EQ(render::download<std::uint32_t>(*device, buffer, 3), second);
  EXPECT_EQ(render::download<std::uint32_t>(*device, untouched, 3), second);
  EXPECT_EQ(render::validation_messages(*device), 0u);
}

}  // namespace previz::test::buffer_test
