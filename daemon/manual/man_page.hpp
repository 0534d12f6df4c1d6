// Manual pages, man(7).
#pragma once

#include <string>
#include <vector>

#include "daemon/manual/command.hpp"

namespace previz::manual {

// A section whose text is not to be had from the program: a paragraph a line; one of the form
// "term: text", whose term is one word, is an entry of a list.
struct Chapter {
  std::string title;
  std::string text;
};

// Of a program: what it does, its commands with their options, and `chapters`.
std::string man_page(const std::vector<Command>& commands, int section,
                     const std::vector<Chapter>& chapters);

// previz-set(5): every table and key of a set file, from the parser's own table.
std::string set_man_page(const Chapter& description, const Chapter& see_also);

}  // namespace previz::manual
