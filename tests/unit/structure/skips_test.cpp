// Every case that needs data from outside the repository has its row in tests/skips.txt. Where that
// data is at hand the gate skips none of them, and would not notice that a row is missing.
#include "tests/unit/structure/source_text.hpp"

namespace previz::skips_test {

namespace fs = std::filesystem;

using test::source;
using test::text_of;

// The suites of a file in which a case, or the fixture of all its cases, asks for such data.
std::set<std::string> suites_that_need_data(const std::string& text) {
  const std::regex begins_or_needs(
      R"(\nTEST(?:_F|_P)?\(\s*(\w+),|\nclass (\w+)|\n +PREVIZ_NEEDS\()");
  std::set<std::string> suites;
  std::string suite;
  for (std::sregex_iterator match(text.begin(), text.end(), begins_or_needs), end; match != end;
       ++match) {
    if ((*match)[1].matched || (*match)[2].matched)
      suite = match->str(1) + match->str(2);
    else
      suites.insert(suite);
  }
  return suites;
}

TEST(Skips, HaveARowForEachSuiteThatNeedsDataFromElsewhere) {
  const std::string rows = text_of(source / "tests/skips.txt");
  int suites = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(source / "tests")) {
    if (entry.path().extension() != ".cpp") continue;
    for (const std::string& suite : suites_that_need_data(text_of(entry.path()))) {
      ++suites;
      EXPECT_TRUE(std::regex_search(rows, std::regex("\\n([A-Za-z]+/)?" + suite + "\\.")))
          << entry.path() << ": tests/skips.txt has no row for " << suite;
    }
  }
  EXPECT_GE(suites, 10);
}

}  // namespace previz::skips_test
