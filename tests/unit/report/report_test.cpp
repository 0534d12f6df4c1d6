// What becomes of a report: its priority in the journal, its place on the display, its repetitions.
#include "daemon/core/report/report.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <cstdarg>

#include "daemon/core/report/log.hpp"
#include "daemon/core/report/reports.hpp"
#include "tests/support/test.hpp"

namespace {

std::vector<std::map<std::string, std::string>> journal;  // its entries, by field

}  // namespace

// Stands before libsystemd's: what a program sends to the journal, without one. sd_journal_send(3).
extern "C" int sd_journal_send(const char* format, ...) {
  std::map<std::string, std::string> entry;
  std::va_list rest;
  va_start(rest, format);
  for (const char* one = format; one; one = va_arg(rest, const char*)) {
    const std::string_view field(one);
    std::string& value = entry[std::string(field.substr(0, field.find('=')))];
    if (field.ends_with("=%.*s")) {
      const int size = va_arg(rest, int);
      value.assign(va_arg(rest, const char*), static_cast<std::size_t>(size));
    } else if (field.ends_with("=%d")) {
      value = std::to_string(va_arg(rest, int));
    } else if (field.ends_with("=%zu")) {
      value = std::to_string(va_arg(rest, std::size_t));
    } else {
      ADD_FAILURE() << field;
      break;
    }
  }
  va_end(rest);
  entry.erase("TID");  // of the thread, which newer versions of spdlog send
  journal.push_back(entry);
  return 0;
}

namespace previz::report {
namespace {

// syslog(3): LOG_ERR is 3, LOG_WARNING 4, LOG_INFO 6.
TEST(Log, TheJournalGetsThePriorityOfTheSeverity) {
  start_log(Severity::info, Destination::journal);
  journal.clear();
  log({Severity::error, "recorder", "take ended, the disk is full"});
  log({Severity::warning, "light", "{} is left out"});
  log({Severity::info, "", "live on a GPU"});
  const auto entry = [](const char* priority, const char* message) {
    return std::map<std::string, std::string>{
        {"PRIORITY", priority}, {"MESSAGE", message}, {"SYSLOG_IDENTIFIER", "previzd"}};
  };
  EXPECT_THAT(journal,
              ElementsAre(entry("3", "recorder: take ended, the disk is full"),
                          entry("4", "light: {} is left out"), entry("6", "live on a GPU")));
}

// previzd --log-level
TEST(Log, LeavesOutWhatIsLessSevereThanItsLevel) {
  for (const auto& [name, least] : severities) {
    EXPECT_EQ(severity_named(name), least);
    start_log(severity_named(name), Destination::journal);
    journal.clear();
    for (const auto& [of, severity] : severities) log({severity, "", of});
    ASSERT_EQ(journal.size(), severities.size() - static_cast<std::size_t>(least)) << name;
    EXPECT_EQ(journal.front()["MESSAGE"], name);
    EXPECT_EQ(journal.back()["MESSAGE"], "error");
  }
}

TEST(Log, GoesToTheJournalOnlyWhereStandardErrorDoes) {
  struct stat target {};
  ASSERT_EQ(fstat(STDERR_FILENO, &target), 0);
  const std::string stream = std::to_string(target.st_dev) + ":" + std::to_string(target.st_ino);
  setenv("JOURNAL_STREAM", stream.c_str(), 1);
  EXPECT_EQ(destination(), Destination::journal);
  setenv("JOURNAL_STREAM", "1:2", 1);  // a service's that this program was started by
  EXPECT_EQ(destination(), Destination::terminal);
  unsetenv("JOURNAL_STREAM");
  EXPECT_EQ(destination(), Destination::terminal);
}

TEST(Reports, AnEqualOnceKeyIsLoggedOnceAndShownEveryTime) {
  std::ostringstream out;
  Reports reports(lines_to(out));
  for (const int frame : {7, 12}) {
    const std::string text = "frame " + std::to_string(frame) + " is left out";
    reports(once({Severity::warning, "light", text, "", passing("light", text)}));
    reports({Severity::info, "button red", "snapshot"});
  }
  EXPECT_EQ(out.str(), "light: frame 7 is left out\nbutton red: snapshot\nbutton red: snapshot\n");
  ASSERT_EQ(reports.troubles().size(), 1u);
  EXPECT_EQ(line_of(reports.troubles()[0]), "light: frame 12 is left out");
}

// A device that is lost again and again is not lost once.
TEST(Reports, AnEventIsLoggedEachTimeWithItsNumber) {
  std::ostringstream out;
  Reports reports(lines_to(out));
  for (int i = 1; i <= 23; ++i)
    reports(counted({Severity::error, "observer", "ended by signal " + std::to_string(4 + i % 2)}));
  reports(counted({Severity::error, "light camera", "ended by signal 5"}));
  const std::string lines = out.str();
  EXPECT_EQ(std::ranges::count(lines, '\n'), 24);
  EXPECT_THAT(lines, StartsWith("observer: ended by signal 5\n"));
  for (const char* time : {"4, the 2nd", "5, the 3rd", "4, the 4th", "5, the 11th", "5, the 13th",
                           "5, the 21st", "5, the 23rd"})
    EXPECT_THAT(lines, HasSubstr("\nobserver: ended by signal " + std::string(time) +
                                 " time in this run\n"));
  EXPECT_THAT(lines, testing::EndsWith("\nlight camera: ended by signal 5\n"));
}

TEST(Reports, AStateIsLoggedFirstAndThenAtTheTenthHundredthAndThousandthTime) {
  std::ostringstream out;
  Reports reports(lines_to(out));
  for (int frame = 1; frame <= 1000; ++frame)
    reports(once({Severity::warning, "light", "frame is left out\nThe lamp is too bright."}));
  const std::string rest = "\nThe lamp is too bright.\n";
  EXPECT_EQ(out.str(), "light: frame is left out" + rest +
                           "light: frame is left out, the 10th time in this run" + rest +
                           "light: frame is left out, the 100th time in this run" + rest +
                           "light: frame is left out, the 1000th time in this run" + rest);
}

TEST(Reports, TheBusSaysWhatWasAnnouncedLastUntilAnotherSetBegins) {
  std::ostringstream out;
  Reports reports(lines_to(out));
  EXPECT_EQ(reports.announced(), "");
  reports.announce({.source = "button red",
                    .text = "recording",
                    .notice = Notice{Severity::info, "", "recording"}});
  reports({Severity::error, "light camera", "was unplugged", "",
           lasting("light camera", "was unplugged")});
  EXPECT_EQ(reports.announced(), "button red: recording");
  EXPECT_EQ(reports.news().size(), 1u);
  EXPECT_EQ(reports.troubles().size(), 1u);
  reports.begin_set();
  EXPECT_EQ(reports.announced(), "");
  EXPECT_TRUE(reports.news().empty());
  EXPECT_TRUE(reports.troubles().empty());
}

using Clock = Notices::Clock;

Notice news(const char* text, Severity severity = Severity::info) {
  return {severity, "", text};
}

TEST(Notices, NewsStandsLongEnoughToBeReadAlsoWhereTheNextFollowsAtOnce) {
  Notices notices;
  const auto at = [](int milliseconds) {
    return Clock::time_point{} + std::chrono::milliseconds(milliseconds);
  };
  notices.add(news("recording ended"), at(0));
  notices.add(news("snapshot"), at(1000));
  notices.add(news("recording goes on", Severity::warning), at(1001));
  const std::vector<Notice> all = {news("recording ended"), news("snapshot"),
                                   news("recording goes on", Severity::warning)};
  EXPECT_EQ(notices.news(at(1001)), all);
  notices.add(news("snapshot"), at(2000));  // again: it stands once, at the end
  EXPECT_EQ(notices.news(at(2000)), (std::vector<Notice>{all[0], all[2], all[1]}));
  notices.add(news("3 samples"), at(2000));
  EXPECT_EQ(notices.news(at(2000)), (std::vector<Notice>{all[2], all[1], news("3 samples")}));
  EXPECT_EQ(notices.news(at(4500)), (std::vector<Notice>{all[1], news("3 samples")}));
  EXPECT_TRUE(notices.news(at(5000)).empty());
}

TEST(Notices, TroubleStandsUntilItsSourceIsWellAndLongEnoughToBeRead) {
  Notices notices;
  const Clock::time_point begin{};
  const Notice pedal = lasting("pedal", "sends nonsense"),
               camera = lasting("film camera", "was unplugged");
  notices.add(pedal, begin);
  notices.add(lasting("film camera", "stalls"), begin);
  notices.add(camera, begin);  // in place of the other
  notices.add(news("snapshot"), begin);
  notices.settle("pedal");
  Notice settled = pedal;
  settled.lasts = false;
  EXPECT_EQ(notices.troubles(begin + std::chrono::seconds(3)),
            (std::vector<Notice>{camera, settled}));
  EXPECT_EQ(notices.troubles(begin + Notices::trouble_time), std::vector<Notice>{camera});
  EXPECT_EQ(notices.troubles(begin + std::chrono::hours(1)).size(), 1u);
  notices.settle("film camera");
  EXPECT_TRUE(notices.troubles(begin + std::chrono::hours(1)).empty());
}

}  // namespace
}  // namespace previz::report
