#include "daemon/core/render/passes/camera_map.hpp"

#include "shaders/camera_depth.spv.h"
#include "shaders/camera_depth_query.spv.h"
#include "shaders/camera_measured.spv.h"
#include "shaders/camera_usable.spv.h"

namespace previz::render {
namespace {

constexpr Purpose for_radiance{
    "the camera's radiance",
    "make the picture smaller, or set estimator.real_radiance to \"traced\""};

}  // namespace

void CameraMap::resize(std::uint32_t pixels) {
  if (pixels <= pixels_) return;  // a smaller picture uses a part
  pixels_ = pixels;
  plate_ = create_texel_buffer(device_, for_radiance, pixels * sizeof(gpu::vec4),
                               vk::Format::eR32G32B32A32Sfloat, true);
  seen_ = create_storage_buffer(device_, for_radiance, pixels * sizeof(gpu::GpuSeen));
}

std::span<const Pass> CameraMap::passes() {
  static constexpr Pass all[] = {{"camera_measured", camera_measured_spv},
                                 {"camera_depth", camera_depth_spv, camera_depth_query_spv},
                                 {"camera_usable", camera_usable_spv}};
  return all;
}

void CameraMap::create_kernels(std::uint32_t features) {
  make_kernels({&measured_, &depth_, &usable_}, device_, passes(), features);
}

void CameraMap::add_to(Buffers& buffers) const {
  buffers.insert({{"seen_radiance", &plate_},
                  {"plate", &plate_},
                  {"seen", &seen_},
                  {"radiance_of", &radiance_of_}});
}

void CameraMap::use(std::uint32_t pixels, const std::vector<float>& radiance_of_codes) {
  resize(pixels);
  if (radiance_ == radiance_of_codes) return;
  upload_storage(device_, for_radiance, radiance_of_, radiance_of_codes);
  radiance_ = radiance_of_codes;
}

void CameraMap::record(const vk::raii::CommandBuffer& commands,
                       const std::vector<gpu::GpuBatch>& parts, const Buffers& buffers) {
  for (Kernel* pass : {&measured_, &depth_, &usable_})
    for (const gpu::GpuBatch& part : parts)
      pass->dispatch({commands, part, buffers}, part.width * part.height);
}

}  // namespace previz::render
