// Opens a take: a recorded session together with the set it is to be rendered with, and the
// calibrations in force.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/session/session.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/origin.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"

namespace previz::pipeline {

struct Take {
  session::Session session;
  set::Set set;          // with the observer's calibration in force
  std::string set_text;  // what `set` was read from, without settings that replace its own
  ObserverCalibration observer;
  std::optional<LightCameraCalibration> light;  // absent: only an environment file can light it
  std::shared_ptr<session::StreamReader> observer_stream;  // never null
  std::shared_ptr<session::StreamReader> light_stream;     // null: none was recorded
};

// Opens a take. `set_file` replaces the set that the session carries; a file that it names but that
// is not beside it is taken from the session's assets if it is there. Calibration in the set
// overrides the session's. The session's own set may name only files inside the session, unless
// `any_paths`. Throws previz::Error if something cannot be read, or there are no observer frames or
// no observer calibration. The whole take is read once, which a stop ends, also with an error.
// `with` replaces settings of either set. `set_assets` are files that stand in for those of the
// set, by the names that it has for them, before any others. `of_set_file` says whose `set_file`
// is.
Take open_take(const std::filesystem::path& session_directory,
               const std::optional<std::filesystem::path>& set_file, bool any_paths = false,
               const std::stop_token& stop = {}, const std::optional<set::Overlay>& with = {},
               const std::vector<std::pair<std::string, std::filesystem::path>>& set_assets = {},
               set::Origin of_set_file = set::Origin::crew);

// A session from elsewhere does not choose where files are written: throws previz::Error where its
// own set writes outside of its folder.
void refuse_output_elsewhere(const std::filesystem::path& session, const set::Set& set);

// Says that the light must come from a light camera, that the take has none, and what to do.
std::string no_light_words();

// Returns the timestamp (ns) of the take's first observer frame.
std::int64_t start_of(const Take& take);

// Returns the exposure of the take's first observer frame, or the one that the set gives instead.
double first_exposure(const Take& take);

// These return a camera's calibration: the set's own, otherwise the session's.
// observer_calibration() throws previz::Error naming the set file if there is none.
ObserverCalibration observer_calibration(const set::Set& set, const session::SessionInfo& session);
std::optional<LightCameraCalibration> light_calibration(const set::Set& set,
                                                        const session::SessionInfo& session);

}  // namespace previz::pipeline
