// Replays the buttons of a recorded take behind the ordinary interface.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "drivers/buttons.hpp"

namespace previz {

struct ReplayButtonsOptions {
  double speed = 1.0;  // 1: as recorded; 2: twice as fast; 0: all at once
  // The recorded time `timestamp_ns` is due at `due`; the replayed cameras of the session are given
  // the same.
  std::chrono::steady_clock::time_point due = std::chrono::steady_clock::now();
  std::int64_t timestamp_ns = 0;
};

// Delivers each event when it is due, with its recorded time, in the order of these times. Throws
// previz::Error if speed is negative or not finite.
std::unique_ptr<Buttons> replay_buttons(std::vector<ButtonEvent> events, std::string name,
                                        const ReplayButtonsOptions& options);

// Replays the session's events.jsonl; a session without one has no events. `timestamp_ns` of the
// options is usually the first frame's. Lines that cannot be understood are reported as trouble
// first.
std::unique_ptr<Buttons> open_replay_buttons(const std::filesystem::path& session,
                                             const ReplayButtonsOptions& options);

}  // namespace previz
