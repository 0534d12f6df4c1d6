// Renders several takes, one after the other, as `previz render FOLDER --good` does.
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "daemon/tools/post/render.hpp"

namespace previz::post {

enum class WhichTakes { all, good };

struct TakesReport {
  std::vector<RenderReport> rendered;
  std::vector<std::string> failures;  // a take that cannot be rendered holds none up
  bool interrupted = false;
};

// `options.session` is a folder of takes, and `options.directory`, if there is one, gets a folder
// for each of them. Takes that are being recorded are left out, and reported so on `out`. Throws
// previz::Error if there is no such take.
TakesReport render_takes(const RenderOptions& options, WhichTakes which, std::ostream& out);

}  // namespace previz::post
