// Writes manual pages in the format of man(7).
#pragma once

#include <string>
#include <vector>

#include "daemon/manual/command.hpp"

namespace previz::manual {

// A section of a manual page whose text was written by hand. Every line is a paragraph, except that
// a line of the form "term: text" is an entry of a list if the term is a single word, or if
// `is_list`.
struct Chapter {
  std::string title;
  std::string text;
  bool is_list = false;
};

// Returns the page of a program, or of a command of one: what it does, its commands with their
// options, and `chapters`. The program or command itself comes first in `commands`.
std::string man_page(const std::vector<Command>& commands, int section,
                     const std::vector<Chapter>& chapters);

// Returns previz-set(5), which has every table and key of a set file, from the parser's own table.
std::string set_man_page(const Chapter& description, const Chapter& see_also);

}  // namespace previz::manual
