#include "daemon/tools/print/command_line.hpp"

#include <CLI/CLI.hpp>

#include "daemon/tools/calibrate/lens/board.hpp"

namespace previz::print {
namespace {

void add_print_options(CLI::App& command, PrintOptions& options, const char* file) {
  options.file = file;
  command.add_option("--paper", options.paper, "Paper size; larger drawings span several sheets")
      ->check(CLI::IsMember({"A4", "A3", "Letter"}))
      ->capture_default_str();
  command.add_option("--out", options.file, "PDF file")->capture_default_str();
}

void add_tag_options(CLI::App& command, TagOptions& options, const char* ids, const char* file) {
  command.add_option("--ids", options.ids, ids)->required();
  command.add_option("--size", options.size, "Side of the black border: 80mm, 8cm, 3in")
      ->required();
  command.add_option("--family", options.family, "Tag family")->capture_default_str();
  add_print_options(command, options, file);
}

}  // namespace

void add_print(CLI::App& app, Commands& commands) {
  CLI::App& command = *app.add_subcommand("print", "Draw tags and boards for the printer, as PDF");
  command.require_subcommand(1);
  add_tag_options(*command.add_subcommand("tags", "Tags to cut out, several per sheet"),
                  commands.tags, "Ids: 0-11,20", "tags.pdf");
  add_tag_options(*command.add_subcommand("block", "Paper to fold around a cube, one tag per side"),
                  commands.block, "Ids: four around it, one above, one below (or none)",
                  "block.pdf");
  add_tag_options(*command.add_subcommand("stick", "Paper to fold around a square stick"),
                  commands.stick, "Ids: four around it, then four above them, ...", "stick.pdf");
  CLI::App& board = *command.add_subcommand("board", "A board for `previz calibrate`");
  board.add_option("board", commands.board.board, calibrate::board_grammar)->required();
  add_print_options(board, commands.board, "board.pdf");
}

int do_print(const CLI::App& app, const Commands& commands, std::ostream& out) {
  const CLI::App& command = *app.get_subcommand("print");
  if (command.got_subcommand("tags")) print_tags(commands.tags, out);
  if (command.got_subcommand("block")) print_block(commands.block, out);
  if (command.got_subcommand("stick")) print_stick(commands.stick, out);
  if (command.got_subcommand("board")) print_board(commands.board, out);
  return 0;
}

}  // namespace previz::print
