#include "daemon/tools/post/render_files.hpp"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "daemon/core/output/exr.hpp"
#include "daemon/core/output/png.hpp"
#include "daemon/core/output/sums_exr.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

// Returns ".sums.exr" for "0007.sums.exr".
std::string extension_of(const std::filesystem::path& file) {
  const std::string name = file.filename().string();
  return name.substr(std::min(name.find('.'), name.size()));
}

// Decodes the whole picture; throws previz::Error if it is damaged.
void decode(const std::filesystem::path& file) {
  if (extension_of(file) == sums_extension)
    output::read_sums_exr(file);
  else if (extension_of(file) == ".exr")
    output::read_exr(file);
  else
    output::read_png(file);
}

}  // namespace

std::string frame_file(std::uint64_t frame, const char* extension) {
  std::string number = std::to_string(frame);
  number.insert(0, number.size() < 4 ? 4 - number.size() : 0, '0');
  return number + extension;
}

std::optional<std::uint64_t> frame_of(const std::filesystem::path& name) {
  const std::string whole = name.filename().string(), digits = whole.substr(0, whole.find('.'));
  std::uint64_t frame = 0;
  const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), frame);
  if (code != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return frame;
}

std::string differences(const nlohmann::json& there, const nlohmann::json& now) {
  std::string text;
  const auto add = [&](const std::string& key, const std::string& before,
                       const std::string& after) {
    if (!text.empty()) text += "; ";
    text += key;
    if (std::max(before.size(), after.size()) < 60)
      text += " is " + before + " there and " + after + " now";
    else
      text += " differs";
  };
  for (const auto& [key, value] : now.items())
    if (!there.contains(key) || there[key] != value)
      add(key, there.contains(key) ? there[key].dump() : "not given", value.dump());
  for (const auto& [key, value] : there.items())
    if (!now.contains(key)) add(key, value.dump(), "not given");
  return text;
}

FileMark mark_of(const std::filesystem::path& file) {
  return {std::filesystem::file_size(file), session::sha256_of(file)};
}

std::string why_broken(const std::filesystem::path& file, bool has_marks, FinishedFrame& record) {
  const std::string its = "its " + extension_of(file);
  std::error_code unknown;
  if (!std::filesystem::exists(std::filesystem::symlink_status(file, unknown)))
    return its + " is missing";
  if (const std::string why = session::why_not_plain(file); !why.empty()) return its + " " + why;
  const std::string name = file.filename().string();
  try {
    if (!has_marks) {
      decode(file);
      record.files[name] = mark_of(file);
      return {};
    }
    const auto mark = record.files.find(name);
    if (mark == record.files.end()) return its + " is not in its line of frames.jsonl";
    if (std::filesystem::file_size(file, unknown) != mark->second.bytes)
      return its + " has another size than when it was written";
    if (session::sha256_of(file) != mark->second.sha256)
      return its + " has other content (SHA-256) than when it was written";
  } catch (const Error&) {
    return its + (has_marks ? " cannot be read" : " cannot be decoded");
  }
  return {};
}

std::vector<const char*> extensions_of(const set::Output& output, bool has_sums,
                                       FrameStatus status) {
  if (has_sums && status == FrameStatus::untouched) return {};
  if (has_sums) return {sums_extension};
  std::vector<const char*> all;
  if (output.exr) all.push_back(".exr");
  if (output.png || output.video) all.push_back(".png");
  return all;
}

bool has_files(const set::Output& output, bool has_sums, const FinishedFrame& frame) {
  const std::vector<const char*> extensions = extensions_of(output, has_sums, frame.status);
  return std::ranges::all_of(extensions, [&](const char* extension) {
    std::error_code unknown;
    return std::filesystem::is_regular_file(std::filesystem::symlink_status(
        output.directory / frame_file(frame.frame, extension), unknown));
  });
}

std::string read_settings(const std::filesystem::path& folder) {
  return session::read_plain_file(folder / settings_name, {"the settings of a render", 1 << 24});
}

Frames frames_in(const std::filesystem::path& lines) {
  Frames frames;
  std::error_code unknown;
  if (!std::filesystem::exists(std::filesystem::symlink_status(lines, unknown))) return frames;
  session::PlainLines text(lines);
  for (std::string line; text.next(line);) {
    try {
      const FinishedFrame record = from_json(line);
      frames[record.frame] = record;
    } catch (const std::exception&) {
      continue;
    }
  }
  return frames;
}

Frames finished_frames(const set::Output& output, bool has_sums, FrameRange range) {
  Frames frames = frames_in(output.directory / lines_name);
  std::erase_if(frames, [&](const auto& entry) {
    return entry.first < range.first || entry.first > range.last ||
           !has_files(output, has_sums, entry.second);
  });
  return frames;
}

}  // namespace previz::post
