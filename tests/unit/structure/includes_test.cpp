// The order of the rooms: a file includes only its own room and rooms below it. The floors are
// those of the CMakeLists.txt, which build the rooms from the ground up. Within a room no two files
// need each other.
#include "tests/support/test.hpp"

namespace previz::includes_test {

namespace fs = std::filesystem;

const fs::path source = PREVIZ_SOURCE_DIR;

struct Include {
  std::string file;  // as the include writes it, from the source directory on
  int line;
};

// The subdirectories of a CMakeLists.txt in its order.
std::vector<std::string> subdirectories(const fs::path& directory) {
  std::vector<std::string> names;
  std::ifstream file(directory / "CMakeLists.txt");
  const std::regex add("^add_subdirectory\\((.+)\\)");
  std::smatch match;
  for (std::string line; std::getline(file, line);)
    if (std::regex_search(line, match, add)) names.push_back(match[1]);
  return names;
}

// Adds the rooms in a folder, and after them the folder's own files, from the ground up.
void add_floors(const std::string& folder, std::vector<std::string>& floors) {
  for (const std::string& room : subdirectories(source / folder)) {
    if (folder == "daemon" && room == "manual") floors.push_back(folder);
    add_floors(folder + "/" + room, floors);
  }
  if (folder != "daemon") floors.push_back(folder);
}

// Every room and its floor. The files of daemon/ itself are above all rooms but the manual's.
std::map<std::string, int> floors() {
  std::vector<std::string> rooms = {"drivers", "shaders"};
  add_floors("daemon", rooms);
  std::map<std::string, int> result;
  for (const std::string& room : rooms) result.emplace(room, static_cast<int>(result.size()));
  return result;
}

// Returns the room of a file: its folder, or the nearest one around it that is a room.
std::string room_of(const std::string& file) {
  static const std::map<std::string, int> rooms = floors();
  std::string folder = fs::path(file).parent_path();
  while (!folder.empty() && !rooms.contains(folder)) folder = fs::path(folder).parent_path();
  return folder.empty() ? file.substr(0, file.find('/')) : folder;
}

std::vector<Include> includes_of(const std::string& file) {
  std::vector<Include> includes;
  std::ifstream stream(source / file);
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    const std::string begin = "#include \"";
    if (line.starts_with(begin))
      includes.push_back({line.substr(begin.size(), line.rfind('"') - begin.size()), number});
  }
  return includes;
}

// Every C++ file of the daemon and the drivers, with what it includes of the project.
const std::map<std::string, std::vector<Include>>& includes() {
  static const auto all = [] {
    std::map<std::string, std::vector<Include>> result;
    for (const char* top : {"daemon", "drivers"})
      for (const fs::directory_entry& entry : fs::recursive_directory_iterator(source / top))
        if (entry.path().extension() == ".cpp" || entry.path().extension() == ".hpp") {
          const std::string file = entry.path().lexically_relative(source);
          result[file] = includes_of(file);
        }
    return result;
  }();
  return all;
}

TEST(Includes, NoRoomIncludesARoomAboveIt) {
  const std::map<std::string, int> floor = floors();
  ASSERT_GT(includes().size(), 300u);
  ASSERT_GT(floor.size(), 15u);
  for (const auto& [file, included] : includes()) {
    const auto own = floor.find(room_of(file));
    ASSERT_NE(own, floor.end()) << file << ": its room is not in daemon/CMakeLists.txt";
    for (const Include& include : included) {
      const auto other = floor.find(room_of(include.file));
      if (other == floor.end()) continue;  // beside the rooms: generated
      EXPECT_LE(other->second, own->second)
          << file << ":" << include.line << ": " << own->first << " includes " << include.file
          << ", whose room is above it";
    }
  }
}

// The parts of daemon/: what the others share, the tools, the manual of both programs, and the rig.
enum class Part { core, tools, manual, rig };

Part part_of(const std::string& file) {
  if (file.starts_with("daemon/core/")) return Part::core;
  if (file.starts_with("daemon/tools/")) return Part::tools;
  return file.starts_with("daemon/manual/") ? Part::manual : Part::rig;
}

TEST(Includes, TheRigAndTheToolsKnowOnlyWhatTheyShare) {
  for (const auto& [file, included] : includes()) {
    if (file.starts_with("drivers/") || part_of(file) == Part::manual) continue;
    for (const Include& include : included) {
      if (!include.file.starts_with("daemon/") || part_of(include.file) == Part::core) continue;
      EXPECT_EQ(part_of(include.file), part_of(file))
          << file << ":" << include.line << ": includes " << include.file;
    }
  }
}

// A driver would otherwise be compiled again with every change of the list of drivers.
TEST(Includes, NoDriverIncludesTheRegistryThatListsIt) {
  for (const auto& [file, included] : includes()) {
    if (fs::path(file).parent_path().parent_path() != "drivers") continue;
    for (const Include& include : included)
      EXPECT_FALSE(include.file.ends_with("_drivers.hpp"))
          << file << ":" << include.line << ": includes " << include.file;
  }
}

// Returns a file's name without its ending: a header and its source count as one file.
std::string stem_of(const std::string& file) {
  return fs::path(file).replace_extension();
}

// Walks the includes of a file and of those that it includes; returns the way that leads back to a
// file on it. Empty: there is none. Each file is looked at once.
class Circle {
 public:
  explicit Circle(const std::map<std::string, std::set<std::string>>& included)
      : included_(included) {}

  std::string from(const std::string& file) {
    const auto at = std::ranges::find(way_, file);
    if (at != way_.end()) {
      std::string words;
      for (auto step = at; step != way_.end(); ++step) words += *step + " -> ";
      return words + file;
    }
    if (!seen_.insert(file).second) return "";
    way_.push_back(file);
    std::string found;
    if (const auto own = included_.find(file); own != included_.end())
      for (const std::string& next : own->second)
        if (found = from(next); !found.empty()) break;
    way_.pop_back();
    return found;
  }

 private:
  const std::map<std::string, std::set<std::string>>& included_;
  std::vector<std::string> way_;
  std::set<std::string> seen_;
};

TEST(Includes, NoFileNeedsOneThatNeedsIt) {
  std::map<std::string, std::set<std::string>> by_stem;
  for (const auto& [file, included] : includes())
    for (const Include& include : included)
      if (stem_of(include.file) != stem_of(file) && includes().contains(include.file))
        by_stem[stem_of(file)].insert(stem_of(include.file));
  Circle circle(by_stem);
  for (const auto& [file, included] : by_stem) EXPECT_EQ(circle.from(file), "") << file;
}

}  // namespace previz::includes_test
