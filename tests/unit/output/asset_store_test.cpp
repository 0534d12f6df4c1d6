// The files that takes need: kept once, as they were when the set was loaded, and linked into
// takes.
#include "daemon/core/output/asset_store.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/core/session/files.hpp"
#include "drivers/descriptor.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/recorder_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::output::asset_store_test {

using session::TemporaryDirectory;
using session::write_content;
using test::wait_until;

const auto no_note = [](const std::string& what) { ADD_FAILURE() << what; };

std::vector<std::string> names_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    names.push_back(entry.path().filename().string());
  return names;
}

AssetStore::Delivered deliver(AssetStore& store, const std::filesystem::path& take) {
  const auto order = store.deliver(take);
  EXPECT_TRUE(wait_until("it is delivered", [&] { return order->result().has_value(); }));
  return order->result().value_or(AssetStore::Delivered{});
}

TEST(AssetStore, KeepsEachContentOnceUnderItsHash) {
  const TemporaryDirectory directory;
  write_content(directory / "a.glb", "a model");
  write_content(directory / "same.glb", "a model");
  AssetStore store(directory / "store",
                   {{"a.glb", directory / "a.glb"}, {"same.glb", directory / "same.glb"}}, no_note);
  const AssetStore::Delivered delivered = deliver(store, directory / "take");
  const std::string name = session::sha256_of(directory / "a.glb") + ".glb";
  EXPECT_EQ(delivered.assets, (std::map<std::string, std::string>{{"a.glb", "assets/" + name},
                                                                  {"same.glb", "assets/" + name}}));
  EXPECT_TRUE(delivered.missing.empty());
  EXPECT_EQ(test::content_of(directory / "take/assets" / name), "a model");
  EXPECT_EQ(names_in(directory / "store"), std::vector<std::string>{name});
}

TEST(AssetStore, NamesWhatCannotBeKeptAndKeepsTheRest) {
  const TemporaryDirectory directory;
  write_content(directory / "b.glb", "another");
  std::vector<std::string> notes;
  AssetStore store(directory / "store",
                   {{"a.glb", directory / "none.glb"}, {"b.glb", directory / "b.glb"}},
                   [&](const std::string& what) { notes.push_back(what); });
  const AssetStore::Delivered delivered = deliver(store, directory / "take");
  EXPECT_EQ(delivered.assets.size(), 1u);
  EXPECT_TRUE(delivered.assets.contains("b.glb"));
  ASSERT_EQ(delivered.missing.size(), 1u);
  EXPECT_EQ(delivered.missing[0].as_written, "a.glb");
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_TRUE(notes[0].starts_with("a.glb will be missing from takes: ")) << notes[0];
}

TEST(AssetStore, RemovesWhatNoTakeAndNoSetNeeds) {
  const TemporaryDirectory directory;
  std::filesystem::create_directories(directory / "store");
  write_content(directory / "store/old.glb", "of a set from before");
  write_content(directory / "store/taken.glb", "of a take");
  std::filesystem::create_hard_link(directory / "store/taken.glb", directory / "in_a_take.glb");
  AssetStore store(directory / "store", {}, no_note);
  deliver(store, directory / "take");
  EXPECT_EQ(names_in(directory / "store"), std::vector<std::string>{"taken.glb"});
}

// A take has what was there when the set was loaded, without a copy.
TEST(Recorder, LinksTheAssetsIntoEachTakeAsTheyWereWhenTheSetWasLoaded) {
  const TemporaryDirectory directory;
  write_content(directory / "a.glb", "a model");
  RecorderOptions options = recorder_options({directory / "takes"});
  options.take.assets = {{"models/a.glb", directory / "a.glb"}};
  options.reserve_bytes = 0;
  {
    Recorder recorder(std::move(options));
    ASSERT_TRUE(wait_until("the asset is kept", [&] {
      return std::filesystem::exists(directory / "takes/.assets") &&
             !std::filesystem::is_empty(directory / "takes/.assets") &&
             !names_in(directory / "takes/.assets").front().starts_with(".");
    }));
    write_content(directory / "a.glb", "changed since");
    for (std::uint64_t take = 1; take <= 2; ++take) {
      record_take(recorder, take);
      ASSERT_TRUE(wait_for_finished(recorder, take));
    }
  }
  for (const char* take : {"12A_take001", "12A_take002"}) {
    const session::Session session = session::open_session(directory / "takes" / take);
    EXPECT_TRUE(session.missing.empty()) << session.missing.front();
    const std::filesystem::path file = session.directory / session.info.assets.at("models/a.glb");
    EXPECT_EQ(test::content_of(file), "a model");
    EXPECT_EQ(std::filesystem::hard_link_count(file), 3u);
  }
}

// A model of which the store still waits: the take begins without it, and has it when it ends.
TEST(Recorder, DoesNotWaitForAnAssetThatIsStillBeingRead) {
  const TemporaryDirectory directory;
  const std::filesystem::path pipe = directory / "slow.glb";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  RecorderOptions options = recorder_options({directory / "takes"});
  options.take.assets = {{"slow.glb", pipe}};
  options.reserve_bytes = 0;
  {
    Recorder recorder(std::move(options));
    ASSERT_TRUE(begin_take(recorder));
    // The store reads the pipe to its end, and then finds a file in its place.
    {
      const OwnedDescriptor into(::open(pipe.c_str(), O_WRONLY | O_CLOEXEC));
      std::filesystem::remove(pipe);
      write_content(pipe, "a model");
      ASSERT_EQ(::write(into.get(), "a model", 7), 7);
    }
    recorder.stop();
    ASSERT_TRUE(wait_for_finished(recorder, 1));
  }
  const session::Session session = session::open_session(directory / "takes/12A_take001");
  EXPECT_EQ(test::content_of(session.directory / session.info.assets.at("slow.glb")), "a model");
}

}  // namespace previz::output::asset_store_test
