// A recorded stream behind the ordinary camera interface. Faults (drops, stalls, corruption) do not
// belong here: they wrap any Camera.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/camera.hpp"
#include "drivers/session/session.hpp"

namespace previz {

// Passed in so that a test can hold time still.
struct ReplayClock {
  using Time = std::chrono::steady_clock::time_point;
  std::function<Time()> now = [] { return std::chrono::steady_clock::now(); };
  std::function<void(Time)> sleep_until;  // empty: std::this_thread::sleep_until
};

struct ReplayOptions {
  double speed = 1.0;  // 1: as recorded; 2: twice as fast; 0: as fast as frames are asked for
  bool loop = false;   // at the end from the start again; timestamps and sequence keep increasing
  // Positions in the stream's records, both included; beyond the last record means the last.
  std::size_t first = 0;
  std::size_t last = std::numeric_limits<std::size_t>::max();
  // Which capture time is due when; gives the streams of one session a common time. Absent: the
  // first frame is due when it is first asked for.
  struct Origin {
    ReplayClock::Time due;
    std::int64_t timestamp_ns = 0;
  };
  std::optional<Origin> origin;
};

// Delivers every frame, in order, with its recorded times, never before it is due; a frame asked
// for late comes at once (what a late stage drops is that stage's to count). A frame that cannot be
// read is a DeviceTrouble in its place. set_exposure() returns false. The name is
// "<session>/<source>". `trouble` is told, one DeviceTrouble each, before the first frame.
// Throws previz::Error if the options leave no frame, or speed is negative or not finite.
std::unique_ptr<Camera> replay(std::unique_ptr<session::StreamReader> stream, std::string name,
                               const ReplayOptions& options = {}, const ReplayClock& clock = {},
                               const std::vector<std::string>& trouble = {});

// Opens the session for one stream, "observer" or "light"; what the session lacks is the trouble.
// Throws previz::Error if there is no such session or stream.
std::unique_ptr<Camera> open_replay(const std::filesystem::path& session, const std::string& source,
                                    const ReplayOptions& options = {},
                                    const ReplayClock& clock = {});

}  // namespace previz
