// Values that are changed in a set file's text, and what stays as it was.
#include "daemon/core/set/file_edit.hpp"

#include "tests/support/test.hpp"

namespace previz::set::file_edit_test {

constexpr const char* file = R"(# The attic, früh am Morgen
[set]
name = "ä"   # an umlaut

[[object]]  # the first
name = "vase"
position_m = [0.1,   # about
              0.2, 0.3]  # measured
scale=2 # twice

# Between two tables.
[[object]]
name = 'bird'
[object.more]
x = 1

[[light]]
name = "key")";

// The file with these parts, each of which it has once, as they are to be.
std::string replaced(const std::vector<std::pair<std::string, std::string>>& parts) {
  std::string text = file;
  for (const auto& [was, is] : parts) text.replace(text.find(was), was.size(), is);
  return text;
}

TEST(FileEdit, WithoutAChangeIsTheText) {
  EXPECT_EQ(FileEdit(file).text(), file);
}

TEST(FileEdit, SaysWhatIsWritten) {
  const FileEdit edit(file);
  EXPECT_EQ(edit.count("object"), 2u);
  EXPECT_EQ(edit.count("tag"), 0u);
  EXPECT_EQ(edit.written("object", 0, "scale"), "2");
  EXPECT_EQ(edit.written("object", 1, "name"), "'bird'");
  EXPECT_EQ(edit.written("object", 1, "scale"), std::nullopt);
}

TEST(FileEdit, ReplacesTheValueAlone) {
  FileEdit edit(file);
  edit.put("object", 0, "position_m", "[1.0, 2.0, 3.0]");
  edit.put("object", 0, "scale", "0.5");
  EXPECT_EQ(edit.text(), replaced({{"[0.1,   # about\n              0.2, 0.3]", "[1.0, 2.0, 3.0]"},
                                   {"scale=2 ", "scale=0.5 "}}));
}

TEST(FileEdit, AddsAKeyBehindTheTablesLastAndATableAtTheEnd) {
  FileEdit edit(file);
  EXPECT_TRUE(edit.has("object", 0, "scale"));
  EXPECT_FALSE(edit.has("object", 1, "scale"));
  edit.put("object", 0, "rotation_deg", "[0.0, 0.0, 5.0]");
  edit.put("object", 1, "scale", "1.5");
  edit.put("light", 0, "gain_mixed", "0.5");
  edit.put("light", 0, "tint", "[1.0, 0.5, 0.5]");
  edit.append("[[captured_light]]\nname = \"found 1\"\n");
  EXPECT_EQ(edit.text(), replaced({{"# twice\n", "# twice\nrotation_deg = [0.0, 0.0, 5.0]\n"},
                                   {"'bird'\n", "'bird'\nscale = 1.5\n"},
                                   {"\"key\"",
                                    "\"key\"\ngain_mixed = 0.5\ntint = [1.0, 0.5, 0.5]\n\n"
                                    "[[captured_light]]\nname = \"found 1\"\n"}}));
}

// Every kind of value ends where it ends.
TEST(FileEdit, TakesATableOverKeyByKeyOrAsAWhole) {
  const std::string lens =
      "[observer.intrinsics]  # of July\nfx = 600.0\nk3 = 0.1  # by hand\n"
      "more = [1,\n  2]\ncx = 320.0\n[quality]\nsamples = 3\n";
  const std::string measured = "# measured\n[observer.intrinsics]\nfx = 610.5\nk1 = -0.2\n";
  EXPECT_EQ(with_table(lens, "observer.intrinsics", measured),
            "[observer.intrinsics]  # of July\nfx = 610.5\nk3 = 0.1  # by hand\n"
            "more = [1,\n  2]\ncx = 320.0\nk1 = -0.2\n[quality]\nsamples = 3\n");
  EXPECT_EQ(with_table(lens, "observer.intrinsics", measured, true),
            "[observer.intrinsics]  # of July\nfx = 610.5\nk1 = -0.2\n[quality]\nsamples = 3\n");
  EXPECT_EQ(with_table("[quality]\n", "observer.intrinsics", measured, true),
            "[quality]\n\n" + measured);
}

TEST(FileEdit, KnowsWhereValuesEnd) {
  for (const char* value : {"1", "-1.5e3", "true", "\"a # b\"", "'c]d'", "[1, 2]", "[[1, 2], [3]]",
                            "[ # one\n 1,\n]", "\"\"\"x\ny\"\"\"", "1979-05-27", "inf", "0x1F"})
    for (const char* end : {"", "\n", " # comment\n", "\r\n", "\ny = 1\n", "   \n\n# more\n"}) {
      const std::string before = "a = 1\n[[t]]\nk = ";
      FileEdit edit(before + value + end);
      edit.put("t", 0, "k", "7");
      EXPECT_EQ(edit.text(), before + "7" + end) << value;
    }
}

TEST(FileEdit, RefusesWhatItCannotDo) {
  EXPECT_THROW(FileEdit("= 1"), Error);
  FileEdit edit("t = [{k = 1}]\n[[u]]\nk = 1\n");
  EXPECT_THROW(edit.put("t", 0, "k", "2"), Error);
  EXPECT_THROW(edit.put("u", 1, "k", "2"), Error);
  EXPECT_THROW(edit.put("v", 0, "k", "2"), Error);
  edit.put("u", 0, "k", "2 3");
  EXPECT_THROW(edit.text(), Error);
}

}  // namespace previz::set::file_edit_test
