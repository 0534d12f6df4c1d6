// The light of a frame as track.jsonl carries it, and back.
#pragma once

#include "daemon/lighting/environment.hpp"
#include "drivers/session/session.hpp"

namespace previz::pipeline {

// Its sources, and what else there is as lighting::blurred leaves it: what lighting.mode =
// "sources" lights the set with comes back as it was, bit for bit.
session::CapturedLight to_record(const lighting::Lighting& lighting);
lighting::Lighting from_record(const session::CapturedLight& record);

}  // namespace previz::pipeline
