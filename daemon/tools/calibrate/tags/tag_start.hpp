// Finds about where the tags of a walk are, from what single pictures show of pairs of them.
#pragma once

#include <vector>

#include "daemon/tools/calibrate/tags/tag_bundle.hpp"

namespace previz::calibrate {

// Returns the groups of tags that pictures link: two tags are linked by a picture that shows both.
// The largest group comes first; indices into TagWalk::ids, rising.
std::vector<std::vector<std::size_t>> linked_tags(const TagWalk& walk);

// Returns places of all tags that are linked to the origin, in its frame, and the cameras' poses;
// the others are left at the origin. One tag seen in one picture has two likely poses (IPPE), so
// two tags in a picture have up to four ways to lie to each other. Of all ways that the pictures of
// a pair offer, the one is taken that fits most of these pictures; a spanning tree of the
// best-supported pairs links the tags. Cameras, and then tags, are given the pose, among those that
// single pictures offer, that fits everything best, between two robust adjustments, so that a tag
// that was mistaken for its mirror image is put right.
TagPlaces start_of_tags(const TagWalk& walk, const PinholeIntrinsics& lens, std::size_t origin);

}  // namespace previz::calibrate
