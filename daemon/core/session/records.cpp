#include "daemon/core/session/records.hpp"

namespace previz::session {

std::optional<Timecode> timecode_of(const SessionInfo& info) {
  if (info.timecode) return info.timecode;
  if (!info.take || info.take->timecode.empty()) return std::nullopt;
  return Timecode{info.take->timecode, info.take->timecode_fps};
}

std::vector<std::string> words_of(const Losses& lost) {
  std::vector<std::string> words;
  const auto add = [&](std::uint64_t count, const char* what) {
    if (count > 0) words.push_back(std::to_string(count) + " " + what);
  };
  add(lost.frames, "camera frames");
  add(lost.shown, "composite frames");
  add(lost.records, "tracking, button and event lines");
  return words;
}

}  // namespace previz::session
