// Files that are whole or not there, on disks that lose power and that fail.
#include "daemon/core/output/exr.hpp"
#include "daemon/core/output/png.hpp"
#include "daemon/core/output/video.hpp"
#include "daemon/core/render/picture/composite.hpp"
#include "daemon/core/session/draft.hpp"
#include "drivers/plate.hpp"
#include "tests/durability/faulty_rounds.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::test::file_power_test {

using session::content_of;
using session::TemporaryDirectory;

constexpr int width = 24, height = 16;

Plate picture(int seed) {
  Plate plate{width, height, 16, {}};
  std::mt19937 random(static_cast<std::uint32_t>(seed));
  for (int i = 0; i < 3 * width * height; ++i)
    plate.samples.push_back(static_cast<std::uint16_t>(random()));
  return plate;
}

// A way to write a file.
struct Kind {
  const char* name;
  std::function<void(const std::filesystem::path& folder)> write;
  const char* file;  // its name
  bool replaces;     // it was there before, with `before` in it
};
constexpr char before[] = "as it was";

std::vector<Kind> kinds() {
  return {
      {"PNG", [](const auto& folder) { output::write_png(folder / "a.png", picture(1)); }, "a.png",
       false},
      {"EXR",
       [](const auto& folder) {
         const render::Layers layers = render::make_layers(width, height, 1);
         output::write_exr(folder / "a.exr", layers, {});
       },
       "a.exr", false},
      {"video",
       [](const auto& folder) {
         output::VideoWriter video(folder / "a", width, height, output::review_codecs().front());
         for (int i = 0; i < 3; ++i) video.write(picture(i), i * 40'000'000);
         video.close();
       },
       "a.mp4", false},
      {"text",
       [](const auto& folder) {
         session::replace_file(folder / "set.toml", std::string(5000, 'x'));
       },
       "set.toml", true},
  };
}

// A file as it is found after some writing that perhaps failed.
struct Found {
  bool is_whole = false, is_as_before = false;
};
Found found_in(const std::filesystem::path& folder, const Kind& kind, const std::string& whole) {
  const bool exists = std::filesystem::exists(folder / kind.file);
  const std::string content = exists ? content_of(folder / kind.file) : "";
  return {content == whole, kind.replaces ? content == before : !exists};
}

// Everybody who looks finds the whole file, or what was there before.
TEST(Files, AreWholeOrNotThereAfterAPowerCut) {
  for (const Kind& kind : kinds()) {
    const TemporaryDirectory folder, elsewhere;
    FaultyDisk disk(folder.path());
    if (kind.replaces) session::replace_file(folder / kind.file, before);
    const std::size_t begun = disk.calls();
    kind.write(folder.path());
    const std::string whole = content_of(folder / kind.file);
    SCOPED_TRACE(kind.name);
    for_each_power_cut(disk, begun, elsewhere / "after", [&](std::size_t cut) {
      const Found found = found_in(elsewhere / "after", kind, whole);
      EXPECT_TRUE(found.is_whole || found.is_as_before);
      EXPECT_TRUE(found.is_whole || cut < disk.calls()) << "it was said to be written";
    });
  }
}

class EveryCallOfAFile : public EveryFault {};
INSTANTIATE_TEST_SUITE_P(Fails, EveryCallOfAFile,
                         ::testing::Values(DiskFault::io_error, DiskFault::no_space,
                                           DiskFault::short_write));

TEST_P(EveryCallOfAFile, LeavesTheFileWholeOrNotThereAndSaysSo) {
  const TemporaryDirectory elsewhere;
  for (const Kind& kind : kinds()) {
    std::string whole;
    {
      const TemporaryDirectory folder;
      kind.write(folder.path());
      whole = content_of(folder / kind.file);
    }
    const auto put_what_it_replaces = [&](const Round& round) {
      if (kind.replaces) session::replace_file(round.folder / kind.file, before);
    };
    const auto write = [&](Round& round) {
      const std::string fault = error_of([&] { kind.write(round.folder.path()); });
      SCOPED_TRACE(std::string(kind.name) + ", " + round.describe() + ", " + fault);
      const Found found = found_in(round.folder.path(), kind, whole);
      EXPECT_TRUE(found.is_whole || found.is_as_before);
      EXPECT_TRUE(found.is_whole || !fault.empty()) << "it was said to be written";
      // What a failed sync was to keep may be lost from the medium.
      if (!fault.empty()) {
        EXPECT_THAT(fault, HasSubstr(round.folder.path().string())) << "the error names no file";
        return;
      }
      for (const AfterPowerCut kept : power_cuts) {
        round.disk.restore(round.disk.calls(), kept, elsewhere / "after");
        EXPECT_TRUE(found_in(elsewhere / "after", kind, whole).is_whole)
            << "it was said to be written; kept " << static_cast<int>(kept);
      }
    };
    for_each_call(write, put_what_it_replaces);
  }
}

// What another file replaces a second later makes no disk wait, and still is whole or as before.
TEST(Files, OfASecondAreNotSynced) {
  const TemporaryDirectory directory;
  const auto syncs_of = [&](const char* folder, session::Sync sync) {
    std::filesystem::create_directory(directory / folder);
    const FaultyDisk disk(directory / folder);
    output::write_png(directory / folder / "a.png", picture(1), sync);
    int syncs = 0;
    for (std::size_t call = 0; call < disk.calls(); ++call)
      syncs += disk.describe(call).find("sync") != std::string::npos ? 1 : 0;
    EXPECT_GT(disk.calls(), 2u);
    return syncs;
  };
  EXPECT_EQ(syncs_of("briefly", session::Sync::no), 0);
  EXPECT_EQ(syncs_of("for_good", session::Sync::yes), 2);  // the file and its name
  EXPECT_EQ(output::read_png(directory / "briefly/a.png").samples, picture(1).samples);
}

}  // namespace previz::test::file_power_test
