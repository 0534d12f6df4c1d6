// The tracking's part of `previzd check` of a take: whether its pictures fit its tags.
#pragma once

#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/set/check.hpp"

namespace previz::check {

// Tracks five frames that are spread over the take, or all of fewer, and remarks on what of it does
// not hold (tracking/pose_judgement.hpp). Frames that cannot be read are left out. Nothing is
// looked at where the set has no tags or does not track by them.
void remark_on_tracking(const pipeline::Take& take, set::Findings& findings);

}  // namespace previz::check
