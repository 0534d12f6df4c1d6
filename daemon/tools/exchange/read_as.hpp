// Reads from FRAMES.json what a video's tags should have said.
#pragma once

#include "daemon/tools/exchange/json_members.hpp"
#include "daemon/tools/exchange/video_tags.hpp"

namespace previz::exchange {

// Reads the member "read_as" of a camera, which may be missing. Throws previz::Error naming the
// member and what is allowed.
ReadAs read_read_as(const Members& camera);

}  // namespace previz::exchange
