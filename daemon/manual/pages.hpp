// What previzd comes with to be read and completed: three manual pages, two completions.
#pragma once

#include <string>
#include <vector>

namespace previz::manual {

struct Page {
  std::string name;  // of the file, as it is installed: "previzd.8"
  std::string text;
};

std::vector<Page> man_pages();
std::vector<Page> bash_completions();  // named as the program is

}  // namespace previz::manual
