#include "daemon/core/session/nominal_rate.hpp"
#include "daemon/core/session/session_toml.hpp"
#include "daemon/core/session/timecode.hpp"
#include "tests/support/test.hpp"

namespace previz::session::session_rate_test {

// Times of `count` frames at a rate, rounded as containers do.
std::vector<std::int64_t> times_at(double fps, int count, std::int64_t resolution_ns = 1) {
  std::vector<std::int64_t> times;
  for (int i = 0; i < count; ++i) {
    const double time = i * 1e9 / fps / static_cast<double>(resolution_ns);
    times.push_back(std::llround(time) * resolution_ns);
  }
  return times;
}

TEST(NominalRate, IsTheStandardOneOfEveryContainersTimes) {
  constexpr double ntsc = 1000.0 / 1001;
  for (const double fps : {12.0, 15.0, 24 * ntsc, 24.0, 25.0, 30 * ntsc, 30.0, 48.0, 50.0,
                           60 * ntsc, 60.0, 120.0, 240.0})
    for (const std::int64_t resolution : {1, 11'111, 1'000'000})
      for (const int count : {500, 5000}) {
        const NominalRate rate = nominal_rate(times_at(fps, count, resolution));
        EXPECT_DOUBLE_EQ(rate.fps, fps) << resolution << " ns, " << count << " frames";
        EXPECT_TRUE(rate.is_standard && !rate.varies && rate.gaps.empty()) << fps;
      }
}

TEST(NominalRate, CountsWhatIsMissing) {
  std::vector<std::int64_t> times = times_at(30, 159);
  times.erase(times.begin() + 53);
  times.erase(times.begin() + 100, times.begin() + 110);
  const NominalRate rate = nominal_rate(times);
  EXPECT_DOUBLE_EQ(rate.fps, 30);
  ASSERT_EQ(rate.gaps.size(), 2u);
  EXPECT_EQ(rate.gaps[0].after, 52u);
  EXPECT_EQ(rate.gaps[0].frames, 1);
  EXPECT_EQ(rate.gaps[1].after, 99u);
  EXPECT_EQ(rate.gaps[1].frames, 10);
  EXPECT_EQ(words_of(rate),
            "30 frames per second; 11 are missing, after frame 52 and after frame 99");
}

TEST(NominalRate, OfACameraIsItsOwnClocks) {
  // 50 millionths fast, with times that jitter by a millisecond.
  std::mt19937 random(1);
  std::uniform_int_distribution<std::int64_t> jitter(-500'000, 500'000);
  std::vector<std::int64_t> times = times_at(25 * (1 + 50e-6), 300);
  for (std::int64_t& time : times) time += jitter(random);
  EXPECT_DOUBLE_EQ(nominal_rate(times).fps, 25);
  const NominalRate odd = nominal_rate(times_at(17.3, 300));
  EXPECT_NEAR(odd.fps, 17.3, 1e-6);
  EXPECT_FALSE(odd.is_standard);
}

// A phone in dim light: half of the frames take half as long again.
TEST(NominalRate, SaysThatItVaries) {
  std::vector<std::int64_t> times{0};
  for (int i = 0; i < 200; ++i)
    times.push_back(times.back() + (i % 3 == 0 ? 50'000'000 : 33'333'333));
  const NominalRate rate = nominal_rate(times);
  EXPECT_TRUE(rate.varies);
  EXPECT_TRUE(rate.gaps.empty());
  EXPECT_DOUBLE_EQ(rate.fps, 30);
}

TEST(NominalRate, OfNoFramesAndOfOneIsAGuess) {
  EXPECT_DOUBLE_EQ(nominal_rate({}).fps, 25);
  EXPECT_DOUBLE_EQ(nominal_rate(std::vector<std::int64_t>{7}).fps, 25);
}

// The largest time that there is, behind frames a nanosecond apart: as many are missing.
TEST(NominalRate, OfAGapAsLongAsTimeItselfIsStillThatOfTheOthers) {
  constexpr std::int64_t latest = std::numeric_limits<std::int64_t>::max();
  const NominalRate rate = nominal_rate(std::vector<std::int64_t>{0, 1, 2, 3, latest});
  ASSERT_EQ(rate.gaps.size(), 1u);
  EXPECT_NEAR(static_cast<double>(rate.gaps[0].frames), 9.22e18, 0.03 * 9.22e18);
}

void expect_fraction(double fps, int frames, int seconds) {
  const RateFraction rate = fraction_of(fps);
  EXPECT_EQ(rate.frames, frames) << fps;
  EXPECT_EQ(rate.seconds, seconds) << fps;
}

TEST(RateFraction, IsThatOfEditors) {
  expect_fraction(25, 25, 1);
  for (const double written : {24000.0 / 1001, 23.976, 23.98})
    expect_fraction(written, 24000, 1001);
  for (const double written : {30000.0 / 1001, 29.97}) expect_fraction(written, 30000, 1001);
  for (const double written : {60000.0 / 1001, 59.94}) expect_fraction(written, 60000, 1001);
  expect_fraction(17.3, 17300, 1000);
}

// A picture every ten minutes or every month, and times that are nanoseconds apart. Numerator and
// denominator are ints: the fraction nearest to a rate r, at least 1 / (2^31 - 1), is within
// max(r, 1) / (2^31 - 1) of it; of 2^31 numbers in double precision.
TEST(RateFraction, IsNearEveryRate) {
  for (const double fps : {1 / 2.6e6, 1 / 600.0, 0.004, 0.5, 0.9985, 3'575'000.3, 1e9, 2e9 + 0.5}) {
    const RateFraction rate = fraction_of(fps);
    ASSERT_GT(rate.frames, 0) << fps;
    ASSERT_GT(rate.seconds, 0) << fps;
    const double error = std::max(fps, 1.0) / 2147483647;
    EXPECT_NEAR(static_cast<double>(rate.frames) / rate.seconds, fps, error) << fps;
  }
  expect_fraction(1e300, 2147483647, 1);
  EXPECT_EQ(fraction_of(1e-300).frames, 1);
  EXPECT_GE(fraction_of(1e-300).seconds, 2147483646);
}

std::string after(const char* first, double fps, std::int64_t frames) {
  const auto digits = timecode_after({first, fps}, frames);
  return digits ? words_of(*digits) : "none";
}

// SMPTE ST 12-1, 5.2: of each minute but every tenth, the numbers 00 and 01 are left out.
TEST(Timecode, Counts) {
  EXPECT_EQ(after("14:03:27:12", 25, 0), "14:03:27:12");
  EXPECT_EQ(after("14:03:27:12", 25, 13), "14:03:28:00");
  EXPECT_EQ(after("23:59:59:24", 25, 1), "00:00:00:00");
  EXPECT_EQ(after("01:00:59;29", 30000.0 / 1001, 1), "01:01:00;02");
  EXPECT_EQ(after("01:09:59;29", 30000.0 / 1001, 1), "01:10:00;00");
  EXPECT_EQ(after("01:00:59:29", 30000.0 / 1001, 1), "01:01:00:00");
  EXPECT_EQ(after("10:00:00:59", 60, 1), "10:00:01:00");
  EXPECT_EQ(after("10:00:00", 25, 1), "none");
  EXPECT_EQ(after("", 25, 1), "none");
  // Hours end at 23 (5.1), and what counts more of them than an int can hold is no timecode.
  EXPECT_EQ(after("24:00:00:00", 25, 1), "none");
  EXPECT_EQ(after("59652:19:24:00", 25, 1), "none");
  EXPECT_EQ(after("10:00:00:00", 3'575'000.3, 1), "none");
  EXPECT_EQ(after("10:00:00:00", 1e300, 1), "none");
}

TEST(Timecode, OfAFrameIsThatOfItsTime) {
  const TakeClock clock{25, Timecode{"10:00:00:00", 25}, 1'000};
  EXPECT_EQ(words_of(*clock.at(1'000)), "10:00:00:00");
  // Three frames later, with jitter, though they were lost.
  EXPECT_EQ(words_of(*clock.at(1'000 + 120'000'000 + 9'000'000)), "10:00:00:03");
  EXPECT_FALSE((TakeClock{25, std::nullopt, 0}.at(5)));
}

TEST(Timecode, OfAClipIsInTheSession) {
  SessionFile file;
  file.info.timecode = Timecode{"01:00:59;29", 30000.0 / 1001};
  const SessionFile back = parse_session_toml(to_toml(file), "session.toml");
  EXPECT_EQ(back.info.timecode, file.info.timecode);
  EXPECT_EQ(timecode_of(back.info), file.info.timecode);
  EXPECT_FALSE(timecode_of(SessionInfo{}));
  SessionInfo recorded;
  recorded.take = TakeInfo{};
  recorded.take->timecode = "14:03:27:12";
  recorded.take->timecode_fps = 24;
  EXPECT_EQ(timecode_of(recorded), (Timecode{"14:03:27:12", 24}));
}

}  // namespace previz::session::session_rate_test
