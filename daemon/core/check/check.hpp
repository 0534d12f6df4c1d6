// Checks a set and reports what it asks of the renderer, as `previzd check` does.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>

namespace previz::check {

struct CheckOptions {
  std::filesystem::path set_or_session;
  std::optional<std::filesystem::path> set_file = {};  // in place of a session's own
};

// Takes a set file, or a session directory with its own set and calibrations. Opens no device: a
// replayed session is read, but its frames are not decoded, except five of a take, by which it says
// how far the edges of the model of what is real are from theirs, and whether its tags fit its
// pictures. Prints cameras, tags, objects
// with their triangles, lights, estimator, the features of the renderer that the set uses and
// leaves out, and remarks on settings that are allowed but unusual. Returns 0, or 1 after printing
// every problem of the set file, each object's file, the environment and the tag map. Throws
// previz::Error for a set file in place of the set of no session.
int check_set(const CheckOptions& options, std::ostream& out);

}  // namespace previz::check
