#include "daemon/tools/post/render_takes.hpp"

#include <ostream>

#include "daemon/core/output/take_list.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

bool is_wanted(const output::ListedTake& take, WhichTakes which) {
  if (which == WhichTakes::all) return true;
  return take.summary.info.take && take.summary.info.take->good;
}

}  // namespace

TakesReport render_takes(const RenderOptions& options, WhichTakes which, std::ostream& out) {
  TakesReport report;
  bool found = false;
  for (const output::ListedTake& take : output::list_takes({options.session})) {
    if (!is_wanted(take, which)) continue;
    found = true;
    if (take.may_be_in_recording) {
      out << take.directory.string() << ": is being recorded, skipped" << std::endl;
      continue;
    }
    out << take.directory.string() << std::endl;
    RenderOptions one = options;
    one.session = take.directory;
    if (options.directory) one.directory = *options.directory / take.directory.filename();
    try {
      report.rendered.push_back(render_session(one, out));
    } catch (const Error& error) {
      report.failures.emplace_back(error.what());
      out << error.what() << std::endl;
    }
    report.interrupted = options.stop.stop_requested();
    if (report.interrupted) break;
  }
  if (!found)
    throw Error(options.session.string() +
                (which == WhichTakes::good
                     ? ": no take in it is marked good; `previz takes mark TAKE` marks one, and "
                       "--all renders every take"
                     : ": contains no takes; give the folder that the set's "
                       "recording.directory names"));
  return report;
}

}  // namespace previz::post
