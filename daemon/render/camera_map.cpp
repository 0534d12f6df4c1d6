#include "daemon/render/camera_map.hpp"

#include "shaders/camera_depth.spv.h"
#include "shaders/camera_usable.spv.h"

namespace previz::render {

void CameraMap::resize(std::uint32_t pixels) {
  if (pixels <= pixels_) return;  // a smaller picture uses a part
  pixels_ = pixels;
  plate_ = create_texel_buffer(device_, pixels * sizeof(gpu::vec4), vk::Format::eR32G32B32A32Sfloat,
                               true);
  seen_ = create_storage_buffer(device_, pixels * sizeof(gpu::GpuSeen));
}

std::span<const Pass> CameraMap::passes() {
  static constexpr Pass all[] = {{"camera_depth", camera_depth_spv},
                                 {"camera_usable", camera_usable_spv}};
  return all;
}

void CameraMap::create_kernels(std::uint32_t features) {
  make_kernels({&depth_, &usable_}, device_, passes(), features);
}

void CameraMap::add_to(Buffers& buffers) const {
  buffers.insert({{"seen_radiance", &plate_}, {"plate", &plate_}, {"seen", &seen_}});
}

void CameraMap::upload(const std::vector<glm::vec4>& plate) {
  resize(static_cast<std::uint32_t>(plate.size()));
  upload_bytes(device_, plate_, std::as_bytes(std::span(plate)));
}

void CameraMap::record(const vk::raii::CommandBuffer& commands,
                       const std::vector<gpu::GpuBatch>& parts, const Buffers& buffers) {
  for (Kernel* pass : {&depth_, &usable_})
    for (const gpu::GpuBatch& part : parts)
      pass->dispatch({commands, part, buffers}, part.width * part.height);
}

}  // namespace previz::render
