// A recorded session together with the set it is to be rendered with, and the calibrations in
// force.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "daemon/set/set.hpp"
#include "drivers/calibration.hpp"
#include "drivers/session/session.hpp"

namespace previz::pipeline {

struct Take {
  session::Session session;
  set::Set set;          // with the observer's calibration in force
  std::string set_text;  // what `set` was read from
  ObserverCalibration observer;
  std::optional<LightCameraCalibration> light;  // absent: only an environment file can light it
  std::shared_ptr<session::StreamReader> observer_stream;  // never null
  std::shared_ptr<session::StreamReader> light_stream;     // null: none was recorded
};

// `set_file` instead of the set the session carries; files it names that are not beside it are
// taken from the session's assets where they are. Calibration in the set overrides the session's.
// Throws previz::Error: what cannot be read, has no observer frames, or no observer calibration.
Take open_take(const std::filesystem::path& session_directory,
               const std::optional<std::filesystem::path>& set_file);

// When its first observer frame was taken.
std::int64_t start_of(const Take& take);

// The calibration of each camera: the set's own, otherwise the session's. Throws previz::Error
// naming the set file if the observer has none.
ObserverCalibration observer_calibration(const set::Set& set, const session::SessionInfo& session);
std::optional<LightCameraCalibration> light_calibration(const set::Set& set,
                                                        const session::SessionInfo& session);

}  // namespace previz::pipeline
