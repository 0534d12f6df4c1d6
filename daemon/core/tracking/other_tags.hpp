// Says which tags pictures hold, where they hold none of the family that was named.
#pragma once

#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::tracking {

// Returns what the pictures hold in place of tags of `family`, and what to do: tags of another of
// set::tag_families, mirrored ones, or white ones on black. They must be in two of the pictures, or
// in the only one, two of them or one that nothing but a tag looks like. Empty: they hold nothing
// like it, or `stop` was requested. Takes up to a second a picture.
std::string other_tags(const std::vector<std::shared_ptr<const Frame>>& pictures,
                       const std::string& family, const ResponseCurve& response,
                       const std::stop_token& stop = {});

}  // namespace previz::tracking
