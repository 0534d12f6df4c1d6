// However many photons are in one place, their order is that of their numbers, so that sums over
// them round alike in every run.
#include <set>

#include "daemon/render/photon_map.hpp"
#include "shaders/place_photons.spv.h"
#include "tests/support/render_fixture.hpp"

namespace previz::test::photon_sort_test {

using render::Buffer;
using render::Buffers;

struct Sorted {
  std::vector<gpu::GpuPhotonBucket> buckets;
  std::vector<std::uint32_t> photons;  // their numbers, those of a bucket together
};

Sorted sort_photons(render::Device& device, std::uint32_t count) {
  render::PhotonMap map(device);
  map.resize(count);
  map.create_kernels(gpu::FEATURE_PHOTONS);
  render::Kernel place(device, "place_photons", place_photons_spv, {0, 0});
  gpu::GpuFrame frame{};
  frame.photon_count = count;
  Buffer frames;
  const render::Purpose purpose(device, "a test", "");
  render::upload_storage(device, frames, std::vector{frame});
  Buffers buffers{{"frame", &frames}};
  map.add_to(buffers);
  gpu::GpuBatch batch{};
  batch.photon_radius = 1e-3f;
  device.record([&](const vk::raii::CommandBuffer& commands) {
    render::record_clear(device, commands,
                         {buffers["buckets"], buffers["filled"], buffers["photon_control"]});
    place.dispatch({commands, batch, buffers}, 2 * count);
    map.record_sorting(commands, batch, buffers);
  });
  Sorted sorted;
  const Buffer& found = *buffers["buckets"];
  sorted.buckets = render::download<gpu::GpuPhotonBucket>(
      device, found, found.size / sizeof(gpu::GpuPhotonBucket));
  for (const glm::vec4& texel : render::download<glm::vec4>(
           device, *buffers["sorted_photons"], std::size_t{2} * count * gpu::TEXELS_PER_PHOTON))
    sorted.photons.push_back(static_cast<std::uint32_t>(texel.w));
  return sorted;
}

TEST(PhotonSort, IsByNumberInABucketOfAnySize) {
  for (const std::uint32_t count : {1u, 40u, 5'000u, 100'000u}) {
    const Sorted sorted = sort_photons(*shared_device(), count);
    std::uint32_t largest = 0;
    std::set<std::uint32_t> seen;
    std::size_t unordered = 0;
    for (const gpu::GpuPhotonBucket& bucket : sorted.buckets) {
      largest = std::max(largest, bucket.count);
      std::uint32_t last = 0;
      for (std::uint32_t i = bucket.first; i < bucket.first + bucket.count; ++i) {
        // The second texel of a photon has its red, which is its number.
        const std::uint32_t photon = sorted.photons[gpu::TEXELS_PER_PHOTON * i + 1];
        unordered += photon <= last && i > bucket.first;
        seen.insert(last = photon);
      }
    }
    EXPECT_EQ(unordered, 0u) << count;
    EXPECT_GE(largest, 2 * count / 4) << count;
    std::set<std::uint32_t> stored;
    for (std::uint32_t photon = 0; photon < 2 * count; ++photon)
      if (photon % 5 > 0) stored.insert(photon);
    EXPECT_EQ(seen, stored) << count;
  }
  EXPECT_EQ(render::validation_messages(*shared_device()), 0u);
}

}  // namespace previz::test::photon_sort_test
