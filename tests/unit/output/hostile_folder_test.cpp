// A rig records at 1920x1080 while things that are no files of takes lie in the takes' folder.
#include <sys/stat.h>

#include "tests/support/recorder_fixture.hpp"

namespace previz::output::hostile_folder_test {

namespace fs = std::filesystem;

struct Break {
  const char* name;
  std::function<void(const fs::path&)> make;
};

void write_lines(const fs::path& file, const std::string& line, int count) {
  std::ofstream stream(file);
  for (int i = 0; i < count; ++i) stream << line << '\n';
}

const Break breaks[] = {
    {"Claims40GB",
     [](const fs::path& file) {
       std::ofstream(file).close();
       fs::resize_file(file, std::uintmax_t{40} << 30);
     }},
    {"Has3MillionLines", [](const fs::path& file) { write_lines(file, "", 3'000'000); }},
    {"NamesATakeIn3MillionLines",
     [](const fs::path& file) { write_lines(file, "12A_take001", 3'000'000); }},
    {"IsAPipe", [](const fs::path& file) { ::mkfifo(file.c_str(), 0600); }},
    {"IsAFolder", [](const fs::path& file) { fs::create_directories(file / "of/folders"); }},
    {"IsALinkToADevice", [](const fs::path& file) { fs::create_symlink("/dev/zero", file); }},
    {"IsALinkToItself", [](const fs::path& file) { fs::create_symlink(file.filename(), file); }},
};

void PrintTo(const Break& one, std::ostream* out) {
  *out << one.name;
}

class RecorderAmong : public testing::TestWithParam<Break> {};

// Under every name that the recorder looks at: beside the takes, and in one that was cut off.
TEST_P(RecorderAmong, LosesNoFrame) {
  const test::TemporaryDirectory directory;
  const fs::path cut_off = directory / "12A_take001", other = directory / "12A_take002";
  for (const fs::path& take : {cut_off, other}) fs::create_directories(take);
  std::ofstream(other / "session.toml") << "closed = false\n";
  for (const fs::path& file :
       {directory / ".highest_takes", directory / ".recording", directory / "SHA256SUMS",
        cut_off / "session.toml", other / "observer.jsonl", other / "observer.mkv",
        other / "track.jsonl", other / "buttons.jsonl", other / "events.jsonl"})
    GetParam().make(file);

  // A grey picture with a little noise, 3 s at 25 Hz.
  Frame frame = session::noise_frame("observer", 0, PixelFormat::gray8, 1920, 1080);
  for (std::uint8_t& byte : frame.bytes) byte = static_cast<std::uint8_t>(100 + byte % 4);
  constexpr std::uint64_t frames = 75;
  Heard heard;
  RecorderOptions options = recorder_options({directory.path()});
  heard.listen(options);
  Recorder recorder(std::move(options));
  recorder.start();
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t i = 0; i < frames; ++i) {
    auto next = std::make_shared<Frame>(frame);
    next->sequence = 100 + i;
    next->timestamp_ns += static_cast<std::int64_t>(i) * 40'000'000;
    next->arrival_ns = next->timestamp_ns + 5'000'000;
    // A camera gives its frames at its rate.
    std::this_thread::sleep_until(begin + i * std::chrono::milliseconds(40));
    recorder.offer(next);
  }
  EXPECT_TRUE(wait_for_frames(recorder, frames));
  end_take(recorder);
  EXPECT_EQ(heard.left_out(), Causes{});
  EXPECT_EQ(recorder.status().fault, "");
  const fs::path take = recorder.status().directory;
  EXPECT_EQ(frame_count(take), frames);
  EXPECT_THAT(missing_of(take), IsEmpty());
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
}

INSTANTIATE_TEST_SUITE_P(Breaks, RecorderAmong, testing::ValuesIn(breaks),
                         [](const auto& one) { return std::string(one.param.name); });

}  // namespace previz::output::hostile_folder_test
