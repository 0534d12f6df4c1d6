// What devices send: pictures in the memory of a driver, reports of HID devices, and the messages
// of the process that receives from a network camera.
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <map>
#include <sstream>
#include <utility>

#include "drivers/aravis/protocol.hpp"
#include "drivers/aravis/receiver_process.hpp"
#include "drivers/convert/convert.hpp"
#include "drivers/hid/hid_buttons.hpp"
#include "tests/fuzz/targets.hpp"

namespace previz::fuzz {
namespace device_targets_cpp {

void wire_picture(Bytes bytes) {
  Choices choices(bytes);
  convert::WirePicture picture;
  // The one behind yv12 is JPEG, whose bytes libjpeg reads: see mjpeg().
  picture.format.layout = static_cast<convert::Layout>(choices.up_to(11));
  const int bits = 8 + choices.up_to(8);
  const auto packing = static_cast<convert::Packing>(choices.up_to(3));
  if (picture.format.layout <= convert::Layout::bgr) {  // the others have 8 bits
    picture.format.bits = bits;
    picture.format.packing = packing;
  }
  picture.format.matrix = static_cast<convert::YuvMatrix>(choices.up_to(1));
  picture.format.range = static_cast<convert::YuvRange>(choices.up_to(1));
  picture.width = 1 + choices.up_to(200);
  picture.height = 1 + choices.up_to(200);
  picture.stride = static_cast<std::size_t>(choices.up_to(1000));
  picture.bytes = choices.rest();
  Frame frame;
  if (convert::convert(picture, frame)) return;
  expect(frame.bytes.size() == frame_bytes(frame.format, frame.width, frame.height),
         "a converted frame is as long as its format and size say");
}

void mjpeg(Bytes bytes) {
  std::vector<std::uint8_t> rgb;
  if (convert::decode_jpeg(bytes, 48, 32, rgb)) return;
  expect(rgb.size() == 48u * 32u * 3u, "a decoded JPEG fills its picture");
}

// The names of buttons, a line each, then an empty line; each report has its length in front.
void hid_reports(Bytes bytes) {
  const std::string text = text_of(bytes);
  const std::size_t end = text.find("\n\n");
  std::istringstream lines(text.substr(0, end));
  std::vector<std::string> names;
  for (std::string name; std::getline(lines, name) && names.size() < 32;)
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  hid::ReportReader reader(names);
  Choices reports(end == std::string::npos ? Bytes() : bytes.subspan(end + 2));
  std::map<std::string, bool> down;
  const auto take = [&](const std::vector<ButtonEvent>& events) {
    for (const ButtonEvent& event : events) {
      const bool was_down = std::exchange(down[event.button], event.pressed);
      expect(was_down != event.pressed, "presses and releases of a button take turns");
    }
  };
  std::int64_t time_ns = 0;
  std::vector<std::uint8_t> before;
  while (!reports.rest().empty()) {
    const std::size_t wanted = reports.byte();
    const std::size_t length = std::min(wanted, reports.rest().size());
    const Bytes report = reports.rest().first(length);
    take(reader.read(report, time_ns += 50'000'000));
    hid::pressed_between(before, report);
    before.assign(report.begin(), report.end());
    reports = Choices(reports.rest().subspan(length));
  }
  take(reader.release_all(time_ns));
}

// Reads a body as each of the messages in turn; what is read as whole is written and read again.
template <class Body>
void read_as(const aravis::Message& message) {
  const std::optional<Body> body = aravis::body_of<Body>(message);
  if (!body) return;
  aravis::Message again;
  again.bytes = aravis::Writer()(*body).bytes();
  expect(aravis::body_of<Body>(again).has_value(), "what was written can be read");
}

void aravis_message(Bytes bytes) {
  std::array<int, 2> sockets{-1, -1};
  expect(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, sockets.data()) == 0, "a socket");
  const OwnedDescriptor ours(sockets[0]);
  {
    const OwnedDescriptor theirs(sockets[1]);
    if (::send(theirs.get(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL) < 0) return;
  }
  aravis::Message message;
  if (aravis::receive(ours.get(), message) != aravis::Received::message) return;
  read_as<aravis::Listing>(message);
  read_as<aravis::Order>(message);
  read_as<aravis::Terms>(message);
  read_as<aravis::Ring>(message);
  read_as<aravis::ExposureWords>(message);
  read_as<aravis::FrameNote>(message);
  read_as<aravis::Pulse>(message);
  for (const char c : aravis::printable(text_of(bytes)))
    expect(c >= ' ' && c <= '~', "foreign text is printable ASCII");
}

constexpr Target own[] = {
    {"wire", "a picture as a camera's driver delivers it, after its format and size", wire_picture},
    {"mjpeg", "a JPEG of a UVC camera", mjpeg},
    {"hid", "names of buttons and reports of a HID device", hid_reports},
    {"aravis", "a message of the process that receives from a network camera", aravis_message},
};

}  // namespace device_targets_cpp

std::span<const Target> device_targets() {
  return device_targets_cpp::own;
}

}  // namespace previz::fuzz
