// Memory that lies in files: what was written comes back, nothing is left behind, and pictures are
// those of memory.
#include "daemon/core/render/picture/scratch.hpp"

#include "tests/support/averaged_frames.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::test::scratch_test {

// On a disk, unlike a TMPDIR in memory.
constexpr const char* folder = "/var/tmp";

// Nothing may stay in memory, so that all of it is given up again and again.
std::shared_ptr<render::Scratch> scratch() {
  return std::make_shared<render::Scratch>(folder, 0);
}

// Returns the bytes of the mapping at this address that the process has in memory.
std::uint64_t resident_at(const void* address) {
  std::ifstream maps("/proc/self/smaps");
  bool is_it = false;
  for (std::string line; std::getline(maps, line);) {
    std::uint64_t begin = 0, end = 0, kib = 0;
    if (std::sscanf(line.c_str(), "%lx-%lx ", &begin, &end) == 2)
      is_it = begin == reinterpret_cast<std::uintptr_t>(address);
    else if (is_it && std::sscanf(line.c_str(), "Rss: %lu kB", &kib) == 1)
      return 1024 * kib;
  }
  return std::uint64_t(-1);
}

TEST(Scratch, LeavesMemory) {
  const render::Sheet<char> sheet(16 << 20, 'a', scratch());
  EXPECT_TRUE(wait_until("it has left", [&] { return resident_at(sheet.data()) == 0; }));
}

TEST(Scratch, GivesBackWhatWasWrittenHoweverOftenItLeavesMemory) {
  render::Sheet<std::uint32_t> sheet(1 << 20, 0, scratch());
  for (std::uint32_t round = 1; round < 5; ++round) {
    for (std::size_t i = 0; i < sheet.size(); ++i)
      EXPECT_EQ(sheet[i], round == 1 ? 0 : static_cast<std::uint32_t>(i) * (round - 1));
    for (std::size_t i = 0; i < sheet.size(); ++i) sheet[i] = static_cast<std::uint32_t>(i) * round;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // two looks of the watcher
  }
}

TEST(Scratch, IsCopiedMovedAndOutlivesItsOwner) {
  auto owner = scratch();
  render::Sheet<float> first(1000, 1.0f, owner);
  owner.reset();
  render::Sheet<float> copy = first;
  const float* const place = first.data();
  render::Sheet<float> moved;
  moved = std::move(first);
  EXPECT_EQ(moved.data(), place);
  copy[0] = 2;
  EXPECT_EQ(moved[0], 1);
  EXPECT_EQ(moved[999], 1);
}

TEST(Scratch, LeavesNoFile) {
  std::string own = std::string(folder) + "/previz-test-XXXXXX";
  ASSERT_TRUE(::mkdtemp(own.data()));
  {
    render::Sheet<char> sheet(1 << 16, 'a', std::make_shared<render::Scratch>(own, 1 << 20));
    EXPECT_TRUE(std::filesystem::is_empty(own));
  }
  EXPECT_TRUE(std::filesystem::remove(own));  // it is empty
}

TEST(Scratch, IsRefusedWhereItsFilesCannotBe) {
  EXPECT_EQ(error_of([] { render::Scratch("/var/tmp/nowhere", 0); }),
            "/var/tmp/nowhere: cannot hold the scratch files of a render: No such file or "
            "directory; name a folder on a local disk with --scratch");
  EXPECT_THAT(error_of([] { render::Scratch("/dev/shm", 0); }),
              HasSubstr("it lies in the computer's memory; name a folder"));
  EXPECT_THAT(error_of([] { scratch()->take(std::size_t{1} << 60); }),
              HasSubstr("/var/tmp: cannot hold the scratch files of a render: it has no room for"));
}

struct Shown {
  Plate alone, among;
  render::Layers layers, of_frame;
};

Shown shown_on(const std::shared_ptr<render::Device>& device, const BoxAboveFloor& stage) {
  SetRenderer renderer(stage.view, {}, set::LightSampling::importance, device);
  std::vector<render::KeptFramePtr> frames;
  Shown shown;
  for (int i = 0; i < 3; ++i) {
    renderer.begin({gray_plate(), 0.5, look_at({0.02 * i, -2, 1.4}, {0, 0, 0}),
                    static_cast<std::uint32_t>(i)});
    renderer.render(2);
    frames.push_back(renderer.keep());
  }
  shown.of_frame = renderer.layers();
  shown.alone = renderer.show(true);
  shown.among = renderer.show_among(frames, true, &shown.layers);
  return shown;
}

TEST(Scratch, MakesThePicturesOfMemory) {
  const BoxAboveFloor stage;
  render::DeviceOptions options;
  options.validation = true;
  const auto device = render::open_device(options);
  const Shown in_memory = shown_on(device, stage);
  render::use_scratch(*device, scratch());
  EXPECT_EQ(render::memory_of(*device).in_scratch, !render::is_gpu(*device));
  const Shown in_files = shown_on(device, stage);
  EXPECT_EQ(in_files.alone.samples, in_memory.alone.samples);
  EXPECT_EQ(in_files.among.samples, in_memory.among.samples);
  for (const auto& [a, b] : {std::pair(&in_files.layers, &in_memory.layers),
                             {&in_files.of_frame, &in_memory.of_frame}}) {
    EXPECT_EQ(a->composite, b->composite);
    EXPECT_EQ(a->mixed, b->mixed);
    EXPECT_EQ(a->variance, b->variance);
    EXPECT_EQ(a->mask, b->mask);
  }
  EXPECT_TRUE(in_files.layers.mixed.get_allocator().scratch());
  EXPECT_EQ(render::validation_messages(*device), 0u);
}

// Layers of a frame that is shown among others are those that it had before.
TEST(Scratch, HasTheLayersOfTheFrameItself) {
  const BoxAboveFloor stage;
  const Shown shown = shown_on(shared_device(), stage);
  EXPECT_EQ(shown.layers.mixed, shown.of_frame.mixed);
  EXPECT_EQ(shown.layers.diff, shown.of_frame.diff);
  EXPECT_NE(shown.layers.composite, shown.of_frame.composite);
}

}  // namespace previz::test::scratch_test
