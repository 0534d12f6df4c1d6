// `previzd check`: is this set right, and what does it ask of the renderer?
#pragma once

#include <filesystem>
#include <iosfwd>

namespace previz::post {

// A set file, or a session directory (its own set and calibrations). Opens no device: a replayed
// session is read, its frames are not decoded. Prints cameras, tags, objects with their triangles,
// lights, estimator, which features of the renderer the set uses and which are left out, and what
// is worth a look though it is allowed. Returns 0, or 1 with every problem printed: of the set
// file, of each object's file, of the environment, of the tag map.
int check_set(const std::filesystem::path& set_or_session, std::ostream& out);

}  // namespace previz::post
