// Every buffer is made for something, and where a device has no memory for it the error says for
// what, how much it is, and what to do.
#include "daemon/core/render/device/buffer.hpp"

#include <set>

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

// Listens to the allocations of a device through its table of functions, which is the test's own.
struct Allocations {
  explicit Allocations(Device& of, const std::string& full_for = {}) {
    device = &of;
    no_memory_for = full_for;
    purposes.clear();
    real = std::exchange(allocate_of(of), &allocate);
  }
  ~Allocations() { allocate_of(*device) = real; }

  static VKAPI_ATTR VkResult VKAPI_CALL allocate(VkDevice vk, const VkMemoryAllocateInfo* info,
                                                 const VkAllocationCallbacks* callbacks,
                                                 VkDeviceMemory* memory) {
    const std::string what = device->purpose() ? device->purpose()->what() : "nothing";
    purposes.insert(what);
    if (what == no_memory_for) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    return real(vk, info, callbacks, memory);
  }

  static inline Device* device;
  static inline PFN_vkAllocateMemory real;
  static inline std::string no_memory_for;
  static inline std::set<std::string> purposes;
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

TEST(Buffers, AreAllMadeForSomething) {
  const auto device = as_gpu();
  const Allocations heard(*device);
  render_live(device);
  EXPECT_THAT(
      heard.purposes,
      ElementsAre(
          "copies to and from the graphics card", "the average over frames of a picture of 48x36",
          "the bounds of virtual objects", "the camera's radiance", "the camera's response",
          "the counters of paths", "the dither pattern", "the environment light",
          "the frame's settings", "the lamps and the triangles that emit light",
          "the light of photons of a picture of 48x36", "the materials", "the meshes that deform",
          "the noise filter", "the paths of a picture of 48x36", "the photons", "the plate",
          "the rays of a picture of 48x36", "the scene's objects", "the scene's textures",
          "the shown picture", "the triangles", "the triangles' tree"));
  EXPECT_EQ(render::validation_messages(*device), 0u);
}

TEST(Buffers, ThatDoNotFitSayForWhatAndWhatToDo) {
  const auto device = as_gpu();
  const struct {
    const char *what, *advice;
  } cases[] = {{"the scene's textures", "; use smaller textures"},
               {"the triangles' tree", "; simplify the meshes"},
               {"the photons", "; lower estimator.photons"},
               {"the paths of a picture of 48x36", "; make the picture smaller"},
               {"the average over frames of a picture of 48x36", "quality.accumulate"},
               {"the noise filter", "quality.denoise"},
               {"copies to and from the graphics card", "; close other programs"}};
  for (const auto& each : cases) {
    const Allocations full(*device, each.what);
    EXPECT_THAT(
        error_of([&] { render_live(device); }),
        AllOf(StartsWith("Vulkan: " + device->name() + " is out of memory for a buffer of "),
              testing::ContainsRegex("[0-9] (bytes|MB) for "),
              HasSubstr(std::string("for ") + each.what), HasSubstr(each.advice)));
  }
  EXPECT_EQ(render::validation_messages(*device), 0u);
}

TEST(Buffers, ThatDoNotFitSayTheirSize) {
  const auto device = as_gpu();
  const Allocations full(*device, "the plate of a picture of 8x6");
  const Purpose outer(*device, "the plate", "do without", 8, 6);
  {
    const Purpose inner(*device, "the paths", "use fewer");
    EXPECT_EQ(error_of([&] { render::create_storage_buffer(*device, 1000); }), "");
  }
  const auto error_of_size = [&](vk::DeviceSize bytes) {
    return error_of([&] { render::create_storage_buffer(*device, bytes); });
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
    const Purpose purpose(*device, "a test", "");
    const bool is_mapped = device->mapped_types() != 0;
    const std::vector<std::uint32_t> first{1, 2, 3}, second{4, 5, 6};
    Buffer buffer;
    render::upload_storage(*device, buffer, first);
    EXPECT_EQ(device->submissions().is_idle(), is_mapped);
    EXPECT_EQ(render::download<std::uint32_t>(*device, buffer, 3), first);
    render::upload_storage(*device, buffer, second);
    EXPECT_EQ(device->submissions().is_idle(), is_mapped);
    EXPECT_EQ(render::download<std::uint32_t>(*device, buffer, 3), second);
    EXPECT_EQ(render::validation_messages(*device), 0u);
  }
}

TEST(MappedMemory, IsCopiedToBehindWhatTheDeviceHasToDo) {
  const auto device = integrated();
  if (device->mapped_types() == 0) GTEST_SKIP() << "the host cannot write the device's memory";
  const Purpose purpose(*device, "a test", "");
  const std::vector<std::uint32_t> first{1, 2, 3}, second{4, 5, 6};
  Buffer buffer, untouched;
  render::upload_storage(*device, buffer, first);
  render::upload_storage(*device, untouched, first);
  std::vector<std::uint32_t> before(3);
  render::Downloads downloads;
  downloads.add(*device, buffer, std::as_writable_bytes(std::span(before)));
  render::upload_storage(*device, buffer, second);  // only recorded is what reads it
  device->submissions().flush();
  render::upload_storage(*device, untouched, second);  // it may be under way
  EXPECT_FALSE(device->submissions().is_idle());
  downloads.finish();
  EXPECT_EQ(before, first);
  EXPECT_EQ(render::download<std::uint32_t>(*device, buffer, 3), second);
  EXPECT_EQ(render::download<std::uint32_t>(*device, untouched, 3), second);
  EXPECT_EQ(render::validation_messages(*device), 0u);
}

}  // namespace previz::test::buffer_test
