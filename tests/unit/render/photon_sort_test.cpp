// Wherever photons are, those of a bucket are together and in the order of their numbers, so that
// sums over them round alike in every run.
#include <algorithm>
#include <bit>
#include <functional>

#include "daemon/core/render/passes/photon_map.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::photon_sort_test {

using render::Buffer;
using render::Buffers;

using Photons = std::vector<std::uint32_t>;  // their numbers

// Sorts photons that have these buckets, two for each that was emitted, and returns those of each
// bucket.
std::vector<Photons> sort_photons(render::Device& device, const std::vector<std::uint32_t>& keys) {
  const auto count = static_cast<std::uint32_t>(keys.size() / 2);
  render::PhotonMap map(device);
  map.resize(count);
  map.create_kernels(gpu::FEATURE_PHOTONS);
  gpu::GpuFrame frame{};
  frame.photon_count = count;
  std::vector<gpu::GpuPhoton> photons(keys.size());
  for (std::size_t i = 0; i < photons.size(); ++i) photons[i].mixed.x = static_cast<float>(i);
  Buffer frames, photon_buffer, key_buffer;
  const render::Purpose purpose{"a test", ""};
  render::upload_uniform(device, purpose, frames, frame);
  render::upload_storage(device, purpose, photon_buffer, photons);
  render::upload_storage(device, purpose, key_buffer, keys);
  Buffers buffers;
  map.add_to(buffers);
  buffers["frame"] = &frames;
  buffers["photons"] = &photon_buffer;
  buffers["photon_keys"] = &key_buffer;
  device.record([&](const vk::raii::CommandBuffer& commands) {
    render::record_clear(device, commands, {buffers["buckets"], buffers["photon_control"]});
    map.record_sorting(commands, {}, buffers);
  });
  const auto texels = render::download<glm::vec4>(device, *buffers["sorted_photons"],
                                                  keys.size() * gpu::TEXELS_PER_PHOTON);
  std::vector<Photons> sorted;
  for (const gpu::GpuPhotonBucket& bucket : render::download<gpu::GpuPhotonBucket>(
           device, *buffers["buckets"], std::bit_ceil(keys.size()))) {
    Photons& of_bucket = sorted.emplace_back();
    EXPECT_LE(std::uint64_t{bucket.first} + bucket.count, keys.size());
    for (std::size_t i = bucket.first; i < std::size_t{bucket.first} + bucket.count; ++i)
      // The second texel of a photon has its red, which is its number.
      of_bucket.push_back(static_cast<std::uint32_t>(texels.at(gpu::TEXELS_PER_PHOTON * i + 1).w));
  }
  return sorted;
}

// Returns the bucket of a photon, of so many buckets.
using BucketOf = std::function<std::uint32_t(std::uint32_t photon, std::uint32_t buckets)>;

void expect_sorted(std::uint32_t count, const BucketOf& bucket_of) {
  std::vector<std::uint32_t> keys(2 * std::size_t{count});
  const auto buckets = static_cast<std::uint32_t>(std::bit_ceil(keys.size()));
  std::vector<Photons> expected(buckets);
  for (std::uint32_t photon = 0; photon < keys.size(); ++photon) {
    keys[photon] = bucket_of(photon, buckets);
    if (keys[photon] != gpu::NO_INDEX) expected[keys[photon]].push_back(photon);
  }
  const std::vector<Photons> sorted = sort_photons(*shared_device(), keys);
  ASSERT_EQ(sorted.size(), expected.size());
  const auto differing = std::ranges::mismatch(sorted, expected);
  EXPECT_EQ(differing.in1, sorted.end())
      << "of " << count << " photons, bucket " << differing.in1 - sorted.begin();
}

// Fewer than a block of the sort, about one, and many; the most that a CPU device has in flight.
constexpr std::uint32_t counts[] = {1, 2, 40, 1023, 1025, 5'000, 131'072};

// An odd factor makes each number another one, all over the buckets.
std::uint32_t scattered(std::uint32_t photon, std::uint32_t buckets) {
  return photon * 0x9e3779b1u & (buckets - 1);
}

TEST(PhotonSort, KeepsTheOrderOfPhotonsInOneBucket) {
  for (const std::uint32_t count : counts) {
    expect_sorted(count, [](std::uint32_t, std::uint32_t) { return 0u; });
    expect_sorted(count, [](std::uint32_t, std::uint32_t buckets) { return buckets - 1; });
  }
}

TEST(PhotonSort, FindsEachPhotonThatHasABucketOfItsOwn) {
  for (const std::uint32_t count : counts) expect_sorted(count, scattered);
}

TEST(PhotonSort, KeepsTheOrderInBucketsOfAnySize) {
  for (const std::uint32_t count : counts)
    expect_sorted(count, [](std::uint32_t photon, std::uint32_t buckets) {
      const std::uint32_t random = photon * 0x9e3779b1u >> 8;
      if (photon % 3 == 0) return buckets / 2;
      return photon % 3 == 1 ? random % std::min(buckets, 300u) : random & (buckets - 1);
    });
}

TEST(PhotonSort, LeavesOutWhatIsNotStored) {
  for (const std::uint32_t count : counts) {
    expect_sorted(count, [](std::uint32_t, std::uint32_t) { return gpu::NO_INDEX; });
    expect_sorted(count, [&](std::uint32_t photon, std::uint32_t buckets) {
      return photon == 2 * count - 1 ? buckets - 1 : gpu::NO_INDEX;
    });
    expect_sorted(count, [](std::uint32_t photon, std::uint32_t buckets) {
      return photon % 5 == 0 ? gpu::NO_INDEX : scattered(photon / 7, buckets);
    });
    // As where nothing forks.
    expect_sorted(count, [](std::uint32_t photon, std::uint32_t buckets) {
      return photon % 2 == 1 ? gpu::NO_INDEX : scattered(photon / 64, buckets);
    });
  }
  EXPECT_EQ(render::validation_messages(*shared_device()), 0u);
}

}  // namespace previz::test::photon_sort_test
