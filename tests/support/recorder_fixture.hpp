// What the tests of the recorder share: what it is offered, and what it says and counts.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "daemon/output/recorder.hpp"
#include "tests/support/session_fixture.hpp"

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

// Returns how many frames of the film camera a take has.
inline std::uint64_t frame_count(const std::filesystem::path& take) {
  session::Session session = session::open_session(take);
  const auto stream = session::open_stream(session, "observer");
  return stream ? stream->records().size() : 0;
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

}  // namespace previz::output
