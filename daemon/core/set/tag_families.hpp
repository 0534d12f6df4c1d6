// The families of AprilTags that can be tracked, by libapriltag's names.
#pragma once

#include <array>

namespace previz::set {

inline constexpr std::array tag_families = {"tag36h11",      "tag25h9",          "tag16h5",
                                            "tag36h10",      "tagStandard41h12", "tagStandard52h13",
                                            "tagCircle21h7", "tagCircle49h12",   "tagCustom48h12"};

}  // namespace previz::set
