// What the driver of GPIO buttons asks of libgpiod. Its version 1 (Debian 12) and its version 2
// (Debian 13) have hardly a function in common: chip_v1.cpp and chip_v2.cpp, of which one is built.
#pragma once

#include <charconv>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "drivers/button_settings.hpp"

namespace previz::gpio {

struct Edge {
  bool is_active = false;         // after it; a line that is active low is active at ground
  std::int64_t timestamp_ns = 0;  // CLOCK_MONOTONIC, from the kernel's interrupt
};

// The kernel keeps so many edges of a line. Of more, version 1 loses the last and version 2 the
// first.
inline constexpr int edges_kept = 16;

// An input line that this process holds, until the object's end. Its chip must outlive it.
class Input {
 public:
  struct Impl;
  explicit Input(std::unique_ptr<Impl> impl);
  ~Input();
  Input(Input&& other) noexcept;
  Input& operator=(Input&& other) noexcept;

  // Returns a descriptor that is readable while an edge waits.
  int fd() const;
  // Returns whether the line is active now; nothing if it cannot be read.
  std::optional<bool> is_active() const;
  // Returns the next edge, in order of time; none if none waits. Never blocks. Throws previz::Error
  // if the chip has gone.
  std::optional<Edge> next_edge();

 private:
  std::unique_ptr<Impl> impl_;
};

class Chip {
 public:
  // Finds a chip by its label only, because the number of a gpiochip changes from boot to boot.
  // Throws previz::Error.
  explicit Chip(const std::string& label);
  ~Chip();

  // Takes a line, which is named or given by its number, as an input that reports both edges.
  // Throws previz::Error if there is no such line, or if somebody else has it.
  Input take(const std::string& line, const ContactWiring& wiring);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct FreeInput {
  std::string chip_label, chip_name, line;
  unsigned number = 0;  // of the line on its chip
};

// Returns the named input lines that nobody uses, of all chips that can be opened.
std::vector<FreeInput> free_inputs();

// Returns the number of a line that is given by its number, and not by its name.
inline std::optional<unsigned> line_number(const std::string& line) {
  unsigned number = 0;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), number);
  if (error != std::errc{} || end != line.data() + line.size()) return std::nullopt;
  return number;
}

}  // namespace previz::gpio
