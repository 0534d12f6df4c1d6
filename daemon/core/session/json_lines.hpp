// Reads and writes the .jsonl files, which have one record a line, so that a torn line costs that
// line only. Numbers are written so that every double comes back bit for bit. Not for use outside
// the room.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/core/session/records.hpp"
#include "drivers/buttons.hpp"

namespace previz::session {

// A line of observer.jsonl or light.jsonl: the frame, and which packet of the .mkv is its picture.
struct FrameLine {
  FrameRecord record;
  std::int64_t video_ms = 0;  // Matroska time of the packet; unique in the file
  std::uint32_t crc32 = 0;    // of the packet's bytes (IEEE 802.3, as zlib's)
};

// Return the line without its newline. Throw previz::Error if a number is not finite.
std::string to_line(const FrameLine& line);
std::string to_line(const TrackRecord& record);
std::string to_line(const ButtonEvent& event);
std::string to_line(const MarkEvent& mark);
std::string to_line(std::int64_t timestamp_ns, const std::string& event);

// A file with so many bad lines is not what a recorder writes, and is not read further.
inline constexpr std::size_t most_bad_lines = 10'000;

template <typename Record>
struct Lines {
  std::vector<Record> records;           // of whole lines; frames strictly increase
  std::vector<std::uint64_t> bad_lines;  // numbers, from 1, of lines that cannot be understood
};

// Read every line that can be read; a file that is not there has no lines.
Lines<FrameLine> read_frame_lines(const std::filesystem::path& file);
Lines<TrackRecord> read_track_lines(const std::filesystem::path& file);
// Returns the edges among the events: lines that have a "button". Other events are not looked at.
Lines<ButtonEvent> read_button_lines(const std::filesystem::path& file);
// Likewise the marks among the events: lines that have a "mark".
Lines<MarkEvent> read_mark_lines(const std::filesystem::path& file);

}  // namespace previz::session
