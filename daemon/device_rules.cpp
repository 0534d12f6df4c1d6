#include "daemon/device_rules.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

namespace previz {
namespace {

namespace fs = std::filesystem;

struct HidKind {
  std::string name;
  bool is_keyboard = false;
};

std::string text_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// Returns the folders below `folder`, without an error where there are none.
std::vector<fs::path> entries_of(const fs::path& folder) {
  std::error_code none;
  std::vector<fs::path> entries;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, none))
    entries.push_back(entry.path());
  std::ranges::sort(entries);
  return entries;
}

// Returns the value of a line NAME=VALUE, with nothing that could end a comment or a rule.
std::string value_of(const std::string& uevent, const std::string& name) {
  std::istringstream lines(uevent);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(name + "=")) continue;
    std::string value = line.substr(name.size() + 1);
    std::erase_if(value, [](char c) { return c < ' ' || c > '~' || c == '"'; });
    return value;
  }
  return {};
}

// Returns whether a report descriptor (HID 1.11, 6.2.2) has the usage "keyboard" or "keypad" of the
// usage page "generic desktop", anywhere. Long items do not occur in practice and end the search.
bool describes_keyboard(const std::string& descriptor) {
  unsigned page = 0;
  for (std::size_t i = 0; i < descriptor.size();) {
    const auto prefix = static_cast<unsigned char>(descriptor[i]);
    const std::size_t size = (prefix & 3) == 3 ? 4 : prefix & 3;
    if (i + 1 + size > descriptor.size()) return false;
    unsigned data = 0;
    for (std::size_t byte = 0; byte < size; ++byte)
      data |= unsigned{static_cast<unsigned char>(descriptor[i + 1 + byte])} << 8 * byte;
    const unsigned usage = size == 4 ? data : page << 16 | data;
    if ((prefix & 0xfc) == 0x04) page = data;
    if ((prefix & 0xfc) == 0x08 && (usage == 0x10006 || usage == 0x10007)) return true;
    i += 1 + size;
  }
  return false;
}

// Returns "1209:0001" of the HID_ID "0003:00001209:00000001", in capitals as the kernel names its
// HID devices; empty if it is none.
std::string ids_of(const std::string& hid_id) {
  if (hid_id.size() != 22 || hid_id[4] != ':' || hid_id[13] != ':') return {};
  std::string ids = hid_id.substr(9, 4) + ":" + hid_id.substr(18, 4);
  std::ranges::transform(ids, ids.begin(),
                         [](char c) { return c >= 'a' && c <= 'f' ? char(c - 'a' + 'A') : c; });
  return ids.find_first_not_of("0123456789ABCDEF:") == std::string::npos ? ids : std::string();
}

constexpr const char* to_previz = "GROUP=\"previz\", MODE=\"0660\"\n";

void print_hid_rules(std::ostream& out, const fs::path& sysfs) {
  std::map<std::string, HidKind> kinds;  // by ids: a device has a node for each interface
  for (const fs::path& node : entries_of(sysfs / "class" / "hidraw")) {
    const std::string uevent = text_of(node / "device" / "uevent");
    const std::string ids = ids_of(value_of(uevent, "HID_ID"));
    if (ids.empty()) continue;
    HidKind& kind = kinds[ids];
    kind.name = value_of(uevent, "HID_NAME");
    kind.is_keyboard |= describes_keyboard(text_of(node / "device" / "report_descriptor"));
  }
  for (const auto& [ids, kind] : kinds) {
    out << "# " << kind.name;
    if (kind.is_keyboard)
      out << ": a keyboard, or a pedal that acts as one. Whoever can open it can read everything\n"
             "# typed on it; uncomment the rule if the device belongs to the rig\n#";
    else
      out << '\n';
    out << R"(SUBSYSTEM=="hidraw", KERNELS=="*:)" << ids << R"(.*", )" << to_previz;
  }
}

void print_gpio_rules(std::ostream& out, const fs::path& sysfs) {
  for (const fs::path& chip : entries_of(sysfs / "bus" / "gpio" / "devices")) {
    std::error_code gone;
    const fs::path real = fs::canonical(chip, gone);
    if (gone || !chip.filename().string().starts_with("gpiochip")) continue;
    const fs::path parent = real.parent_path();
    const fs::path driver = fs::canonical(parent / "driver", gone);
    out << "# " << chip.filename().string() << ", a chip of "
        << (gone ? parent.filename() : driver.filename()).string() << '\n'
        << R"(SUBSYSTEM=="gpio", KERNEL=="gpiochip*", KERNELS==")" << parent.filename().string()
        << "\", " << to_previz;
  }
}

}  // namespace

void print_device_rules(std::ostream& out, const fs::path& sysfs) {
  out << "# Lines for /etc/udev/rules.d/71-previzd-buttons.rules: copy those of the rig's "
         "buttons.\n";
  print_hid_rules(out, sysfs);
  print_gpio_rules(out, sysfs);
}

}  // namespace previz
