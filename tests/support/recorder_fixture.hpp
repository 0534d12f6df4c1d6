// What the tests of the recorder share: what it is offered, and what it says and counts.
#pragma once

#include "daemon/core/output/recorder.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::output {

inline constexpr std::uint64_t plenty = 1'000'000'000;  // bytes

// The noise_frame of this index, small.
inline FramePtr picture(std::uint64_t index, const std::string& source = "observer",
                        int width = 32) {
  return std::make_shared<Frame>(session::noise_frame(source, index, PixelFormat::rgb8, width, 24));
}

// What tracking says of picture(index): its camera stands at x = index.
inline session::TrackRecord track_of(std::uint64_t index) {
  session::TrackRecord record;
  record.timestamp_ns = picture(index)->timestamp_ns;
  record.tracked = true;
  record.world_from_camera[3][0] = static_cast<double>(index);
  return record;
}

// Returns how many frames of the film camera, or of another source, a take has.
inline std::uint64_t frame_count(const std::filesystem::path& take,
                                 const std::string& source = "observer") {
  session::Session session = session::open_session(take);
  const auto stream = session::open_stream(session, source);
  return stream ? stream->records().size() : 0;
}

// Returns the indices of the pictures that a take has, each compared bit for bit.
inline std::vector<std::uint64_t> frames_of(const std::filesystem::path& take,
                                            const std::string& source = "observer") {
  session::Session session = session::open_session(take);
  const auto stream = session::open_stream(session, source);
  std::vector<std::uint64_t> indices;
  if (!stream) return indices;
  for (std::size_t i = 0; i < stream->records().size(); ++i) {
    const std::uint64_t index = stream->records()[i].sequence - 100;
    EXPECT_TRUE(session::is_frame(*stream->read(i), index)) << index;
    indices.push_back(index);
  }
  return indices;
}

// Returns what a take says that it lacks.
inline std::vector<std::string> missing_of(const std::filesystem::path& take) {
  return session::open_session(take).missing;
}

// Returns the numbers from the first to the last.
inline std::vector<std::uint64_t> count_from(std::uint64_t first, std::uint64_t last) {
  std::vector<std::uint64_t> numbers(last + 1 - first);
  std::iota(numbers.begin(), numbers.end(), first);
  return numbers;
}

// ---- what a recorder does and has done

[[nodiscard]] inline testing::AssertionResult wait_for_frames(const Recorder& recorder,
                                                              std::uint64_t frames) {
  return test::wait_until(std::to_string(frames) + " frames are written",
                          [&] { return recorder.status().frames == frames; });
}

[[nodiscard]] inline testing::AssertionResult wait_for_take(const Recorder& recorder, int number) {
  return test::wait_until("take " + std::to_string(number) + " runs",
                          [&] { return recorder.status().number == number; });
}

[[nodiscard]] inline testing::AssertionResult wait_for_finished(const Recorder& recorder,
                                                                std::uint64_t takes) {
  return test::wait_until(std::to_string(takes) + " takes are finished",
                          [&] { return recorder.status().finished_takes == takes; });
}

[[nodiscard]] inline testing::AssertionResult wait_for_failures(const Recorder& recorder,
                                                                std::uint64_t failures) {
  return test::wait_until(std::to_string(failures) + " failures are counted",
                          [&] { return recorder.status().failures == failures; });
}

[[nodiscard]] inline testing::AssertionResult wait_for_its_look(const Recorder& recorder) {
  return test::wait_until("the folders were looked at",
                          [&] { return recorder.free_bytes().has_value(); });
}

// Ends the take and waits until all of it is on the disk.
inline void end_take(Recorder& recorder) {
  recorder.stop();
  recorder.finish();
}

// Begins a take with the picture of this index, and waits until it is written.
[[nodiscard]] inline testing::AssertionResult begin_take(Recorder& recorder,
                                                         std::uint64_t index = 0) {
  recorder.start();
  recorder.offer(picture(index));
  return wait_for_frames(recorder, 1);
}

// Offers a take of one picture from its start to its stop.
inline void record_take(Recorder& recorder, std::uint64_t index = 0) {
  recorder.start();
  recorder.offer(picture(index));
  recorder.stop();
}

// Pictures by the cause for which they are not kept.
using Causes = std::map<std::string, std::uint64_t>;

// Holds what a recorder said and left out.
class Heard {
 public:
  void listen(RecorderOptions& options) {
    options.note = [this](const report::Report& report) {
      const std::lock_guard lock(mutex_);
      notes_.push_back(line_of(report));
    };
    options.left_out = [this](const std::string& cause, std::uint64_t pictures) {
      const std::lock_guard lock(mutex_);
      left_out_[cause] += pictures;
    };
  }
  bool said(const std::string& words) const {
    const std::lock_guard lock(mutex_);
    return session::mentions(notes_, words);
  }
  std::vector<std::string> notes() const {
    const std::lock_guard lock(mutex_);
    return notes_;
  }
  Causes left_out() const {
    const std::lock_guard lock(mutex_);
    return left_out_;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> notes_;
  Causes left_out_;
};

// Returns options for takes 12A_take001 and on without pre-roll, in the order of the folders.
inline RecorderOptions recorder_options(std::vector<std::filesystem::path> folders) {
  RecorderOptions options;
  options.take.folders = std::move(folders);
  options.take.info.take = session::TakeInfo{0, "12A", "", 25, "", false};
  options.preroll_s = 0;
  options.reserve_bytes = 100;
  return options;
}

// A recorder of two folders whose disks have as much room as a test says.
struct TwoDisks {
  const test::TemporaryDirectory directory;
  const std::filesystem::path first = directory / "first", second = directory / "second";
  std::atomic<std::uint64_t> free_on_first = plenty, free_on_second = plenty;
  Heard heard;

  RecorderOptions options() {
    RecorderOptions options = recorder_options({first, second});
    options.free_bytes = [this](const std::filesystem::path& folder) {
      return folder.filename() == "first" ? free_on_first.load() : free_on_second.load();
    };
    heard.listen(options);
    return options;
  }
};

}  // namespace previz::output
