// Losses of a graphics device that is made up, without a rig.
#include "daemon/core/live/gpu_keeper.hpp"

#include "tests/support/test.hpp"

namespace previz::live::gpu_keeper_test {

class GpuKeeperTest : public testing::Test {
 protected:
  GpuKeeper keeper() {
    GpuKeeper::Gpu gpu;
    gpu.is_open = [this] { return open_; };
    gpu.open = [this] {
      calls_ += "open ";
      if (stops_) stop_.request_stop();
      if (refusals_ == 0) {
        open_ = true;
        return;
      }
      --refusals_;
      throw Error("no device fits");
    };
    gpu.name = [] { return std::string("a GPU"); };
    gpu.stands_in = [this] { return stands_in_; };
    gpu.build = [this] { calls_ += "build "; };
    gpu.drop = [this] { calls_ += "drop "; };
    const auto meanwhile = [this](std::chrono::milliseconds time) {
      waits_.push_back(time.count());
    };
    return {std::move(gpu), {reports_, metrics_, stop_.get_token(), meanwhile}};
  }
  std::uint64_t count_of(const std::string& event) const {
    const auto counts = metrics_.snapshot(1).counts;
    return counts.contains(event) ? counts.at(event) : 0;
  }

  bool open_ = true, stops_ = false, stands_in_ = false;
  int refusals_ = 0;
  std::vector<long> waits_;  // ms
  std::string calls_;
  std::ostringstream log_;
  report::Reports reports_{report::lines_to(log_)};
  pipeline::Metrics metrics_;
  std::stop_source stop_;
};

TEST_F(GpuKeeperTest, StartsOnADeviceThatIsOpen) {
  keeper().start();
  EXPECT_EQ(calls_, "build ");
  open_ = false;  // it was lost while another set ran
  keeper().start();
  EXPECT_EQ(calls_, "build open build ");
  EXPECT_EQ(log_.str(), "");
}

TEST_F(GpuKeeperTest, ALossIsReportedShownAndCountedUntilTheDeviceIsOpenAgain) {
  refusals_ = 2;
  EXPECT_TRUE(keeper().renew(render::DeviceLost("render: device lost")));
  EXPECT_EQ(calls_, "drop open drop open drop open build ");
  EXPECT_EQ(log_.str(),
            "render: device lost; reopening it\nno device fits\nrendering again, on a GPU\n");
  EXPECT_EQ(count_of("device lost"), 1u);
  EXPECT_EQ(count_of("device reopened"), 1u);
  ASSERT_EQ(reports_.troubles().size(), 1u);  // long enough to be read
  EXPECT_EQ(line_of(reports_.troubles()[0]), "graphics card: is lost; reopening it");
  EXPECT_FALSE(reports_.troubles()[0].lasts);
}

// A GPU that is being reset is back within seconds, one that is gone should cost little.
TEST_F(GpuKeeperTest, TheTimeBetweenAttemptsGrows) {
  refusals_ = 7;
  EXPECT_TRUE(keeper().renew(render::DeviceLost("render: device lost")));
  EXPECT_THAT(waits_, testing::ElementsAre(500, 1000, 2000, 4000, 8000, 8000, 8000));
}

TEST_F(GpuKeeperTest, WithoutADeviceTheSetStartsAndTheRenderThreadWaitsForIt) {
  open_ = false;
  refusals_ = 2;
  GpuKeeper keeper = this->keeper();
  keeper.start();
  EXPECT_EQ(calls_, "open drop ");
  EXPECT_TRUE(reports_.troubles().at(0).lasts);
  EXPECT_TRUE(keeper.await());
  EXPECT_EQ(calls_, "open drop open drop open build ");
  EXPECT_TRUE(keeper.await());
  EXPECT_EQ(calls_, "open drop open drop open build ");
  EXPECT_EQ(count_of("device lost"), count_of("device reopened"));
}

// After a loss, in the set that comes next, and where the CPU stands in from the start.
TEST_F(GpuKeeperTest, ThatTheCpuStandsInStaysOnTheDisplay) {
  const auto expect_shown = [&] {
    ASSERT_EQ(reports_.troubles().size(), 1u);
    EXPECT_TRUE(reports_.troubles()[0].lasts);
    EXPECT_EQ(line_of(reports_.troubles()[0]),
              "graphics card: is gone; rendering on the CPU, slowly");
  };
  stands_in_ = true;
  keeper().start();
  expect_shown();
  EXPECT_TRUE(keeper().renew(render::DeviceLost("render: device lost")));
  expect_shown();
  stands_in_ = false;
  keeper().start();
  EXPECT_FALSE(reports_.troubles().at(0).lasts);
}

TEST_F(GpuKeeperTest, AStopEndsTheAttempts) {
  refusals_ = 1000;
  stops_ = true;
  EXPECT_FALSE(keeper().renew(render::DeviceLost("render: device lost")));
  EXPECT_EQ(calls_, "drop open drop ");
  EXPECT_EQ(count_of("device reopened"), 0u);
  EXPECT_TRUE(reports_.troubles().at(0).lasts);
}

}  // namespace previz::live::gpu_keeper_test
