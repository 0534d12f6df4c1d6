// Makes texts fit for a terminal that come from files, names and command lines: they are data, and
// may be anybody's.
#pragma once

#include <iostream>
#include <streambuf>
#include <string>
#include <string_view>

namespace previz {

// Returns `text` with control characters but line breaks and tabs (also those of C1), the marks
// that turn the direction of writing, and bytes that are not UTF-8 as \xNN.
std::string without_commands(std::string_view text);

// Returns the same on one line: line breaks and tabs as spaces, none at the end.
std::string on_one_line(std::string_view text);

// Returns the text with the middle of lines of more than 4000 bytes left out.
std::string with_short_lines(std::string_view text);

// Clears the line of a terminal that is being written.
inline constexpr std::string_view erase_line = "\r\x1b[K";

// While it lives, what is written to a stream is without commands, but for erase_line where that is
// written alone.
class SafeOutput {
 public:
  explicit SafeOutput(std::ostream& stream)
      : stream_(stream), buffer_(stream.rdbuf()), below_(stream.rdbuf(&buffer_)) {}
  ~SafeOutput() { stream_.rdbuf(below_); }
  SafeOutput(const SafeOutput&) = delete;
  SafeOutput& operator=(const SafeOutput&) = delete;

 private:
  class Buffer final : public std::streambuf {
   public:
    explicit Buffer(std::streambuf* below) : below_(below) {}

   private:
    std::streamsize xsputn(const char* text, std::streamsize count) override;
    int overflow(int c) override;
    int sync() override { return below_->pubsync(); }

    std::streambuf* below_;
  };

  std::ostream& stream_;
  Buffer buffer_;
  std::streambuf* below_;
};

}  // namespace previz
