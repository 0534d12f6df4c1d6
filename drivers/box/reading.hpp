// Notes which files libraries are at, so that whoever waits for this process can say what ended it,
// and end what never comes back.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>

namespace previz::box {

// Memory that a process has in common with the one that waits for it, which does not trust it.
struct ReadingNotes {
  struct Note {
    std::atomic<pid_t> reader = 0;         // the thread; 0: nobody reads
    std::atomic<std::uint32_t> count = 0;  // of readings, by which one is told from the next
    std::array<char, 4096> file{};         // ends with a zero
  };
  std::array<Note, 64> notes;             // one for each that reads
  std::atomic<std::uint32_t> newest = 0;  // the note that was begun last
};
inline std::atomic<ReadingNotes*> reading_notes = nullptr;  // null: nobody waits

// While it lives, a library is at this file. For any thread; where too many read at once, or nobody
// waits, nothing is noted.
class Reading {
 public:
  explicit Reading(const std::filesystem::path& file) {
    ReadingNotes* const all = reading_notes;
    if (!all) return;
    for (std::uint32_t i = 0; i < all->notes.size() && !note_; ++i) {
      pid_t nobody = 0;
      if (!all->notes[i].reader.compare_exchange_strong(nobody, ::gettid())) continue;
      note_ = &all->notes[i];
      ++note_->count;
      const std::string& text = file.native();
      const std::size_t count = std::min(text.size(), note_->file.size() - 1);
      std::memcpy(note_->file.data(), text.data(), count);
      note_->file[count] = '\0';
      all->newest = i;
    }
  }
  ~Reading() {
    if (note_) note_->reader = 0;
  }
  Reading(const Reading&) = delete;
  Reading& operator=(const Reading&) = delete;

 private:
  ReadingNotes::Note* note_ = nullptr;
};

}  // namespace previz::box
