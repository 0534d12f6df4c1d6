#include "drivers/hid/hid_buttons.hpp"

#include <sys/eventfd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <condition_variable>
#include <cstring>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <thread>

#include "drivers/button_queue.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"
#include "drivers/hid/backend.hpp"
#include "drivers/host_clock.hpp"

namespace previz {
namespace {

constexpr int poll_ms = 100;  // how late a stop may be noticed
constexpr std::chrono::seconds retry_interval{1};
constexpr const char* cut_short = "reports too short for a button";
constexpr const char* not_taken = "events dropped, not read in time";

struct DeviceName {
  unsigned short vendor = 0, product = 0;
  std::string serial;  // empty: any
};

// Removes the part of `text` before the next colon, and the colon, and returns the part.
std::string take_part(std::string& text) {
  const std::size_t end = text.find(':');
  std::string part = text.substr(0, end);
  text.erase(0, end == std::string::npos ? end : end + 1);
  return part;
}

std::optional<unsigned short> hexadecimal(const std::string& text) {
  unsigned short value = 0;
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value, 16);
  if (text.empty() || result.ec != std::errc{} || result.ptr != end) return std::nullopt;
  return value;
}

DeviceName parse_device(const std::string& device) {
  std::string serial = device;  // it may have colons: some pads give their network address
  take_part(serial);
  const auto vendor = hexadecimal(take_part(serial)), product = hexadecimal(take_part(serial));
  if (vendor && product) return {*vendor, *product, serial};
  throw Error("\"" + device +
              "\": allowed is hid:VENDOR:PRODUCT or hid:VENDOR:PRODUCT:SERIAL, "
              "VENDOR and PRODUCT hexadecimal");
}

std::string narrow(const wchar_t* text) {
  std::string narrow;
  for (; text && *text; ++text) narrow += *text < 0x80 ? static_cast<char>(*text) : '?';
  return narrow;
}

hid::Device open_device(std::span<const hid::Backend> backends, const DeviceName& name) {
  const std::wstring serial(name.serial.begin(), name.serial.end());
  const std::lock_guard lock(hid::library_mutex());
  for (const hid::Backend& backend : backends)
    if (hid_device* device =
            backend.open(name.vendor, name.product, serial.empty() ? nullptr : serial.c_str()))
      return {backend, device};
  return {};
}

// A thread reads the device, since hidapi has no descriptor to wait on.
class HidButtons final : public Buttons {
 public:
  HidButtons(std::span<const hid::Backend> backends, std::string device,
             const std::vector<std::string>& names)
      : backends_(backends),
        device_(std::move(device)),
        device_name_(parse_device(device_)),
        reader_(names),
        signal_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (!signal_) throw Error(device_ + ": cannot be polled: " + std::strerror(errno));
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }

  std::string name() const override { return device_; }
  int fd() const override { return signal_.get(); }

  DeviceCounters counters() const override {
    const std::lock_guard lock(mutex_);
    return counters_;
  }

  std::optional<ButtonsEvent> next() override {
    const std::lock_guard lock(mutex_);
    std::optional<ButtonsEvent> event = events_.pop();
    if (!event) {
      eventfd_t ignored = 0;
      eventfd_read(signal_.get(), &ignored);
    }
    return event;
  }

 private:
  // Whatever fails, the daemon goes on, and the device is opened anew.
  void run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      try {
        use_device(stop);
      } catch (const std::exception& error) {
        fail(error.what());
      } catch (...) {
        fail("unknown exception");
      }
      std::unique_lock lock(mutex_);
      wake_.wait_for(lock, stop, retry_interval, [] { return false; });
    }
  }

  // Reads the device until it is lost, if it is there.
  void use_device(const std::stop_token& stop) {
    const hid::Device device = open_device(backends_, device_name_);
    count(device ? "opened" : "not opened");
    if (device) {
      count(std::string("opened through ") + device.backend());
      reported_ = false;
      read(device, stop);
      if (stop.stop_requested()) return;
      count("lost");
      release_all();
    }
    if (!std::exchange(reported_, true))
      push(DeviceTrouble{device_, device ? "was unplugged; waiting for it to return"
                                         : "not found, or no permission to open it; retrying until "
                                           "it opens"});
  }

  // Where there is no memory even for that, the next try may report it.
  void fail(const char* why) noexcept {
    try {
      count("failed");
      release_all();
      if (!std::exchange(reported_, true))
        push(DeviceTrouble{device_, std::string("cannot be read: ") + why + "; reopening it"});
    } catch (...) {
    }
  }

  void release_all() {
    for (ButtonEvent& event : reader_.release_all(monotonic_ns())) push(std::move(event));
  }

  void read(const hid::Device& device, const std::stop_token& stop) {
    std::array<unsigned char, 4096> report{};
    while (!stop.stop_requested()) {
      const int size = device.read(report, poll_ms);
      if (size < 0) return;
      if (size > 0) take({report.data(), static_cast<std::size_t>(size)});
    }
  }

  void take(std::span<const std::uint8_t> report) {
    const std::uint64_t short_before = reader_.reports_cut_short();
    const std::uint64_t left_out_before = reader_.presses_left_out();
    count("reports");
    for (ButtonEvent& event : reader_.read(report, monotonic_ns())) push(std::move(event));
    count(presses_babbled, reader_.presses_left_out() - left_out_before);
    for (const std::string& button : reader_.take_babblers()) push(babbling(device_, button));
    if (reader_.reports_cut_short() == short_before) return;
    count(cut_short);
    if (short_before == 0)
      push(DeviceTrouble{device_, "sends reports of " + std::to_string(report.size()) +
                                      " bytes, too short for a button in the set file"});
  }

  void count(const std::string& what, std::uint64_t by = 1) {
    const std::lock_guard lock(mutex_);
    counters_[what] += by;
  }

  void push(ButtonsEvent event) {
    const std::lock_guard lock(mutex_);
    if (!events_.push(std::move(event))) ++counters_[not_taken];
    eventfd_write(signal_.get(), 1);
  }

  const std::span<const hid::Backend> backends_;
  const std::string device_;
  const DeviceName device_name_;
  hid::ReportReader reader_;  // used by the thread only
  bool reported_ = false;     // used by the thread only: the crew knows that there is no device
  OwnedDescriptor signal_;
  mutable std::mutex mutex_;
  std::condition_variable_any wake_;
  ButtonQueue events_;
  DeviceCounters counters_{{"opened", 0},  {"not opened", 0}, {"lost", 0},          {"failed", 0},
                           {"reports", 0}, {cut_short, 0},    {presses_babbled, 0}, {not_taken, 0}};
  std::jthread thread_;
};

}  // namespace

namespace hid {

ReportReader::ReportReader(const std::vector<std::string>& names) {
  for (const std::string& name : names)
    buttons_.push_back({name, parse_selector(name.substr(name.rfind(':') + 1)), false, false, {}});
}

std::vector<ButtonEvent> ReportReader::read(std::span<const std::uint8_t> report,
                                            std::int64_t time_ns) {
  std::vector<ButtonEvent> events;
  if (std::ranges::any_of(
          buttons_, [&](const Button& button) { return button.selector.too_short(report); })) {
    ++reports_cut_short_;
    return events;
  }
  for (Button& button : buttons_) {
    if (!button.selector.speaks(report)) continue;
    const bool down = button.selector.pressed(report);
    if (std::exchange(button.down, down) == down) continue;
    const bool pressed = down && counts(button, time_ns);
    if (std::exchange(button.pressed, pressed) != pressed)
      events.push_back({button.name, pressed, time_ns});
  }
  return events;
}

bool ReportReader::counts(Button& button, std::int64_t time_ns) {
  const PressLimit::Verdict verdict = button.limit.judge(time_ns);
  if (verdict == PressLimit::Verdict::counts) return true;
  if (verdict == PressLimit::Verdict::begins_to_babble) babblers_.push_back(button.name);
  ++presses_left_out_;
  return false;
}

std::vector<ButtonEvent> ReportReader::release_all(std::int64_t time_ns) {
  std::vector<ButtonEvent> events;
  for (Button& button : buttons_) {
    button.down = false;
    if (std::exchange(button.pressed, false)) events.push_back({button.name, false, time_ns});
  }
  return events;
}

void learn(const std::string& device, const std::function<bool()>& stop,
           const std::function<void(const std::string& name)>& pressed) {
  const Device opened = open_device(backends(), parse_device(device));
  if (!opened) throw Error(device + ": cannot be opened");
  std::array<unsigned char, 4096> report{};
  // The last reports by number and length; the first of a kind is compared with one in which
  // nothing is held.
  std::map<std::pair<unsigned char, int>, std::vector<std::uint8_t>> before;
  while (!stop()) {
    const int size = opened.read(report, poll_ms);
    if (size < 0) throw Error(device + ": was unplugged");
    if (size == 0) continue;
    std::vector<std::uint8_t>& last = before[{size > 1 ? report[0] : 0, size}];
    last.resize(static_cast<std::size_t>(size));
    const std::span<const std::uint8_t> now(report.data(), last.size());
    for (const std::string& selector : pressed_between(last, now)) pressed(device + ":" + selector);
    last.assign(now.begin(), now.end());
  }
}

}  // namespace hid

// Returns hid:VENDOR:PRODUCT[:SERIAL]:SELECTOR without the selector.
std::string hid_device_of(const std::string& name) {
  std::string device = name.substr(0, name.rfind(':'));
  parse_device(device);
  hid::parse_selector(name.substr(name.rfind(':') + 1));
  return device;
}

std::unique_ptr<Buttons> open_hid(const std::string& device, const std::vector<std::string>& names,
                                  const ButtonSettings&) {
  return hid::open_through(hid::backends(), device, names);
}

std::unique_ptr<Buttons> hid::open_through(std::span<const Backend> backends,
                                           const std::string& device,
                                           const std::vector<std::string>& names) {
  return std::make_unique<HidButtons>(backends, device, names);
}

std::vector<FoundButton> find_hid() {
  std::vector<FoundButton> found;
  const std::lock_guard lock(hid::library_mutex());
  for (const hid::Backend& backend : hid::backends()) {
    std::vector<FoundButton> its;
    hid_device_info* all = backend.enumerate(0, 0);
    for (const hid_device_info* info = all; info; info = info->next) {
      char ids[16];
      std::snprintf(ids, sizeof ids, "%04x:%04x", info->vendor_id, info->product_id);
      const std::string device = std::string("hid:") + ids;
      // libusb finds again what hidraw has found.
      if (std::ranges::any_of(found, [&](const FoundButton& other) {
            return other.name == device || other.name.starts_with(device + ':');
          }))
        continue;
      const std::string serial = narrow(info->serial_number);
      its.push_back({device + (serial.empty() ? "" : ":" + serial),
                     narrow(info->manufacturer_string) + " " + narrow(info->product_string)});
    }
    backend.free_enumeration(all);
    found.insert(found.end(), its.begin(), its.end());
  }
  return found;
}

}  // namespace previz
