// What a camera would see of tags on a walk, made by the tests: corners with noise, no pictures.
#pragma once

#include "daemon/core/set/set.hpp"
#include "daemon/tools/calibrate/tags/tag_bundle.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

// Tags on a table, on two walls and on a slope; the first lies at the origin.
std::vector<set::Tag> tags_of_a_room();

// Eyes on an arc before the room, low and high, each looking at another part of it.
std::vector<glm::dmat4> walk_through_a_room(int pictures);

// The true places, which may change on the way: `tags_at(picture)`. A tag is seen if all of it lies
// in the picture, its face towards the camera, and is at least 15 px wide. Corners have Gaussian
// noise. The stated sizes are those of the first picture's tags.
calibrate::TagWalk walk_of(const PinholeIntrinsics& lens, const std::vector<glm::dmat4>& cameras,
                           const std::function<std::vector<set::Tag>(int picture)>& tags_at,
                           double noise_px, std::mt19937& random);

}  // namespace previz::test
