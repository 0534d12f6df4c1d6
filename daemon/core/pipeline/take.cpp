#include "daemon/core/pipeline/take.hpp"

#include <utility>
#include <vector>

#include "daemon/core/scene/assets.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/file_edit.hpp"
#include "daemon/core/set/load.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {
namespace {

// Returns what the session says is missing of this camera: ": observer.mkv: is a pipe ...".
std::string why_missing(const session::Session& session, const std::string& source) {
  std::string why;
  for (const std::string& line : session.missing)
    if (line.starts_with(source)) why += (why.empty() ? ": " : "; ") + line;
  return why;
}

}  // namespace

ObserverCalibration observer_calibration(const set::Set& set, const session::SessionInfo& session) {
  if (set.observer.calibration) return *set.observer.calibration;
  if (session.observer) return *session.observer;
  throw Error(set.file.string() +
              ": observer: no film camera calibration in the set file or the session: find it with "
              "`previz calibrate observer`, or `previz calibrate from` if another tool has it, "
              "and put the table [observer.intrinsics] into the set");
}

std::optional<LightCameraCalibration> light_calibration(const set::Set& set,
                                                        const session::SessionInfo& session) {
  return set.light_camera.calibration ? set.light_camera.calibration : session.light;
}

Take open_take(const std::filesystem::path& session_directory,
               const std::optional<std::filesystem::path>& set_file, bool any_paths,
               const std::stop_token& stop, const std::optional<set::Overlay>& with,
               const std::vector<std::pair<std::string, std::filesystem::path>>& set_assets,
               set::Origin of_set_file) {
  Take take;
  take.session = session::open_session(session_directory, stop);
  std::vector<std::pair<std::string, std::filesystem::path>> assets = set_assets;
  for (const auto& [as_written, stored] : take.session.info.assets)
    if (!set_file || !std::filesystem::exists(set_file->parent_path() / as_written))
      assets.emplace_back(as_written, std::filesystem::absolute(session_directory / stored));

  const std::filesystem::path name = set_file.value_or(
      session_directory / std::filesystem::path(take.session.info.set_name).filename());
  take.set_text = set_file ? set::read_set_file(*set_file) : take.session.info.set_text;
  if (take.set_text.empty())
    throw Error(session_directory.string() +
                ": the session has no set file; give one with --set FILE");
  take.set = set::parse_set(take.set_text, name, assets,
                            set_file    ? of_set_file
                            : any_paths ? set::Origin::trusted_session
                                        : set::Origin::session,
                            with);

  // A model of the take's own might name other files as its parts, for which this throws.
  if (!set_file && !any_paths) static_cast<void>(scene::assets_of(take.set));

  take.observer = observer_calibration(take.set, take.session.info);
  take.set.observer.calibration = take.observer;
  take.light = light_calibration(take.set, take.session.info);
  take.observer_stream = session::open_stream(take.session, "observer", stop);
  take.light_stream = session::open_stream(take.session, "light", stop);
  if (!take.observer_stream || take.observer_stream->records().empty())
    throw Error(session_directory.string() + ": the session has no film camera frames" +
                why_missing(take.session, "observer"));
  return take;
}

void refuse_output_elsewhere(const std::filesystem::path& session, const set::Set& set) {
  if (!session::lies_within(session, set.output.directory))
    throw Error(
        session.string() + ": its set file writes to " + set.output.directory.string() +
        ", outside the take's folder; give a folder with --out, or allow it with --any-paths");
}

std::string no_light_words() {
  return "the session has no light frames, and the set file no lighting.environment: give a "
         "picture of the light there, or give lamps ([[light]]) and from = \"set\" in [lighting]";
}

std::int64_t start_of(const Take& take) {
  return take.observer_stream->records().front().timestamp_ns;
}

double first_exposure(const Take& take) {
  return take.set.observer.exposure.value_or(take.observer_stream->records().front().exposure);
}

}  // namespace previz::pipeline
