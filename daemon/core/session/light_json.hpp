// Converts the light of a track line to JSON and back. Not for use outside this room.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "daemon/core/session/records.hpp"

namespace previz::session {

// Throws previz::Error if a number is not finite.
nlohmann::ordered_json to_json(const CapturedLight& light);
// Throws std::exception if `json` is not what to_json makes.
CapturedLight captured_light_of(const nlohmann::ordered_json& json);

}  // namespace previz::session
