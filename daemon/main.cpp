// previzd: the subcommands; nothing else.
#include <CLI/CLI.hpp>

int main(int argc, char** argv) {
  CLI::App app{"previzd: path-traced previsualization for a camera rig"};
  app.require_subcommand(1);
  CLI11_PARSE(app, argc, argv);
  return 0;
}
