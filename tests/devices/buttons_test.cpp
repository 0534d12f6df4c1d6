// Buttons: what contacts and reports become; and on real kernel devices (gpio-sim, uhid) where the
// machine has them.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/uhid.h>
#include <poll.h>

#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string_view>

#include "drivers/button_drivers.hpp"
#include "drivers/debouncer.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"
#include "drivers/hid/hid_buttons.hpp"

namespace previz {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using Report = std::vector<std::uint8_t>;

// ---- contacts

TEST(DebouncerTest, TheFirstEdgeCountsAtOnceAndBouncingDoesNot) {
  Debouncer contact(5);
  EXPECT_TRUE(contact.edge(true, 100));
  EXPECT_TRUE(contact.pressed());
  EXPECT_EQ(contact.told_ns(), 100);
  EXPECT_FALSE(contact.edge(false, 101));
  EXPECT_FALSE(contact.edge(true, 102));
  EXPECT_FALSE(contact.settle(104));
  EXPECT_FALSE(contact.settle(105));  // as it was told
  EXPECT_TRUE(contact.edge(false, 200));
  EXPECT_FALSE(contact.pressed());
}

TEST(DebouncerTest, APressShorterThanTheWindowIsReleasedAtItsEnd) {
  Debouncer contact(5);
  EXPECT_TRUE(contact.edge(true, 100));
  EXPECT_FALSE(contact.edge(false, 103));
  EXPECT_EQ(contact.settles_ns(), 105);
  EXPECT_TRUE(contact.settle(106));
  EXPECT_FALSE(contact.pressed());
  EXPECT_EQ(contact.told_ns(), 105);
}

TEST(DebouncerTest, WithoutAWindowEveryEdgeCounts) {
  Debouncer contact(0);
  EXPECT_TRUE(contact.edge(true, 1));
  EXPECT_TRUE(contact.edge(false, 2));
  EXPECT_FALSE(contact.edge(false, 3));
}

// ---- reports

TEST(HidSelector, ReadsBitsAndValues) {
  EXPECT_TRUE(hid::parse_selector("1.3").pressed(Report{0, 8}));
  EXPECT_FALSE(hid::parse_selector("1.3").pressed(Report{8, 0}));
  EXPECT_TRUE(hid::parse_selector("2-7=1e").pressed(Report{0, 0, 4, 0x1e, 0, 0, 0, 0}));
  EXPECT_FALSE(hid::parse_selector("2-7=1e").pressed(Report{0x1e, 0, 4, 5, 0, 0, 0, 0}));
  EXPECT_TRUE(hid::parse_selector("3/1.0").speaks(Report{3, 1}));
  EXPECT_FALSE(hid::parse_selector("3/1.0").speaks(Report{4, 1}));
  EXPECT_FALSE(hid::parse_selector("3/1.0").too_short(Report{4}));
  EXPECT_TRUE(hid::parse_selector("3/1.0").too_short(Report{3}));
}

TEST(HidSelector, MistakesAreQuoted) {
  for (const char* text : {"", "1", "1.8", "1.", ".1", "x.1", "1=", "1=100", "7-2=1e", "256/1.0",
                           "1-=2", "99999.1", "1.0 "})
    EXPECT_THROW(hid::parse_selector(text), Error) << text;
}

TEST(HidSelector, LearnsWhatWentDown) {
  EXPECT_THAT(hid::pressed_between(Report{0, 0}, Report{0, 4}), ElementsAre("1.2"));
  EXPECT_THAT(hid::pressed_between(Report{0, 4}, Report{0, 0}), ElementsAre());
  EXPECT_THAT(hid::pressed_between(Report{0, 0, 0}, Report{0, 0, 0x1e}), ElementsAre("2=1e"));
  for (const std::string& learned : hid::pressed_between(Report{0, 0}, Report{1, 0x1f}))
    EXPECT_TRUE(hid::parse_selector(learned).pressed(Report{1, 0x1f})) << learned;
}

TEST(HidReports, BecomeEdges) {
  hid::ReportReader reader({"hid:1:1:0.0", "hid:1:1:0.1"});
  EXPECT_THAT(reader.read(Report{1}, 10), ElementsAre(ButtonEvent{"hid:1:1:0.0", true, 10}));
  EXPECT_THAT(reader.read(Report{1}, 11), ElementsAre());
  EXPECT_THAT(reader.read(Report{2}, 12), ElementsAre(ButtonEvent{"hid:1:1:0.0", false, 12},
                                                      ButtonEvent{"hid:1:1:0.1", true, 12}));
  EXPECT_THAT(reader.release_all(13), ElementsAre(ButtonEvent{"hid:1:1:0.1", false, 13}));
}

TEST(HidReports, OfAnyLengthDoNoHarm) {
  hid::ReportReader reader({"hid:1:1:3.0", "hid:1:1:2-5=1e"});
  for (std::size_t size = 0; size < 10; ++size) {
    const Report report(size, 0xff);
    reader.read(report, 0);
  }
  EXPECT_EQ(reader.reports_cut_short(), 6u);  // of 0 to 5 bytes
}

// ---- names

TEST(ButtonNames, MistakesSayWhatIsAllowed) {
  const auto error_of = [](const std::string& name) -> std::string {
    try {
      open_buttons(std::vector{name}, {});
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_THAT(error_of("midi:1:2"), HasSubstr("this build drives no \"midi\" buttons"));
  EXPECT_THAT(error_of("gpio:chip"), HasSubstr("gpio:CHIP:LINE"));
  EXPECT_THAT(error_of("hid:12:zz:0.1"), HasSubstr("hexadecimal"));
  EXPECT_THAT(error_of("hid:12:13:0.9"), HasSubstr("BYTE.BIT"));
}

// ---- devices

// The next event within ten seconds, waited for as an event loop does.
std::optional<ButtonsEvent> wait_for_event(Buttons& buttons) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (std::chrono::steady_clock::now() < end) {
    pollfd fd{buttons.fd(), POLLIN, 0};
    poll(&fd, 1, 1000);
    if (std::optional<ButtonsEvent> event = buttons.next()) return event;
  }
  return std::nullopt;
}

void expect_edge(Buttons& buttons, const std::string& name, bool pressed) {
  const std::optional<ButtonsEvent> event = wait_for_event(buttons);
  ASSERT_TRUE(event) << name;
  ASSERT_TRUE(std::holds_alternative<ButtonEvent>(*event)) << std::get<DeviceTrouble>(*event).what;
  EXPECT_EQ(std::get<ButtonEvent>(*event).button, name);
  EXPECT_EQ(std::get<ButtonEvent>(*event).pressed, pressed);
}

void expect_trouble(Buttons& buttons, const std::string& words) {
  const std::optional<ButtonsEvent> event = wait_for_event(buttons);
  ASSERT_TRUE(event);
  ASSERT_TRUE(std::holds_alternative<DeviceTrouble>(*event));
  EXPECT_THAT(std::get<DeviceTrouble>(*event).what, HasSubstr(words));
  EXPECT_FALSE(std::get<DeviceTrouble>(*event).lost);
}

TEST(ButtonDevices, WhatIsNotThereIsToldOnceAndWaitedFor) {
  for (const char* name : {"gpio:no such chip:1", "hid:1209:fffe:0.1"}) {
    const auto buttons = open_buttons(std::vector<std::string>{name}, {});
    ASSERT_EQ(buttons.size(), 1u);
    expect_trouble(*buttons[0], "until it is there");
    EXPECT_FALSE(buttons[0]->next());
  }
}

// The chip of tests/rig_vm: four lines button1..button4, active high.
TEST(ButtonDevices, LinesOfGpioSim) {
  const std::filesystem::path config = "/sys/kernel/config/gpio-sim/rig";
  if (!std::filesystem::exists(config)) GTEST_SKIP() << "this machine has no gpio-sim chip \"rig\"";
  std::string device, chip;
  std::ifstream(config / "dev_name") >> device;
  std::ifstream(config / "bank0/chip_name") >> chip;
  const auto pull = [&](int line, const char* way) {
    std::ofstream(std::filesystem::path("/sys/devices/platform") / device / chip /
                  ("sim_gpio" + std::to_string(line)) / "pull")
        << way;
  };
  ButtonSettings settings;
  settings.active_low = false;
  settings.bias = ButtonSettings::Bias::as_is;
  const std::vector<std::string> names{"gpio:rig-buttons:button1", "gpio:rig-buttons:button3"};
  const auto buttons = open_buttons(names, settings);
  ASSERT_EQ(buttons.size(), 1u);
  EXPECT_FALSE(buttons[0]->next());
  for (int i = 0; i < 3; ++i) {
    for (const int line : {0, 2}) {
      pull(line, "pull-up");
      expect_edge(*buttons[0], names[static_cast<std::size_t>(line / 2)], true);
      pull(line, "pull-down");
      expect_edge(*buttons[0], names[static_cast<std::size_t>(line / 2)], false);
    }
  }
  const std::vector<FoundButton> found = button_drivers().front().find();
  EXPECT_TRUE(std::ranges::any_of(
      found, [](const FoundButton& button) { return button.name == "gpio:rig-buttons:button2"; }));
}

// A pad of eight buttons made through /dev/uhid: to hidraw and hidapi it is real.
class UhidPad {
 public:
  static bool possible() { return access("/dev/uhid", W_OK) == 0; }

  UhidPad() : descriptor_(open("/dev/uhid", O_RDWR | O_CLOEXEC)) {
    static constexpr std::uint8_t description[] = {
        0x06, 0x00, 0xff, 0x09, 0x01, 0xa1, 0x01,  // vendor's page, application
        0x05, 0x09, 0x19, 0x01, 0x29, 0x08,        // buttons 1 to 8
        0x15, 0x00, 0x25, 0x01, 0x75, 0x01, 0x95, 0x08, 0x81, 0x02, 0xc0};
    uhid_event event{};
    event.type = UHID_CREATE2;
    std::string_view("previzd test pad").copy(reinterpret_cast<char*>(event.u.create2.name), 16);
    std::string_view("PREVIZ1").copy(reinterpret_cast<char*>(event.u.create2.uniq), 7);
    event.u.create2.rd_size = sizeof description;
    event.u.create2.bus = 3;  // USB
    event.u.create2.vendor = 0x1209;
    event.u.create2.product = 0x0001;
    std::memcpy(event.u.create2.rd_data, description, sizeof description);
    send(event);
  }

  void report(const Report& bytes) {
    uhid_event event{};
    event.type = UHID_INPUT2;
    event.u.input2.size = static_cast<__u16>(bytes.size());
    std::memcpy(event.u.input2.data, bytes.data(), bytes.size());
    send(event);
  }

 private:
  void send(const uhid_event& event) const {
    ASSERT_EQ(write(descriptor_.get(), &event, sizeof event), static_cast<ssize_t>(sizeof event));
  }
  OwnedDescriptor descriptor_;
};

TEST(ButtonDevices, APadOfUhidPressedUnpluggedAndBack) {
  if (!UhidPad::possible()) GTEST_SKIP() << "this machine has no /dev/uhid that may be written";
  const std::vector<std::string> names{"hid:1209:0001:PREVIZ1:0.0", "hid:1209:0001:PREVIZ1:0.5"};
  const auto buttons = open_buttons(names, {});
  ASSERT_EQ(buttons.size(), 1u);
  expect_trouble(*buttons[0], "not there");
  for (int i = 0; i < 2; ++i) {
    auto pad = std::make_unique<UhidPad>();
    // Reports before the driver has found the pad are nobody's; it looks once a second.
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    std::optional<ButtonsEvent> first;
    while (!first && std::chrono::steady_clock::now() < end) {
      pad->report({0});
      pad->report({1});
      pollfd fd{buttons[0]->fd(), POLLIN, 0};
      if (poll(&fd, 1, 100) > 0) first = buttons[0]->next();
    }
    ASSERT_TRUE(first);
    EXPECT_EQ(std::get<ButtonEvent>(*first).button, names[0]);
    while (buttons[0]->next()) {
    }
    pad->report({1});
    pad->report({0x21});
    std::optional<ButtonsEvent> event;
    while ((event = wait_for_event(*buttons[0])) &&
           std::get<ButtonEvent>(*event).button != names[1]) {
    }
    ASSERT_TRUE(event);
    EXPECT_TRUE(std::get<ButtonEvent>(*event).pressed);
    pad.reset();
    expect_edge(*buttons[0], names[0], false);  // released by being unplugged
    expect_edge(*buttons[0], names[1], false);
    expect_trouble(*buttons[0], "unplugged");
  }
}

}  // namespace
}  // namespace previz
