#include "daemon/core/session/replay_buttons.hpp"

#include <poll.h>

#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::replay_buttons_test {

using std::chrono::hours;

const std::vector<ButtonEvent> presses{
    {"record", true, 1'000}, {"record", false, 81'000'000}, {"freeze", true, 5'000'000'000}};

bool readable(const Buttons& buttons, int within_ms = 0) {
  pollfd fd{buttons.fd(), POLLIN, 0};
  return poll(&fd, 1, within_ms) == 1;
}

// All that is due now.
std::vector<ButtonEvent> due_events(Buttons& buttons) {
  std::vector<ButtonEvent> events;
  while (std::optional<ButtonsEvent> event = buttons.next())
    if (auto* edge = std::get_if<ButtonEvent>(&*event)) events.push_back(*edge);
  return events;
}

ReplayButtonsOptions due_at(std::chrono::steady_clock::time_point due, double speed = 1) {
  return {speed, due, 0};
}

TEST(ReplayButtons, EverythingDueComesInTheOrderOfItsTimes) {
  std::vector<ButtonEvent> shuffled{presses[2], presses[0], presses[1]};
  const auto buttons = replay_buttons(shuffled, "take", due_at({}));
  EXPECT_TRUE(readable(*buttons, 10'000));
  EXPECT_EQ(due_events(*buttons), presses);
  EXPECT_FALSE(readable(*buttons));
  EXPECT_EQ(buttons->name(), "take");
}

TEST(ReplayButtons, NothingComesBeforeItIsDue) {
  const auto now = std::chrono::steady_clock::now();
  const auto buttons = replay_buttons(presses, "take", due_at(now + hours(1)));
  EXPECT_FALSE(readable(*buttons));
  EXPECT_FALSE(buttons->next());
  // At this speed the first two are due, the third in some hours.
  const auto slow = replay_buttons(presses, "take", due_at(now - hours(100), 1.3e-5));
  EXPECT_EQ(due_events(*slow).size(), 2u);
  EXPECT_FALSE(readable(*slow));
}

TEST(ReplayButtons, TheDescriptorWakesAWaiter) {
  const auto soon = std::chrono::steady_clock::now() + std::chrono::milliseconds(20);
  const auto buttons = replay_buttons({{"record", true, 0}}, "take", due_at(soon));
  pollfd fd{buttons->fd(), POLLIN, 0};
  ASSERT_EQ(poll(&fd, 1, 10'000), 1);
  EXPECT_GE(std::chrono::steady_clock::now(), soon);
  EXPECT_EQ(due_events(*buttons).size(), 1u);
}

TEST(ReplayButtons, SpeedZeroGivesAllAtOnceThenTheEnd) {
  const auto buttons =
      replay_buttons(presses, "take", due_at(std::chrono::steady_clock::now() + hours(1), 0));
  for (const ButtonEvent& press : presses)
    EXPECT_EQ(std::get<ButtonEvent>(buttons->next().value()), press);
  EXPECT_TRUE(std::holds_alternative<EndOfStream>(buttons->next().value()));
  EXPECT_FALSE(buttons->next());
  EXPECT_FALSE(readable(*buttons));
}

TEST(ReplayButtons, WhatASessionRecordedComesBack) {
  const test::TemporaryDirectory directory;
  {
    session::SessionWriter writer(directory / "take", {});
    for (const ButtonEvent& press : presses) writer.write(press);
  }
  const auto buttons = open_replay_buttons(directory / "take", due_at({}));
  EXPECT_EQ(due_events(*buttons), presses);
}

TEST(ReplayButtons, DamagedLinesAreToldAndOtherEventsAreNotButtons) {
  const test::TemporaryDirectory directory;
  session::write_content(directory / "events.jsonl",
                         "{\"timestamp_ns\":1,\"button\":\"a\",\"pressed\":true}\n"
                         "{\"timestamp_ns\":2,\"bus\":\"Freeze\"}\n"
                         "{\"timestamp_ns\":3,\"button\":\"a\",\"pressed\":1}\n"
                         "{\"timestamp_ns\":4,\"button\":\"a\"}\n"
                         "7\n"
                         "{\"timestamp_ns\":6,\"button\":\"a\",\"pressed\":fal");
  const auto buttons = open_replay_buttons(directory.path(), due_at({}));
  const auto trouble = std::get<DeviceTrouble>(buttons->next().value());
  EXPECT_EQ(trouble.device, (directory / "events.jsonl").string());
  EXPECT_EQ(trouble.what, "lines 3 to 6 unreadable, skipped");
  EXPECT_FALSE(trouble.lost);
  EXPECT_EQ(due_events(*buttons), (std::vector<ButtonEvent>{{"a", true, 1}}));
}

TEST(ReplayButtons, ASessionWithoutEventsEndsAtOnce) {
  const test::TemporaryDirectory directory;
  const auto buttons = open_replay_buttons(directory.path(), due_at({}));
  EXPECT_TRUE(std::holds_alternative<EndOfStream>(buttons->next().value()));
}

TEST(ReplayButtons, WrongSpeedsAreErrors) {
  EXPECT_THROW(replay_buttons({}, "take", due_at({}, -1)), Error);
}

}  // namespace previz::replay_buttons_test
