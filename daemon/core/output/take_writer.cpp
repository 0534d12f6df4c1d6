#include "daemon/core/output/take_writer.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <tuple>

#include "drivers/error.hpp"

namespace previz::output {
namespace {

// A folder with a higher number is none of a take.
constexpr int highest_take = 999'999;

session::TakeInfo numbered(const TakeTemplate& take, int number) {
  session::TakeInfo info = take.info.take.value_or(session::TakeInfo{});
  info.number = number;
  return info;
}

session::SessionInfo session_info(const TakeTemplate& take, const session::TakeInfo& numbered) {
  session::SessionInfo info = take.info;
  info.take = numbered;
  info.name = take_name(numbered.slate, numbered.number);
  return info;
}

}  // namespace

std::string timecode(std::chrono::nanoseconds since_midnight, double fps) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(since_midnight);
  const auto rate = std::max(1, static_cast<int>(std::lround(fps)));
  const double part = std::chrono::duration<double>(since_midnight - seconds).count();
  const int frame = std::min(static_cast<int>(part * rate), rate - 1);
  const auto total = static_cast<int>(seconds.count() % 86'400);
  return session::words_of(
      session::TimecodeDigits{total / 3600, total / 60 % 60, total % 60, frame});
}

std::string timecode_of(std::chrono::system_clock::time_point time, double fps) {
  const std::time_t whole =
      std::chrono::system_clock::to_time_t(std::chrono::floor<std::chrono::seconds>(time));
  std::tm local{};
  localtime_r(&whole, &local);
  const auto part = time - std::chrono::floor<std::chrono::seconds>(time);
  return timecode(std::chrono::hours(local.tm_hour) + std::chrono::minutes(local.tm_min) +
                      std::chrono::seconds(local.tm_sec) + part,
                  fps);
}

std::string take_name(const std::string& slate, int number) {
  std::string name = slate;
  for (char& c : name) {
    const auto code = static_cast<unsigned char>(c);
    const bool letter = std::isalnum(code) != 0 || code >= 0x80;  // UTF-8 is kept
    if (!letter && c != '-' && c != '+' && c != '.') c = '_';
  }
  if (name.empty() || name.front() == '.') name.insert(name.begin(), '_');
  std::array<char, 16> digits{};
  std::snprintf(digits.data(), digits.size(), "%03d", number);
  return name + "_take" + digits.data();
}

std::optional<int> take_number(const std::string& name, const std::string& slate) {
  std::string stem = take_name(slate, 0);
  stem.resize(stem.size() - 3);
  if (!name.starts_with(stem)) return std::nullopt;
  int number = 0;
  const char* last = name.data() + name.size();
  const auto [stop, code] = std::from_chars(name.data() + stem.size(), last, number);
  const bool is_number = code == std::errc{} && stop == last && number <= highest_take;
  return is_number ? std::optional(number) : std::nullopt;
}

int next_take_number(const std::vector<std::filesystem::path>& folders, const std::string& slate,
                     int used) {
  int highest = used;
  for (const std::filesystem::path& folder : folders) {
    // A folder that is not there has no takes. One that cannot be read further, because its disk
    // fails, is no reason not to record in another.
    std::error_code unreadable;
    for (std::filesystem::directory_iterator entry(folder, unreadable), end;
         !unreadable && entry != end; entry.increment(unreadable))
      highest =
          std::max(highest, take_number(entry->path().filename().string(), slate).value_or(0));
  }
  return highest + 1;
}

TakeWriter::TakeWriter(const TakeTemplate& take, const std::filesystem::path& folder, int number)
    : take_(numbered(take, number)),
      directory_(folder / take_name(take_.slate, take_.number)),
      writer_(directory_, session_info(take, take_), std::chrono::seconds(1), take.codec) {}

bool TakeWriter::fits(const Frame& frame) const {
  const auto found = formats_.find(frame.source);
  return found == formats_.end() || found->second == format_of(frame);
}

TakeWriter::Format TakeWriter::format_of(const Frame& frame) {
  return {frame.format, frame.width, frame.height, frame.bayer};
}

void TakeWriter::write(const Frame& frame, std::chrono::system_clock::time_point captured) {
  const bool observer = frame.source == "observer";
  if (observer && frame_of_.empty()) {
    take_.timecode = timecode_of(captured, take_.timecode_fps);
    writer_.set_take(take_);
  }
  // It is known before it is written: afterwards there may be no memory for that.
  formats_.try_emplace(frame.source, format_of(frame));
  auto known = frame_of_.end();
  bool is_new = false;
  if (observer) std::tie(known, is_new) = frame_of_.emplace(frame.timestamp_ns, frame_of_.size());
  try {
    writer_.write(frame);
  } catch (const std::exception&) {
    if (is_new) frame_of_.erase(known);
    throw;
  }
}

bool TakeWriter::has_frame_of(const session::TrackRecord& record) const {
  return frame_of_.contains(record.timestamp_ns);
}

void TakeWriter::write(session::TrackRecord record) {
  const auto found = frame_of_.find(record.timestamp_ns);
  if (found == frame_of_.end() || found->second < next_track_) return;
  record.frame = found->second;
  writer_.write(record);
  next_track_ = record.frame + 1;
}

void TakeWriter::mark_good() {
  take_.good = true;
  writer_.set_take(take_);
}

}  // namespace previz::output
