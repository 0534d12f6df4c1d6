// Replays a recorded stream behind the ordinary camera interface. It makes no faults: faults.hpp
// wraps any camera.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/session/session.hpp"
#include "drivers/camera.hpp"
#include "drivers/host_clock.hpp"

namespace previz {

// The place at which a replayed stream stands.
struct ReplayPosition {
  std::size_t index = 0;  // in the stream's records
  std::int64_t lap = 0;   // of a looped replay
};

struct ReplayOptions {
  double speed = 1.0;  // 1: as recorded; 2: twice as fast; 0: as fast as frames are asked for
  bool loop = false;   // starts again at the end; timestamps and sequence keep increasing
  // Time from a frame of a loop to the same frame a lap later; 0: replay_lap_ns of this stream.
  // Streams that keep a common time need a common lap, the longest of all of them.
  std::int64_t lap_ns = 0;
  // Positions in the stream's records, both included; beyond the last record means the last.
  std::size_t first = 0;
  std::size_t last = std::numeric_limits<std::size_t>::max();
  // The capture time `timestamp_ns` is due at `due`, which gives the streams of one session a
  // common time. Absent: the first frame is due when it is first asked for.
  struct Origin {
    HostClock::Time due;
    std::int64_t timestamp_ns = 0;
  };
  std::optional<Origin> origin;
  // Shared by the successive openings of one replayed device, so that it goes on where it was.
  // Absent: each opening begins at `first`.
  std::shared_ptr<ReplayPosition> position;
};

// Returns the time from a frame of a looped replay to the same frame a lap later. `records` are the
// replayed ones, at least one.
std::int64_t replay_lap_ns(std::span<const session::FrameRecord> records);

// Delivers every frame, in order, with its recorded times, never before it is due; a frame asked
// for late comes at once (a late stage counts what it drops itself). A frame that cannot be read is
// a DeviceTrouble in its place. Frames that fall due while the camera does not stream, or is
// unplugged (see `position`), are missed as a camera's would be; at speed 0 it goes on where it
// was. set_exposure() returns false. The name is "<session>/<source>". Each text of `trouble` is
// reported as a DeviceTrouble before the first frame. Throws previz::Error if the options leave no
// frame, or speed is negative or not finite.
std::unique_ptr<Camera> replay(std::shared_ptr<session::StreamReader> stream, std::string name,
                               const ReplayOptions& options = {}, const HostClock& clock = {},
                               const std::vector<std::string>& trouble = {});

// Opens the session for one stream, "observer" or "light"; what the session lacks is reported as
// trouble. Throws previz::Error if there is no such session or stream.
std::unique_ptr<Camera> open_replay(const std::filesystem::path& session, const std::string& source,
                                    const ReplayOptions& options = {}, const HostClock& clock = {});

}  // namespace previz
