// Notes which file is read, so that whoever waits for this process can say what ended it.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstring>
#include <filesystem>
#include <string>

namespace previz::box {

// Memory that a process has in common with the one that waits for it.
struct ReadingNote {
  static constexpr std::size_t most_bytes = 4096;
  char file[most_bytes];  // ends with a zero
};
inline std::atomic<ReadingNote*> reading_note = nullptr;  // null: nobody waits

// Says what is read now. For any thread.
inline void now_reading(const std::filesystem::path& file) {
  ReadingNote* const note = reading_note;
  if (!note) return;
  const std::string& text = file.native();
  const std::size_t count = std::min(text.size(), ReadingNote::most_bytes - 1);
  std::memcpy(note->file, text.data(), count);
  note->file[count] = '\0';
}

}  // namespace previz::box
