#include "daemon/tools/post/render_folder.hpp"

#include <string>
#include <utility>
#include <vector>

#include "daemon/core/session/files.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/error.hpp"

namespace previz::post {

namespace fs = std::filesystem;

fs::path render_folder(const fs::path& session, bool is_take, const fs::path& output_directory) {
  if (!is_take || session::lies_within(session, output_directory)) return output_directory;
  return output_directory / output::named(fs::absolute(session)).filename();
}

std::optional<std::uint64_t> rendered_frames(const output::ListedTake& take) {
  if (!take.fault.empty()) return std::nullopt;
  const session::SessionInfo& info = take.summary.info;
  fs::path folder;
  try {
    std::vector<std::pair<std::string, fs::path>> assets;
    for (const auto& [as_written, stored] : info.assets)
      assets.emplace_back(as_written, fs::absolute(take.directory / stored));
    const set::Set set =
        set::parse_set(info.set_text, take.directory / fs::path(info.set_name).filename(), assets,
                       set::Origin::trusted_session);
    folder = render_folder(take.directory, info.take.has_value(), set.output.directory);
  } catch (const Error&) {
    return std::nullopt;
  }
  std::error_code unknown;
  if (!fs::is_regular_file(fs::symlink_status(folder / "frames.jsonl", unknown))) return 0;
  session::PlainLines lines(folder / "frames.jsonl");
  std::uint64_t count = 0;
  for (std::string line; lines.next(line);) ++count;
  return count;
}

}  // namespace previz::post
