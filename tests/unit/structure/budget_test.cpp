// No room grows unnoticed: tests/README.md has a table of rooms and their lines, and a room that is
// more than a tenth larger needs a new row, which a reader of the change sees.
#include "tests/unit/structure/source_text.hpp"

namespace previz::budget_test {

namespace fs = std::filesystem;

using Lines = std::map<std::string, std::size_t>;  // by room

// A folder; below daemon and tests one of theirs, below daemon/core and daemon/tools one of these.
std::string room_of(const std::string& file) {
  static const std::regex room(R"((daemon/(core|tools)/\w+|(daemon|tests)/\w+|\w+)/.*)");
  return std::regex_replace(file, room, "$1");
}

Lines counted() {
  const std::set<std::string> kinds = {".cpp", ".hpp", ".comp", ".glsl", ".h"};
  Lines lines;
  for (const char* folder : {"daemon", "drivers", "shaders", "tests"})
    for (const auto& entry : fs::recursive_directory_iterator(test::source / folder)) {
      if (!kinds.contains(entry.path().extension())) continue;
      const std::string text = test::text_of(entry.path());
      lines[room_of(entry.path().lexically_relative(test::source))] +=
          static_cast<std::size_t>(std::ranges::count(text, '\n'));
    }
  return lines;
}

Lines budget() {
  const std::string text = test::text_of(test::source / "tests/README.md");
  const std::regex row(R"(\| `([\w/]+)` \| (\d+) \|)");
  Lines lines;
  for (std::sregex_iterator match(text.begin(), text.end(), row), end; match != end; ++match)
    lines[match->str(1)] = std::stoul(match->str(2));
  return lines;
}

TEST(Budget, NoRoomIsMoreThanATenthLargerThanItsRow) {
  const Lines rows = budget();
  const Lines rooms = counted();
  std::string table;
  for (const auto& [room, lines] : rooms)
    table += "| `" + room + "` | " + std::to_string(lines) + " |\n";
  for (const auto& [room, lines] : rooms) {
    const auto row = rows.find(room);
    EXPECT_TRUE(row != rows.end() && lines * 10 <= row->second * 11)
        << room << " has " << lines << " lines; its row says "
        << (row == rows.end() ? "nothing" : std::to_string(row->second)) << ". All rooms:\n"
        << table;
  }
  for (const auto& [room, lines] : rows) EXPECT_TRUE(rooms.contains(room)) << room << " is gone";
}

}  // namespace previz::budget_test
