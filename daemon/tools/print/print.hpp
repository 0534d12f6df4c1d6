// Implements `previz print ...`: tags and boards as PDF.
#pragma once

#include <filesystem>
#include <ostream>
#include <string>

namespace previz::print {

struct PrintOptions {
  std::string paper = "A4";
  std::filesystem::path file;
};

struct TagOptions : PrintOptions {
  std::string family = "tag36h11", ids, size;  // "0-11,20", "80mm"
};

struct BoardOptions : PrintOptions {
  std::string board;  // calibrate::board_grammar
};

// Each writes the file and reports on `out` what is in it. Throws previz::Error with what cannot be
// understood or does not fit.
void print_tags(const TagOptions& options, std::ostream& out);
void print_block(const TagOptions& options, std::ostream& out);
void print_stick(const TagOptions& options, std::ostream& out);
void print_board(const BoardOptions& options, std::ostream& out);

}  // namespace previz::print
