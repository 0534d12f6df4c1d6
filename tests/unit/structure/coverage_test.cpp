// tests/coverage names only what there is: cases of the test programs, and files of the tests.
#include "tests/unit/structure/source_text.hpp"

namespace previz::coverage_test {

namespace fs = std::filesystem;

using test::source;
using test::text_of;

// All that a regular expression finds in a text.
std::vector<std::smatch> matches(const std::string& text, const std::regex& expression) {
  return {std::sregex_iterator(text.begin(), text.end(), expression), {}};
}

// The texts of those files below tests/ that are compiled into some program, and of the headers.
std::vector<std::string> test_sources() {
  std::vector<std::string> sources;
  std::string builds;
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(source / "tests")) {
    if (entry.path().filename() == "CMakeLists.txt") builds += text_of(entry.path());
    const std::string extension = entry.path().extension();
    if (extension == ".cpp" || extension == ".hpp") files.push_back(entry.path());
  }
  for (const fs::path& file : files)
    if (file.extension() == ".hpp" || builds.find(file.filename().string()) != std::string::npos)
      sources.push_back(text_of(file));
  return sources;
}

// The names of all cases, "Suite.Name". A case with parameters runs only where they are given, and
// is known by "Prefix/Suite.Name", too.
std::set<std::string> cases() {
  const std::regex plain(R"((?:^|\n)TEST(?:_F)?\(\s*(\w+),\s*(\w+)\))");
  const std::regex with_parameters(R"((?:^|\n)TEST_P\(\s*(\w+),\s*(\w+)\))");
  const std::regex parameters(R"((?:^|\n)INSTANTIATE_TEST_SUITE_P\(\s*(\w*),\s*(\w+),)");
  std::set<std::string> names;
  std::multimap<std::string, std::string> prefixes;  // by suite
  std::vector<std::pair<std::string, std::string>> parameterised;
  for (const std::string& text : test_sources()) {
    for (const std::smatch& match : matches(text, plain))
      names.insert(match.str(1) + "." + match.str(2));
    for (const std::smatch& match : matches(text, with_parameters))
      parameterised.emplace_back(match.str(1), match.str(2));
    for (const std::smatch& match : matches(text, parameters))
      prefixes.emplace(match.str(2), match.str(1));
  }
  for (const auto& [suite, name] : parameterised) {
    const auto [begin, end] = prefixes.equal_range(suite);
    for (auto prefix = begin; prefix != end; ++prefix) {
      names.insert(suite + "." + name);
      if (!prefix->second.empty()) names.insert(prefix->second + "/" + suite + "." + name);
    }
  }
  return names;
}

// What the files of tests/coverage have between backticks.
std::vector<std::string> cited() {
  std::vector<std::string> words;
  for (const fs::directory_entry& entry : fs::directory_iterator(source / "tests/coverage")) {
    const std::string text = text_of(entry.path());
    for (const std::smatch& match : matches(text, std::regex("`([^`\n]+)`")))
      words.push_back(match.str(1));
  }
  return words;
}

// Whether a name is one of a pattern, whose stars stand for any letters.
bool fits(std::string_view pattern, std::string_view name) {
  if (pattern.empty()) return name.empty();
  if (pattern.front() == '*')
    return fits(pattern.substr(1), name) || (!name.empty() && fits(pattern, name.substr(1)));
  return !name.empty() && pattern.front() == name.front() &&
         fits(pattern.substr(1), name.substr(1));
}

// A word is a case if it is "Suite.Name", both in CamelCase or with stars. What stands behind the
// name and a slash is a parameter, which has its name only when the program runs.
TEST(Coverage, EveryCaseThatIsCitedExists) {
  const std::set<std::string> all = cases();
  ASSERT_GT(all.size(), 800u);
  const std::regex a_case(R"(((?:\w+/)?[A-Z][\w*]*\.[A-Z*][\w*]*)(?:/\w+)?)");
  int looked_up = 0;
  for (const std::string& word : cited()) {
    std::smatch match;
    if (!std::regex_match(word, match, a_case)) continue;
    ++looked_up;
    const std::string pattern = match.str(1);
    EXPECT_TRUE(std::any_of(all.begin(), all.end(),
                            [&](const std::string& name) { return fits(pattern, name); }))
        << "tests/coverage cites `" << word << "`, which no test program has";
  }
  EXPECT_GT(looked_up, 200);
}

TEST(Coverage, EveryFileThatIsCitedExists) {
  int looked_up = 0;
  for (const std::string& word : cited()) {
    const std::string file = word.substr(0, word.find(' '));
    if (!file.starts_with("tests/")) continue;
    ++looked_up;
    EXPECT_TRUE(fs::exists(source / file) || fs::exists(source / (file + ".cpp")))
        << "tests/coverage cites `" << word << "`, which is not there";
  }
  EXPECT_GT(looked_up, 5);
}

}  // namespace previz::coverage_test
