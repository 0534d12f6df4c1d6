#include "daemon/core/report/printable.hpp"

#include <sstream>

#include "tests/support/test.hpp"

namespace previz::printable_test {

TEST(OnOneLine, KeepsWordsAndShowsTheRestAsBytes) {
  EXPECT_EQ(on_one_line("prise 12é — 撮影\n"), "prise 12é — 撮影");
  EXPECT_EQ(on_one_line("a\tb\nc\x7f"), "a b c\\x7f");
  EXPECT_EQ(on_one_line("\xc2\x9b"
                        "31m"),
            "\\xc2\\x9b31m");                                 // U+009B is ESC [ to a terminal
  EXPECT_EQ(on_one_line("\xe2\x80\xae"), "\\xe2\\x80\\xae");  // from right to left
  EXPECT_EQ(on_one_line("\x9b\xff\xc0\xaf\xe2\x82"), "\\x9b\\xff\\xc0\\xaf\\xe2\\x82");
  EXPECT_EQ(on_one_line(std::string("a\0b", 3)), "a\\x00b");
}

TEST(WithShortLines, LeavesOutTheMiddleOfLongOnes) {
  const std::string a(5000, 'a'), b(4000, 'b');
  EXPECT_EQ(with_short_lines("x\n\n" + b + "\n"), "x\n\n" + b + "\n");
  EXPECT_EQ(with_short_lines(a + "\n" + b),
            a.substr(0, 2000) + " ... " + a.substr(0, 2000) + "\n" + b);
}

TEST(SafeOutput, ObeysNothingButTheClearingOfALine) {
  std::ostringstream out;
  {
    const SafeOutput safe(out);
    out << erase_line << "50 %\n"
        << "name\r\x1b[K" << '\x1b' << 1 << std::endl;
  }
  out << "\x1b";
  EXPECT_EQ(out.str(), "\r\x1b[K50 %\nname\\x0d\\x1b[K\\x1b1\n\x1b");
}

}  // namespace previz::printable_test
