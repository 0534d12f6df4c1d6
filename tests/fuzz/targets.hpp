// The readers of foreign bytes, one function each: libFuzzer looks for bytes that break them
// (fuzz_main.cpp), and fuzz_corpus_test.cpp runs them over the bytes that are kept.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <string_view>

namespace previz::fuzz {

using Bytes = std::span<const std::uint8_t>;

inline Bytes bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

inline std::string text_of(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// Returns the bytes with their structure changed, or null if they do not have the structure.
using Mutator = std::optional<std::string> (*)(Bytes, std::mt19937&);

struct Target {
  const char* name;   // also of its folder in tests/fuzz/corpus
  const char* reads;  // says what the bytes are
  // Reads the bytes. Throws previz::Error where they are refused; anything else that it throws is a
  // fault of the reader, as is a promise of the reader's header that does not hold.
  void (*read)(Bytes);
  Mutator mutate = nullptr;  // one of mutators.hpp; null where the bytes have no such structure
};

std::span<const Target> targets();
// Returns null if no target has the name.
const Target* find_target(std::string_view name);

// Returns whether the bytes were accepted.
bool accepts(const Target& target, Bytes bytes);

// What the targets use. Each file of a room of targets adds its own to the table.
std::span<const Target> device_targets();
std::span<const Target> farm_targets();
std::span<const Target> footage_targets();
std::span<const Target> scene_targets();
std::span<const Target> session_targets();
std::span<const Target> take_targets();
std::span<const Target> v4l2_targets();
std::span<const Target> bus_targets();
std::span<const Target> video_targets();

// Reports a promise that was broken, and aborts.
void expect(bool holds, const char* promise);
// Returns a folder of this process in the folder for temporary files.
const std::filesystem::path& work_folder();
// Writes the bytes to a file in the folder, over what it was, and returns its path.
std::filesystem::path file_of(Bytes bytes, const char* name);

// Takes numbers from the beginning of bytes; what is missing is 0.
class Choices {
 public:
  explicit Choices(Bytes bytes) : bytes_(bytes) {}

  std::uint8_t byte() {
    if (bytes_.empty()) return 0;
    const std::uint8_t value = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return value;
  }
  // Returns a number from 0 to most.
  int up_to(int most) {
    const int high = byte();
    return (high << 8 | byte()) % (most + 1);
  }
  Bytes rest() const { return bytes_; }

 private:
  Bytes bytes_;
};

}  // namespace previz::fuzz
