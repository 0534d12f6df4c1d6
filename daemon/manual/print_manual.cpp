// Writes the manual pages and the shell completions, as they are installed, below a directory:
//   print_manual DIRECTORY      makes DIRECTORY/man and DIRECTORY/bash-completion
#include <filesystem>
#include <fstream>
#include <iostream>

#include "daemon/manual/pages.hpp"

namespace {

void write(const std::filesystem::path& directory, const std::vector<previz::manual::Page>& pages) {
  std::filesystem::create_directories(directory);
  for (const auto& page : pages) {
    std::ofstream file(directory / page.name, std::ios::binary);
    file.exceptions(std::ios::failbit | std::ios::badbit);
    file << page.text << std::flush;
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: print_manual DIRECTORY\n";
    return 2;
  }
  const std::filesystem::path directory = argv[1];
  try {
    write(directory / "man", previz::manual::man_pages());
    write(directory / "bash-completion", previz::manual::bash_completions());
  } catch (const std::exception& error) {
    std::cerr << "print_manual: " << directory.string() << ": " << error.what() << "\n";
    return 1;
  }
  return 0;
}
