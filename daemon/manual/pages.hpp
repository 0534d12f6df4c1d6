// Builds the four manual pages and the two shell completions that are installed with previzd.
#pragma once

#include <string>
#include <vector>

namespace previz::manual {

struct Page {
  std::string name;  // name of the installed file: "previzd.8"
  std::string text;
};

std::vector<Page> man_pages();
std::vector<Page> bash_completions();  // named after their programs

}  // namespace previz::manual
