// What keeps a machine from a task is found before its first frame, and said in one line.
#include "daemon/tools/farm/machine.hpp"

#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::farm::machine_test {

class MachineTest : public testing::Test {
 protected:
  MachineTest() {
    session::write_content(directory_ / "take/session.toml", "");
    std::filesystem::create_directories(directory_ / "job/state");
    job_.software = "previzd 1.2";
    JobTake take;
    take.session = directory_ / "take";
    take.pictures = directory_ / "out";
    take.frame_bytes = 100'000'000;
    job_.takes.push_back(take);
    machine_ = this_machine();
    machine_.host = "node2";
    machine_.software = "previzd 1.2";
    machine_.free_bytes = [](const auto&) { return std::uint64_t{200'000'000}; };
  }
  std::string why() {
    return why_not_here(JobFolder(directory_ / "job"), job_, job_.takes[0], machine_);
  }
  test::TemporaryDirectory directory_;
  Job job_;
  Machine machine_;
};

TEST_F(MachineTest, ThatHasAllMayRender) {
  EXPECT_EQ(why(), "");
}

TEST_F(MachineTest, OfAnotherVersionMayNot) {
  machine_.software = "previzd 1.1";
  EXPECT_EQ(why(),
            "previzd 1.1 is installed here, and the job was made with previzd 1.2, whose pictures "
            "may differ; install that one");
}

TEST_F(MachineTest, WithoutTheTakesDiskMayNot) {
  std::filesystem::remove_all(directory_ / "take");
  EXPECT_THAT(why(), HasSubstr("take: the take is not found; mount its disk"));
}

TEST_F(MachineTest, WithoutRoomForAFrameMayNot) {
  machine_.free_bytes = [](const auto&) { return std::uint64_t{99'999'999}; };
  EXPECT_THAT(why(), HasSubstr("100 MB are free, and a frame may need 100 MB; make room"));
  machine_.free_bytes = [](const auto&) -> std::uint64_t { throw Error("disk: stale handle"); };
  EXPECT_EQ(why(), "disk: stale handle");
}

TEST_F(MachineTest, WhoseClockIsOffMayNot) {
  const std::int64_t now = machine_.now_s();
  machine_.now_s = [&] { return now + 3600; };
  EXPECT_THAT(why(), AllOf(HasSubstr("the clock here is 36"), HasSubstr("s ahead of that of the")));
  machine_.now_s = [&] { return now - 3600; };
  EXPECT_THAT(why(), HasSubstr("s behind that of the job's disk; set it (timedatectl)"));
  machine_.now_s = [&] { return now + 30; };
  EXPECT_EQ(why(), "");
}

TEST_F(MachineTest, WithoutTheKindOfDeviceMayNot) {
  job_.on_gpu = true;
  const render::DeviceOptions cpu{.name = "llvmpipe"};
  machine_.open_device = [&](const auto&) { return render::open_device(cpu); };
  EXPECT_THAT(test::error_of([&] { open_wanted_device(job_, job_.takes[0], machine_); }),
              HasSubstr("the job is rendered on graphics cards, and there is none here"));
  job_.any_device = true;
  EXPECT_NE(open_wanted_device(job_, job_.takes[0], machine_), nullptr);
}

// A set that wants its rays traced without the card's units has the same pictures on a farm.
TEST_F(MachineTest, TracesRaysAsTheSetSays) {
  std::optional<bool> hardware;
  machine_.open_device = [&](const render::DeviceOptions& options) {
    hardware = options.hardware_rays;
    return render::open_device(options);
  };
  job_.any_device = true;
  job_.takes[0].hardware_rays = false;
  open_wanted_device(job_, job_.takes[0], machine_);
  EXPECT_EQ(hardware, false);
}

}  // namespace previz::farm::machine_test
