// Buttons: what contacts and reports become; and on real kernel devices (gpio-sim, uhid) where the
// machine has them.
#include <fcntl.h>
#include <poll.h>

#include "drivers/button_drivers.hpp"
#include "drivers/button_queue.hpp"
#include "drivers/debouncer.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/gpio/gpio_buttons.hpp"
#include "drivers/hid/backend.hpp"
#include "drivers/hid/hid_buttons.hpp"
#include "tests/devices/leftovers.hpp"
#include "tests/devices/uhid_pad.hpp"
#include "tests/support/test.hpp"

namespace previz::buttons_test {

using test::UhidPad;
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
  EXPECT_FALSE(contact.settle(105));  // unchanged since the last report
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

// 50 presses a second, each of 10 ms, then one after a second and a half.
TEST(DebouncerTest, AContactThatBabblesIsLeftOutUntilItIsQuiet) {
  constexpr std::int64_t ms = 1'000'000;
  Debouncer contact(5 * ms);
  std::size_t presses = 0, releases = 0;
  for (std::int64_t time = 0; time < 3000 * ms; time += 20 * ms) {
    contact.settle(time);
    if (contact.edge(true, time)) ++presses;
    contact.settle(time + 5 * ms);
    if (contact.edge(false, time + 10 * ms)) ++releases;
  }
  EXPECT_EQ(presses, PressLimit::most_presses);
  EXPECT_EQ(releases, PressLimit::most_presses);
  EXPECT_FALSE(contact.pressed());
  EXPECT_EQ(contact.presses_left_out(), 150 - PressLimit::most_presses);
  EXPECT_EQ(contact.times_babbled(), 1u);
  EXPECT_TRUE(contact.edge(true, 4500 * ms));
  EXPECT_TRUE(contact.pressed());
}

TEST(DebouncerTest, AContactThatEndsItsBabblingClosedIsReleased) {
  Debouncer contact(0);
  std::int64_t time = 0;
  for (std::size_t i = 0; i < PressLimit::most_presses + 1; ++i) {
    if (i > 0) contact.edge(false, ++time);
    contact.edge(true, ++time);
  }
  EXPECT_FALSE(contact.pressed());
  EXPECT_FALSE(contact.settle(time + 10 * PressLimit::period_ns));
  EXPECT_FALSE(contact.edge(true, time + 10 * PressLimit::period_ns));  // closed all the time
  EXPECT_FALSE(contact.edge(false, time + 11 * PressLimit::period_ns));
  EXPECT_TRUE(contact.edge(true, time + 12 * PressLimit::period_ns));
}

// A hand does not: the fastest that the limit allows, for ten seconds.
TEST(DebouncerTest, AHandIsNeverLeftOut) {
  Debouncer contact(5'000'000);
  constexpr std::int64_t apart = PressLimit::period_ns / std::int64_t{PressLimit::most_presses};
  for (std::int64_t time = 0; time < 10 * PressLimit::period_ns; time += apart) {
    EXPECT_TRUE(contact.edge(true, time)) << time;
    EXPECT_TRUE(contact.edge(false, time + apart / 2)) << time;
  }
  EXPECT_EQ(contact.presses_left_out(), 0u);
}

// ---- events that nobody takes

TEST(ButtonQueueTest, LeavesOutPressesWithTheirReleasesOnceItIsFull) {
  ButtonQueue queue;
  EXPECT_TRUE(queue.push(ButtonEvent{"held", true, 0}));
  for (std::size_t i = 1; i < ButtonQueue::most; ++i)
    EXPECT_TRUE(queue.push(DeviceTrouble{"pad", "is wet"}));
  EXPECT_FALSE(queue.push(ButtonEvent{"late", true, 1}));
  EXPECT_FALSE(queue.push(DeviceTrouble{"pad", "is wet"}));
  EXPECT_FALSE(queue.push(ButtonEvent{"late", false, 2}));
  EXPECT_TRUE(queue.push(ButtonEvent{"held", false, 3}));
  for (std::size_t i = 0; i < ButtonQueue::most; ++i) EXPECT_TRUE(queue.pop());
  EXPECT_EQ(std::get<ButtonEvent>(queue.pop().value()), (ButtonEvent{"held", false, 3}));
  EXPECT_FALSE(queue.pop());
  EXPECT_TRUE(queue.push(ButtonEvent{"late", true, 4}));
  EXPECT_TRUE(queue.push(ButtonEvent{"late", false, 5}));
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

// A thousand reports a second, each of which changes two buttons. A third one, of a hand, comes
// through.
TEST(HidReports, OfAHostilePadAreLeftOut) {
  hid::ReportReader reader({"hid:1:1:0.0", "hid:1:1:0.1", "hid:1:1:0.2"});
  std::map<std::string, std::size_t> presses, edges;
  std::vector<std::string> babblers;
  for (std::int64_t i = 0; i < 10'000; ++i) {
    const auto held = static_cast<std::uint8_t>((i % 2 ? 3 : 0) | (i / 500 % 2 ? 4 : 0));
    for (const ButtonEvent& event : reader.read(Report{held}, i * 1'000'000)) {
      presses[event.button] += event.pressed ? 1 : 0;
      ++edges[event.button];
    }
    for (const std::string& button : reader.take_babblers()) babblers.push_back(button);
  }
  for (const char* button : {"hid:1:1:0.0", "hid:1:1:0.1"}) {
    EXPECT_EQ(presses[button], PressLimit::most_presses);
    EXPECT_EQ(edges[button], 2 * PressLimit::most_presses);
  }
  EXPECT_EQ(edges["hid:1:1:0.2"], 19u);  // every half second from the first one on
  EXPECT_THAT(babblers, ElementsAre("hid:1:1:0.0", "hid:1:1:0.1"));
  EXPECT_EQ(reader.presses_left_out(), 2 * (5000 - PressLimit::most_presses));
  EXPECT_THAT(reader.release_all(10'000'000'000),
              ElementsAre(ButtonEvent{"hid:1:1:0.2", false, 10'000'000'000}));
}

TEST(HidReports, OfAnyLengthDoNoHarm) {
  hid::ReportReader reader({"hid:1:1:3.0", "hid:1:1:2-5=1e"});
  for (std::size_t size = 0; size < 10; ++size) {
    const Report report(size, 0xff);
    const std::vector<ButtonEvent> events = reader.read(report, 0);
    if (size < 6) {
      EXPECT_THAT(events, ElementsAre()) << size;  // also where the first button's byte is there
    }
  }
  EXPECT_EQ(reader.reports_cut_short(), 6u);  // of 0 to 5 bytes
}

// ---- names

TEST(ButtonNames, MistakesSayWhatIsAllowed) {
  const auto error_of = [](const std::string& name) {
    return test::error_of([&] { open_buttons(std::vector{name}, {}); });
  };
  EXPECT_THAT(error_of("midi:1:2"), HasSubstr("this build supports no \"midi\" buttons"));
  EXPECT_THAT(error_of("gpio:chip"), HasSubstr("gpio:CHIP:LINE"));
  EXPECT_THAT(error_of("hid:12:zz:0.1"), HasSubstr("hexadecimal"));
  EXPECT_THAT(error_of("hid:12:13:0.9"), HasSubstr("BYTE.BIT"));
}

// A chip's label and a pad's serial number may have colons: ACPI's and Bluetooth's do.
TEST(ButtonNames, MayHaveColonsInTheMiddle) {
  EXPECT_EQ(gpio_device_of("gpio:INTC1057:00:12"), "gpio:INTC1057:00");
  EXPECT_EQ(hid_device_of("hid:054c:09cc:aa:bb:cc:dd:ee:ff:5.4"),
            "hid:054c:09cc:aa:bb:cc:dd:ee:ff");
  EXPECT_EQ(hid_device_of("hid:054c:09cc:5.4"), "hid:054c:09cc");
}

TEST(ButtonWiring, ALinesOwnGoesBeforeItsChips) {
  ButtonSettings settings;
  settings.wiring["gpio:pads"] = {false, ContactWiring::Bias::as_is, 0.01};
  settings.wiring["gpio:pads:stop"] = {true, ContactWiring::Bias::none, 0};
  EXPECT_EQ(settings.wiring_of("gpio:pads:go"), settings.wiring["gpio:pads"]);
  EXPECT_EQ(settings.wiring_of("gpio:pads:stop"), settings.wiring["gpio:pads:stop"]);
  EXPECT_EQ(settings.wiring_of("gpio:others:go"), ContactWiring{});
}

// ---- devices

bool is_readable(const Buttons& buttons, int within_ms) {
  pollfd fd{buttons.fd(), POLLIN, 0};
  return poll(&fd, 1, within_ms) > 0;
}

// The next event within ten seconds, waited for as an event loop does.
std::optional<ButtonsEvent> wait_for_event(Buttons& buttons) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (std::chrono::steady_clock::now() < end) {
    is_readable(buttons, 1000);
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

// Returns whether the device is opened once more; events that come meanwhile are taken.
bool opens_again(Buttons& buttons, std::uint64_t opened_before) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (std::chrono::steady_clock::now() < end) {
    while (buttons.next()) {
    }
    if (buttons.counters().at("opened") > opened_before) return true;
    is_readable(buttons, 50);
  }
  return false;
}

TEST(ButtonDevices, WhatIsNotThereIsToldOnceAndWaitedFor) {
  for (const char* name : {"gpio:no such chip:1", "hid:1209:fffe:0.1"}) {
    const auto buttons = open_buttons(std::vector<std::string>{name}, {});
    ASSERT_EQ(buttons.size(), 1u);
    expect_trouble(*buttons[0], "retrying until");
    EXPECT_FALSE(buttons[0]->next());
    EXPECT_GE(buttons[0]->counters().at("not opened"), 1u);
    EXPECT_EQ(buttons[0]->counters().at("opened"), 0u);
  }
}

// A back end of HID whose device cannot be opened at first, then cannot be read, and then is
// pressed: both failures are exceptions.
struct FailingPad {
  static inline std::atomic<int> opened = 0, reads = 0;

  static hid_device* open(unsigned short, unsigned short, const wchar_t*) {
    if (++opened == 1) throw std::runtime_error("no memory to open it");
    return reinterpret_cast<hid_device*>(&opened);
  }
  static void close(hid_device*) {}
  static int read(hid_device*, unsigned char* report, std::size_t, int) {
    const int times = ++reads;
    if (times == 2) throw std::runtime_error("no memory to read it");
    if (times > 3) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    report[0] = 1;
    return 1;
  }
};

TEST(ButtonDevices, AnExceptionInAPadsThreadIsATroubleAndThePadIsOpenedAnew) {
  const hid::Backend backend{"fake",           FailingPad::open, FailingPad::close,
                             FailingPad::read, nullptr,          nullptr};
  const std::string name = "hid:1209:0001:0.0";
  const auto buttons = hid::open_through(std::span(&backend, 1), "hid:1209:0001", {name});
  ASSERT_NO_FATAL_FAILURE(expect_trouble(*buttons, "no memory to open it"));
  ASSERT_NO_FATAL_FAILURE(expect_edge(*buttons, name, true));
  ASSERT_NO_FATAL_FAILURE(expect_edge(*buttons, name, false));  // released by the failure
  ASSERT_NO_FATAL_FAILURE(expect_trouble(*buttons, "no memory to read it"));
  ASSERT_NO_FATAL_FAILURE(expect_edge(*buttons, name, true));
  EXPECT_EQ(buttons->counters().at("failed"), 2u);
  EXPECT_EQ(buttons->counters().at("opened"), 2u);
}

// A pad on the USB whose cable is the file PREVIZ_TEST_USB_PAD (tests/rig_vm), where hidraw may not
// be opened.
TEST(ButtonDevices, APadOnTheUsbIsReadPastTheKernel) {
  const char* cable = std::getenv("PREVIZ_TEST_USB_PAD");
  if (!cable) GTEST_SKIP() << "there is no pad on the USB to be pressed (tests/rig_vm)";
  const std::filesystem::path held = std::string(cable) + ".held";
  const std::string name = "hid:1209:0003:RIGPAD1:0.0";
  const auto buttons = open_buttons(std::vector{name}, {});
  ASSERT_TRUE(opens_again(*buttons[0], 0));
  const auto press = [&] {
    std::ofstream(held).close();
    expect_edge(*buttons[0], name, true);
  };
  ASSERT_NO_FATAL_FAILURE(press());
  std::filesystem::remove(held);
  ASSERT_NO_FATAL_FAILURE(expect_edge(*buttons[0], name, false));
  ASSERT_NO_FATAL_FAILURE(press());
  std::filesystem::remove(cable);
  ASSERT_NO_FATAL_FAILURE(expect_edge(*buttons[0], name, false));  // released by its going
  ASSERT_NO_FATAL_FAILURE(expect_trouble(*buttons[0], "unplugged"));
  std::filesystem::remove(held);
  std::ofstream(cable).close();
  ASSERT_TRUE(opens_again(*buttons[0], 1));
  ASSERT_NO_FATAL_FAILURE(press());
  std::filesystem::remove(held);
  const DeviceCounters counters = buttons[0]->counters();
  EXPECT_EQ(counters.at("opened through libusb"), counters.at("opened"));
}

// The gpio-sim chip "rig" with the lines button1 to button4, active high.
class GpioSim {
 public:
  static bool possible() { return std::filesystem::exists(config / "live"); }

  static void pull(int line, const char* way) {
    std::string device, chip;
    std::ifstream(config / "dev_name") >> device;
    std::ifstream(config / "bank0/chip_name") >> chip;
    std::ofstream(std::filesystem::path("/sys/devices/platform") / device / chip /
                  ("sim_gpio" + std::to_string(line)) / "pull")
        << way;
  }
  static void plug(bool in) { std::ofstream(config / "live") << (in ? 1 : 0); }

  static ButtonSettings settings() {
    ButtonSettings settings;
    settings.wiring["gpio:rig-buttons"] = {false, ContactWiring::Bias::as_is, 0.005};
    return settings;
  }

 private:
  static inline const std::filesystem::path config = "/sys/kernel/config/gpio-sim/rig";
};

TEST(ButtonDevices, LinesOfGpioSim) {
  if (!GpioSim::possible()) GTEST_SKIP() << "this machine has no gpio-sim chip \"rig\"";
  const std::vector<std::string> names{"gpio:rig-buttons:button1", "gpio:rig-buttons:button3"};
  const auto buttons = open_buttons(names, GpioSim::settings());
  ASSERT_EQ(buttons.size(), 1u);
  EXPECT_FALSE(buttons[0]->next());
  for (int i = 0; i < 3; ++i) {
    for (const int line : {0, 2}) {
      GpioSim::pull(line, "pull-up");
      expect_edge(*buttons[0], names[static_cast<std::size_t>(line / 2)], true);
      GpioSim::pull(line, "pull-down");
      expect_edge(*buttons[0], names[static_cast<std::size_t>(line / 2)], false);
    }
  }
  const std::vector<FoundButton> found = button_drivers().front().find();
  EXPECT_TRUE(std::ranges::any_of(
      found, [](const FoundButton& button) { return button.name == "gpio:rig-buttons:button2"; }));
}

// What is left behind by `cycle`, a hundred times over, after a few that make what is made once.
void expect_nothing_left_behind(const std::function<void()>& cycle) {
  constexpr int cycles = 100, warm_cycles = 10;
  std::size_t descriptors = 0, bytes = 0;
  for (int i = 0; i < cycles; ++i) {
    if (i == warm_cycles) descriptors = test::open_descriptors(), bytes = test::live_bytes();
    ASSERT_NO_FATAL_FAILURE(cycle()) << "cycle " << i;
  }
  EXPECT_EQ(test::open_descriptors(), descriptors);
  // A device left behind in each cycle would be far more.
  EXPECT_LT(test::live_bytes(), bytes + (cycles - warm_cycles) * 256);
}

TEST(ButtonDevices, AGpioChipThatGoesAHundredTimes) {
  if (!GpioSim::possible()) GTEST_SKIP() << "this machine has no gpio-sim chip \"rig\"";
  const std::string name = "gpio:rig-buttons:button1";
  const auto buttons = open_buttons(std::vector{name}, GpioSim::settings());
  EXPECT_FALSE(buttons[0]->next());
  expect_nothing_left_behind([&] {
    GpioSim::pull(0, "pull-up");
    ASSERT_NO_FATAL_FAILURE(expect_edge(*buttons[0], name, true));
    GpioSim::plug(false);
    ASSERT_NO_FATAL_FAILURE(expect_edge(*buttons[0], name, false));  // released by its going
    ASSERT_NO_FATAL_FAILURE(expect_trouble(*buttons[0], "is lost"));
    const std::uint64_t opened = buttons[0]->counters().at("opened");
    GpioSim::plug(true);
    ASSERT_TRUE(opens_again(*buttons[0], opened));
  });
  EXPECT_EQ(buttons[0]->counters().at("lost"), 100u);
}

TEST(ButtonDevices, APadThatIsPulledAHundredTimes) {
  if (!UhidPad::possible()) GTEST_SKIP() << "this machine has no /dev/uhid that may be written";
  const auto buttons = open_buttons(std::vector<std::string>{"hid:1209:0001:PREVIZ1:0.0"}, {});
  ASSERT_NO_FATAL_FAILURE(expect_trouble(*buttons[0], "not found"));
  std::uint64_t opened = 0;
  expect_nothing_left_behind([&] {
    const auto pad = std::make_unique<UhidPad>("PREVIZ1");
    ASSERT_TRUE(opens_again(*buttons[0], opened));
    opened = buttons[0]->counters().at("opened");
    pad->report(Report{1});
    // The pad's end is reported after its earlier events, or instead of them.
  });
  EXPECT_GE(buttons[0]->counters().at("lost"), 99u);
}

TEST(ButtonDevices, APadOfUhidPressedUnpluggedAndBack) {
  if (!UhidPad::possible()) GTEST_SKIP() << "this machine has no /dev/uhid that may be written";
  const std::vector<std::string> names{"hid:1209:0001:PREVIZ1:0.0", "hid:1209:0001:PREVIZ1:0.5"};
  const auto buttons = open_buttons(names, {});
  ASSERT_EQ(buttons.size(), 1u);
  expect_trouble(*buttons[0], "not found");
  for (int i = 0; i < 2; ++i) {
    auto pad = std::make_unique<UhidPad>("PREVIZ1");
    // Reports before the driver has found the pad are nobody's; it looks once a second.
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    std::optional<ButtonsEvent> first;
    while (!first && std::chrono::steady_clock::now() < end) {
      pad->report(Report{0});
      pad->report(Report{1});
      if (is_readable(*buttons[0], 100)) first = buttons[0]->next();
    }
    ASSERT_TRUE(first);
    EXPECT_EQ(std::get<ButtonEvent>(*first).button, names[0]);
    while (buttons[0]->next()) {
    }
    pad->report(Report{1});
    pad->report(Report{0x21});
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

}  // namespace previz::buttons_test
