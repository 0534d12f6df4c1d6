// Takes are listed, marked, checked, copied and deleted, and nothing else is.
#include "daemon/tools/post/takes.hpp"

#include "daemon/core/output/take_folders.hpp"
#include "daemon/core/output/take_list.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/tools/post/render_folder.hpp"
#include "daemon/tools/post/render_takes.hpp"
#include "daemon/tools/post/take_copy.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::post::takes_test {

namespace fs = std::filesystem;

class Takes : public testing::Test {
 protected:
  // Two takes as a rig leaves them, each of eight frames.
  Takes() {
    for (const char* name : {"12A_take001", "12A_take002"}) add(name);
  }

  void add(const std::string& name) {
    const test::TemporaryDirectory made;
    test::write_small_take(made.path());
    fs::create_directories(folder_);
    fs::copy(made / "session", folder_ / name, fs::copy_options::recursive);
    session::change_take(folder_ / name, [](session::TakeInfo& take) {
      take.slate = "12A";
      take.timecode = "14:03:27:12";
    });
  }

  std::string listed() {
    std::ostringstream out;
    list_takes({folder_}, out);
    return out.str();
  }

  // Each returns the words by which takes are refused.
  std::string refused_mark(const Paths& takes) {
    return test::error_of([&] { mark_takes(takes, true, out_); });
  }
  std::string refused_delete(const Paths& takes, bool also_good = false) {
    return test::error_of([&] { delete_takes(takes, also_good, out_); });
  }
  std::string refused_copy(const Paths& takes, const fs::path& folder) {
    return test::error_of([&] { copy_takes({takes, folder}, out_, {}); });
  }
  std::string refused_repair(const Paths& takes, const fs::path& folder) {
    return test::error_of([&] { repair_takes({takes, folder}, out_, {}); });
  }

  // Exit status, and what is said.
  std::pair<int, std::string> checked(const Paths& takes) {
    std::ostringstream out;
    const int status = check_takes(takes, out, {});
    return {status, out.str()};
  }
  static bool fits_its_checksums(const fs::path& copy) {
    const std::string command =
        "cd '" + copy.string() + "' && sha256sum --check --status --strict ";
    return std::system((command + checksums_name).c_str()) == 0;
  }

  void replace_in_toml(const std::string& take, const std::string& from, const std::string& to) {
    const fs::path toml = folder_ / take / "session.toml";
    std::string text = test::content_of(toml);
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    session::replace_file(toml, text.replace(at, from.size(), to));
  }

  test::TemporaryDirectory directory_;
  const fs::path folder_ = directory_ / "takes", one_ = folder_ / "12A_take001",
                 two_ = folder_ / "12A_take002";
  std::ostringstream out_;
};

TEST_F(Takes, AreListedWithWhatTheyAreAndLack) {
  mark_takes({two_}, true, out_);
  replace_in_toml("12A_take001", "closed = true", "closed = false");
  fs::create_directories(folder_ / "12A_take010");
  std::ofstream(folder_ / "12A_take010/session.toml") << "format_version = 7\n";
  fs::create_directories(folder_ / "notes");
  const std::string text = listed();
  EXPECT_THAT(text, HasSubstr("12A_take001        0:00.3  8"));
  EXPECT_THAT(text, HasSubstr("cut off"));
  EXPECT_THAT(text, HasSubstr("12A_take002  good  0:00.3  8       14:03:27:12"));
  EXPECT_THAT(text, HasSubstr("format_version"));
  EXPECT_THAT(text, Not(HasSubstr("notes")));
  EXPECT_LT(text.find("take002"), text.find("take010"));
}

TEST_F(Takes, ARenderIsCounted) {
  fs::create_directories(two_ / "out");
  std::ofstream(two_ / "out/frames.jsonl") << "{}\n{}\n{}\n";
  EXPECT_EQ(rendered_frames(output::listed_take(two_)), 3u);
  EXPECT_EQ(rendered_frames(output::listed_take(one_)), 0u);
}

TEST_F(Takes, HaveARenderFolderEach) {
  EXPECT_EQ(render_folder(one_, true, one_ / "out"), one_ / "out");
  EXPECT_EQ(render_folder(one_, true, "/renders"), "/renders/12A_take001");
  EXPECT_EQ(render_folder(one_ / "", true, "/renders"), "/renders/12A_take001");
  EXPECT_EQ(render_folder(one_, false, "/renders"), "/renders");  // imported
}

TEST_F(Takes, AreMarkedAllOrNone) {
  mark_takes({one_, two_}, true, out_);
  EXPECT_TRUE(session::summary_of(one_).info.take->good);
  mark_takes({one_}, false, out_);
  EXPECT_FALSE(session::summary_of(one_).info.take->good);
  EXPECT_EQ(session::summary_of(one_).info.take->timecode, "14:03:27:12");
  EXPECT_THAT(refused_mark({one_, folder_}),
              HasSubstr("is a folder of takes; give the takes in it"));
  EXPECT_FALSE(session::summary_of(one_).info.take->good);
  EXPECT_THAT(refused_mark({folder_ / "12A_take003"}), HasSubstr("not found"));
}

TEST_F(Takes, ThatAreRecordedAreLeftAlone) {
  replace_in_toml("12A_take001", "closed = true", "closed = false");
  output::TakeFolders::keep_wish(one_);
  EXPECT_THAT(listed(), HasSubstr("being recorded"));
  for (const std::string& said : {refused_mark({one_}), refused_delete({two_, one_}, true),
                                  refused_copy({one_}, directory_ / "disk")})
    EXPECT_THAT(said, HasSubstr("12A_take001: is being recorded; end the take first"));
  EXPECT_TRUE(fs::exists(two_ / "session.toml"));
}

TEST_F(Takes, DamageIsFoundAndNamed) {
  EXPECT_EQ(check_takes({one_, two_}, out_, {}), 0);
  EXPECT_THAT(out_.str(), HasSubstr("12A_take001: whole, 8 frames"));
  fs::resize_file(one_ / "observer.mkv", fs::file_size(one_ / "observer.mkv") / 2);
  const auto [status, said] = checked({one_, two_});
  EXPECT_EQ(status, 1);
  EXPECT_THAT(said, AllOf(HasSubstr("12A_take001: observer"), HasSubstr("12A_take002: whole")));
}

// A script can tell a slow disk of that day from a take that has lost something since.
TEST_F(Takes, WhatWasLostWhileRecordingIsNoDamage) {
  replace_in_toml("12A_take001", "closed = true", "closed = true\nlost_frames = 3");
  const auto [status, said] = checked({one_, two_});
  EXPECT_EQ(status, 3);
  EXPECT_THAT(said,
              AllOf(HasSubstr("12A_take001: session.toml: 3 camera frames did not reach the disk"),
                    HasSubstr("12A_take001: incomplete since it was recorded, and not "
                              "damaged, 8 frames"),
                    HasSubstr("12A_take002: whole")));
  EXPECT_EQ(repair_takes({{one_}, directory_ / "repaired"}, out_, {}), 0);
  EXPECT_THAT(out_.str(), HasSubstr("12A_take001: nothing to repair"));
  EXPECT_EQ(copy_takes({{one_}, directory_ / "disk"}, out_, {}), 0);
  EXPECT_THAT(out_.str(), Not(HasSubstr("is damaged")));
  fs::resize_file(two_ / "observer.mkv", fs::file_size(two_ / "observer.mkv") / 2);
  EXPECT_EQ(checked({one_, two_}).first, 1);
}

TEST_F(Takes, AreCopiedWithChecksums) {
  std::ofstream(one_ / "notes.txt") << "not the take's\n";
  const fs::path disk = directory_ / "disk/day 1", copy = disk / "12A_take001";
  copy_takes({{one_ / "", two_}, disk}, out_, {});
  EXPECT_THAT(out_.str(), HasSubstr(copy.string() + ": "));
  EXPECT_EQ(session::own_files(copy), session::own_files(one_));
  EXPECT_FALSE(fs::exists(copy / "notes.txt"));
  for (const fs::path& file : session::own_files(one_))
    EXPECT_EQ(test::content_of(copy / file), test::content_of(one_ / file)) << file;
  EXPECT_TRUE(fits_its_checksums(copy));
  EXPECT_EQ(check_takes({copy}, out_, {}), 0);
  // Nothing but the takes is in the folder.
  EXPECT_EQ(std::distance(fs::directory_iterator(disk), {}), 2);
}

// As sha256sum(1) writes such a name, so that one file is one line.
TEST_F(Takes, AreCopiedWithChecksumsOfNamesThatHaveTheEndOfALine) {
  const std::string name = "assets/" + std::string(64, 'b') + ".g\nl\\b";
  fs::create_directories(one_ / "assets");
  std::ofstream(one_ / name) << "an asset";
  const fs::path disk = directory_ / "disk", copy = disk / "12A_take001";
  copy_takes({{one_}, disk}, out_, {});
  EXPECT_EQ(test::content_of(copy / name), "an asset");
  EXPECT_EQ(check_takes({copy}, out_, {}), 0) << out_.str();
  EXPECT_TRUE(fits_its_checksums(copy));
}

TEST_F(Takes, WhoseChecksumsAreALinkToThemselvesAreNamed) {
  fs::create_symlink(checksums_name, one_ / checksums_name);
  const auto [status, said] = checked({one_});
  EXPECT_EQ(status, 1);
  EXPECT_THAT(said, HasSubstr(std::string(checksums_name) + ": is a link"));
  EXPECT_THAT(refused_mark({one_}), HasSubstr("is a link"));
}

TEST_F(Takes, AreCopiedOnce) {
  const fs::path disk = directory_ / "disk";
  copy_takes({{one_}, disk}, out_, {});
  copy_takes({{one_, two_}, disk}, out_, {});
  EXPECT_THAT(out_.str(), HasSubstr("12A_take001: already copied"));
  // Another take of the name is not replaced, and neither is one that was marked meanwhile.
  mark_takes({two_}, true, out_);
  EXPECT_THAT(refused_copy({two_}, disk), HasSubstr("is not a current copy of this take"));
  EXPECT_THAT(refused_copy({one_}, folder_), HasSubstr("is inside the take"));
}

TEST_F(Takes, AStoppedCopyLeavesNothing) {
  std::stop_source stop;
  stop.request_stop();
  const fs::path disk = directory_ / "disk";
  EXPECT_THROW(copy_takes({{one_}, disk}, out_, stop.get_token()), Error);
  EXPECT_TRUE(fs::is_empty(disk));
}

TEST_F(Takes, ADamagedCopyIsFound) {
  const fs::path disk = directory_ / "disk", copy = disk / "12A_take001";
  copy_takes({{one_}, disk}, out_, {});
  std::ofstream(copy / "events.jsonl", std::ios::app) << "{}\n";
  std::ofstream(copy / "track.jsonl", std::ios::app) << "\n";
  const auto [status, said] = checked({copy});
  EXPECT_EQ(status, 1);
  EXPECT_THAT(said, HasSubstr("track.jsonl: was changed since it was copied; copy the take"));
}

// A frame that was damaged on the rig's disk: the copy is the same, byte for byte, and as damaged.
TEST_F(Takes, ADamagedTakeIsCopiedAsItIsAndSaid) {
  const fs::path film = one_ / "observer.mkv";
  ASSERT_TRUE(fs::exists(film));
  {
    std::fstream file(film, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(fs::file_size(film) / 2));
    file << "XXXXXXXXXXXXXXXX";
  }
  std::ostringstream out;
  EXPECT_EQ(copy_takes({{one_}, directory_ / "disk"}, out, {}), 1);
  EXPECT_THAT(out.str(), HasSubstr("checked"));
  EXPECT_THAT(out.str(), HasSubstr("the take itself is damaged, not by copying: observer.mkv"));
  EXPECT_EQ(copy_takes({{two_}, directory_ / "disk"}, out, {}), 0);
}

TEST_F(Takes, ADamagedTakeIsRepairedIntoANewOne) {
  const fs::path film = one_ / "observer.mkv", disk = directory_ / "disk/repaired";
  const std::string before = test::content_of(film);
  std::string damaged = before;
  damaged[damaged.size() / 2] ^= 0x10;
  session::replace_file(film, damaged);
  EXPECT_EQ(repair_takes({{one_, two_}, disk}, out_, {}), 1);
  EXPECT_THAT(out_.str(), HasSubstr("12A_take001: repaired, 7 frames; what is lost is in its"));
  EXPECT_THAT(out_.str(), HasSubstr("12A_take002: nothing to repair"));
  EXPECT_EQ(test::content_of(film), damaged);
  EXPECT_FALSE(fs::exists(disk / "12A_take002"));
  const auto [status, said] = checked({disk / "12A_take001"});
  EXPECT_EQ(status, 1);
  EXPECT_THAT(said, HasSubstr("repaired from 12A_take001, which was damaged: observer.mkv"));
  EXPECT_EQ(std::ranges::count(said, '\n'), 1);  // nothing else is wrong with it
  EXPECT_THAT(refused_repair({one_}, disk),
              HasSubstr("12A_take001: already exists; repair into another folder"));
  EXPECT_THAT(refused_repair({one_}, folder_), HasSubstr("already exists"));

  damaged = before;
  damaged[0] = 0;
  session::replace_file(film, damaged);
  EXPECT_EQ(repair_takes({{one_}, disk / "again"}, out_, {}), 0);
  EXPECT_THAT(out_.str(), HasSubstr("repaired, 8 frames, nothing is lost"));
  EXPECT_EQ(check_takes({disk / "again/12A_take001"}, out_, {}), 0);
}

TEST_F(Takes, AMarkIsNoDamageToACopy) {
  const fs::path disk = directory_ / "disk", copy = disk / "12A_take001";
  copy_takes({{one_}, disk}, out_, {});
  mark_takes({copy}, true, out_);
  EXPECT_EQ(check_takes({copy}, out_, {}), 0);
}

TEST_F(Takes, AreDeletedAndNothingElse) {
  fs::create_directories(one_ / "out");
  std::ofstream(one_ / "out/0000.exr") << "a render";
  std::ofstream(two_ / "assets/more.txt") << "put there by somebody";
  fs::create_directory_symlink(directory_ / "elsewhere", two_ / "linked");
  add("12A_take003");
  delete_takes({one_}, false, out_);
  EXPECT_TRUE(fs::exists(one_ / "out/0000.exr"));
  EXPECT_FALSE(fs::exists(one_ / "session.toml"));
  EXPECT_FALSE(fs::exists(one_ / "observer.mkv"));
  EXPECT_FALSE(fs::exists(one_ / "assets"));
  EXPECT_THAT(out_.str(), HasSubstr("not part of the take: out"));
  delete_takes({folder_ / "12A_take003"}, false, out_);
  EXPECT_FALSE(fs::exists(folder_ / "12A_take003"));
  EXPECT_TRUE(fs::exists(two_ / "session.toml"));
  delete_takes({two_}, false, out_);
  EXPECT_TRUE(fs::exists(two_ / "assets/more.txt"));
  EXPECT_TRUE(fs::is_symlink(two_ / "linked"));
  EXPECT_TRUE(session::own_files(two_).empty());
}

TEST_F(Takes, AGoodTakeIsNotDeletedUnasked) {
  mark_takes({two_}, true, out_);
  EXPECT_THAT(refused_delete({one_, two_}), HasSubstr("12A_take002: is marked good; add --good"));
  EXPECT_TRUE(fs::exists(one_ / "session.toml"));
  delete_takes({two_}, true, out_);
  EXPECT_FALSE(fs::exists(two_));
}

TEST_F(Takes, ALinkIsNotFollowedToBeDeleted) {
  fs::create_directory_symlink(one_, folder_ / "best");
  EXPECT_THAT(refused_delete({folder_ / "best"}), HasSubstr("is a link to " + one_.string()));
  fs::create_directories(directory_ / "shared");
  std::ofstream(directory_ / "shared/model.glb") << "of others";
  fs::remove_all(one_ / "assets");
  fs::create_directory_symlink(directory_ / "shared", one_ / "assets");
  delete_takes({one_}, false, out_);
  EXPECT_TRUE(fs::exists(directory_ / "shared/model.glb"));
}

TEST_F(Takes, AFolderOrASetFileNamesThem) {
  const test::TemporaryDirectory stage;
  test::write_small_take(stage.path(), true,
                         "[recording]\ndirectory = \"" + folder_.string() + "\"\n");
  list_takes({stage / "set.toml"}, out_);
  EXPECT_THAT(out_.str(), HasSubstr("12A_take002"));
  EXPECT_THAT(test::error_of([&] { list_takes({directory_ / "nowhere"}, out_); }),
              HasSubstr("not found; give a folder of takes"));
}

TEST_F(Takes, NoTakeOfThatKindIsSaid) {
  RenderOptions options;
  options.session = folder_;
  EXPECT_THAT(test::error_of([&] { render_takes(options, WhichTakes::good, out_); }),
              HasSubstr("no take in it is marked good; `previz takes mark TAKE`"));
  options.session = directory_ / "nowhere";
  EXPECT_THAT(test::error_of([&] { render_takes(options, WhichTakes::all, out_); }),
              HasSubstr("contains no takes"));
}

TEST_F(Takes, GoodOnesAreRenderedIntoAFolderEach) {
  mark_takes({two_}, true, out_);
  add("12A_take003");
  mark_takes({folder_ / "12A_take003"}, true, out_);
  std::ofstream(folder_ / "12A_take003/session.toml", std::ios::app) << "\n[nonsense\n";
  RenderOptions options;
  options.session = folder_;
  options.samples = 1;
  options.frames = FrameRange{1, 1};
  options.exr = options.video = false;
  options.directory = directory_ / "renders";
  const TakesReport report = render_takes(options, WhichTakes::good, out_);
  ASSERT_EQ(report.rendered.size(), 1u);
  EXPECT_EQ(report.rendered[0].directory, directory_ / "renders/12A_take002");
  EXPECT_TRUE(fs::exists(directory_ / "renders/12A_take002/0001.png"));
  EXPECT_FALSE(fs::exists(directory_ / "renders/12A_take001"));
}

}  // namespace previz::post::takes_test
