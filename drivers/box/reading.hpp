// Notes which files libraries are at, so that whoever waits for this process can say what ended it,
// and end what never comes back.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <string>

namespace previz::box {

// Memory that a process has in common with the one that waits for it.
struct ReadingNotes {
  struct Note {
    std::atomic<std::int64_t> since_ms = 0;  // of the steady clock; 0: nobody reads
    std::array<char, 4096> file{};           // ends with a zero
  };
  std::array<Note, 64> notes;             // one for each that reads
  std::atomic<std::uint32_t> newest = 0;  // the note that was begun last
};
inline std::atomic<ReadingNotes*> reading_notes = nullptr;  // null: nobody waits

inline std::int64_t now_ms() {
  using namespace std::chrono;
  return duration_cast<milliseconds>(steady_clock::now().time_since_epoch()).count();
}

// While it lives, a library is at this file. For any thread; where too many read at once, or nobody
// waits, nothing is noted.
class Reading {
 public:
  explicit Reading(const std::filesystem::path& file) {
    ReadingNotes* const all = reading_notes;
    if (!all) return;
    for (std::uint32_t i = 0; i < all->notes.size() && !note_; ++i) {
      std::int64_t nobody = 0;
      if (!all->notes[i].since_ms.compare_exchange_strong(nobody, now_ms())) continue;
      note_ = &all->notes[i];
      const std::string& text = file.native();
      const std::size_t count = std::min(text.size(), note_->file.size() - 1);
      std::memcpy(note_->file.data(), text.data(), count);
      note_->file[count] = '\0';
      all->newest = i;
    }
  }
  ~Reading() {
    if (note_) note_->since_ms = 0;
  }
  Reading(const Reading&) = delete;
  Reading& operator=(const Reading&) = delete;

 private:
  ReadingNotes::Note* note_ = nullptr;
};

}  // namespace previz::box
