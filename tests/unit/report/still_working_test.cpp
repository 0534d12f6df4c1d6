#include "daemon/core/report/still_working.hpp"

#include "daemon/core/report/printable.hpp"
#include "tests/support/test.hpp"

namespace previz {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using namespace std::chrono_literals;

// A terminal whose text may be read while another thread writes.
class Terminal : public std::streambuf {
 public:
  std::string text() {
    const std::lock_guard lock(mutex_);
    return text_;
  }
  std::string text_with(const std::string& part) {
    for (const auto end = std::chrono::steady_clock::now() + 30s;
         text().find(part) == std::string::npos && std::chrono::steady_clock::now() < end;)
      std::this_thread::sleep_for(1ms);
    return text();
  }

 private:
  std::streamsize xsputn(const char* text, std::streamsize count) override {
    const std::lock_guard lock(mutex_);
    text_.append(text, static_cast<std::size_t>(count));
    return count;
  }
  int overflow(int c) override {
    const char letter = traits_type::to_char_type(c);
    return xsputn(&letter, 1) == 1 ? c : 0;
  }
  std::mutex mutex_;
  std::string text_;
};

const std::string erased(erase_line);

TEST(StillWorking, SaysSoUntilSomethingIsWritten) {
  Terminal terminal;
  std::ostream out(&terminal), errors(&terminal);
  {
    const StillWorking working("at work", {&out, &errors}, 5ms);
    EXPECT_THAT(terminal.text_with(" s"), StartsWith(erased + "at work, 0 s"));
    errors << "warning: dark\n";
    EXPECT_THAT(terminal.text(), HasSubstr(" s" + erased + "warning: dark\n"));
    terminal.text_with("dark\n" + erased + "at work");
  }
  EXPECT_THAT(terminal.text(), testing::EndsWith(erased));
  out << "done\n";
  EXPECT_THAT(terminal.text(), testing::EndsWith(erased + "done\n"));
}

TEST(StillWorking, KeepsALineOfProgress) {
  Terminal terminal;
  std::ostream out(&terminal);
  const StillWorking working("at work", {&out}, 50ms);
  out << "read\n"
      << erase_line << "frame 0: 1/4"
      << " samples" << std::flush;
  const std::string line = "frame 0: 1/4 samples";
  EXPECT_THAT(terminal.text_with(" (0 s)"), HasSubstr(erased + line + " (0 s)"));
  out << erase_line << "frame 0: 2/4 samples";
  EXPECT_THAT(terminal.text(), HasSubstr(" s)" + erased + line + erased + "frame 0: 2/4 samples"));
}

TEST(StillWorking, IsSilentWhereSomethingIsWrittenAllTheTime) {
  Terminal terminal;
  std::ostream out(&terminal);
  {
    const StillWorking working("at work", {&out}, 1h);
    out << "a\nb\n";
  }
  EXPECT_EQ(terminal.text(), "a\nb\n");
}

}  // namespace
}  // namespace previz
