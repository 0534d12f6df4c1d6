#include "tests/rig_vm/usb/redirection.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <usbredirparser.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <deque>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>

#include "drivers/descriptor.hpp"

namespace previz::test {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds tick{5};  // how late a word of the device's, or its cable, is noticed
constexpr std::uint8_t descriptor_of_device = 1, of_configuration = 2, of_string = 3;
constexpr std::uint8_t get_status = 0, get_descriptor = 6;
constexpr std::uint8_t kind_mask = 0x60, to_host = 0x80;

Bytes string_descriptor(const std::string& text) {
  Bytes wide;
  for (const char c : text) wide = joined(wide, number(static_cast<std::uint8_t>(c), 2));
  return descriptor(of_string, {wide});
}

OwnedDescriptor connected(const std::filesystem::path& path) {
  OwnedDescriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.native().size() >= sizeof address.sun_path)
    throw std::runtime_error(path.string() + ": too long for a socket");
  std::ranges::copy(path.native(), address.sun_path);
  if (connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    throw std::runtime_error(path.string() + ": " + std::strerror(errno));
  return socket;
}

// The device as it is plugged in once.
class Plugged {
 public:
  Plugged(UsbDevice& device, const std::filesystem::path& path)
      : device_(device), socket_(connected(path)), parser_(usbredirparser_create()) {
    carry_bytes();
    answer_about_itself();
    answer_transfers();
    std::uint32_t capabilities[USB_REDIR_CAPS_SIZE] = {};
    for (const int capability :
         {usb_redir_cap_connect_device_version, usb_redir_cap_ep_info_max_packet_size,
          usb_redir_cap_64bits_ids, usb_redir_cap_32bits_bulk_length})
      usbredirparser_caps_set_cap(capabilities, capability);
    usbredirparser_init(parser_.get(), "previz test device", capabilities, USB_REDIR_CAPS_SIZE,
                        usbredirparser_fl_usb_host);
  }

  // False once QEMU has ended.
  bool serve_for(milliseconds time) {
    pollfd waiting{socket_.get(), POLLIN, 0};
    poll(&waiting, 1, static_cast<int>(time.count()));
    if (waiting.revents != 0 && usbredirparser_do_read(parser_.get()) != 0) ended_ = true;
    say();
    while (!ended_ && usbredirparser_has_data_to_write(parser_.get()) > 0)
      if (usbredirparser_do_write(parser_.get()) != 0) ended_ = true;
    return !ended_;
  }

 private:
  struct Destroy {
    void operator()(usbredirparser* parser) const { usbredirparser_destroy(parser); }
  };

  static Plugged& self(void* pointer) { return *static_cast<Plugged*>(pointer); }

  void carry_bytes() {
    usbredirparser& parser = *parser_;
    parser.priv = this;
    parser.log_func = [](void*, int level, const char* text) {
      if (level <= usbredirparser_warning) std::fprintf(stderr, "usbredir: %s\n", text);
    };
    parser.read_func = [](void* plugged, std::uint8_t* to, int size) {
      const ssize_t read =
          recv(self(plugged).socket_.get(), to, static_cast<std::size_t>(size), MSG_DONTWAIT);
      if (read < 0 && errno == EAGAIN) return 0;
      return read > 0 ? static_cast<int>(read) : -1;
    };
    parser.write_func = [](void* plugged, std::uint8_t* from, int size) {
      return static_cast<int>(
          send(self(plugged).socket_.get(), from, static_cast<std::size_t>(size), MSG_NOSIGNAL));
    };
  }

  void answer_about_itself() {
    usbredirparser& parser = *parser_;
    parser.hello_func = [](void* plugged, usb_redir_hello_header*) { self(plugged).introduce(); };
    parser.reset_func = [](void* plugged) {
      self(plugged).wanted_.clear();
      self(plugged).listened_to_ = false;
      self(plugged).device_.reset();
    };
    parser.set_configuration_func = [](void* plugged, std::uint64_t id,
                                       usb_redir_set_configuration_header* asked) {
      self(plugged).describe();
      self(plugged).configured(id, asked->configuration);
    };
    parser.get_configuration_func = [](void* plugged, std::uint64_t id) {
      self(plugged).configured(id, 1);
    };
    parser.set_alt_setting_func = [](void* plugged, std::uint64_t id,
                                     usb_redir_set_alt_setting_header* asked) {
      self(plugged).set_to_first_alternative(id, asked->interface);
    };
    parser.get_alt_setting_func = [](void* plugged, std::uint64_t id,
                                     usb_redir_get_alt_setting_header* asked) {
      self(plugged).set_to_first_alternative(id, asked->interface);
    };
  }

  void answer_transfers() {
    usbredirparser& parser = *parser_;
    parser.control_packet_func = [](void* plugged, std::uint64_t id,
                                    usb_redir_control_packet_header* header, std::uint8_t* data,
                                    int size) {
      self(plugged).answer(id, *header, {data, static_cast<std::size_t>(std::max(size, 0))});
      if (data) usbredirparser_free_packet_data(self(plugged).parser_.get(), data);
    };
    parser.bulk_packet_func = [](void* plugged, std::uint64_t id,
                                 usb_redir_bulk_packet_header* header, std::uint8_t* data, int) {
      self(plugged).wanted_.push_back(
          {id, header->length | static_cast<std::size_t>(header->length_high) << 16});
      if (data) usbredirparser_free_packet_data(self(plugged).parser_.get(), data);
    };
    parser.cancel_data_packet_func = [](void* plugged, std::uint64_t id) {
      self(plugged).cancel(id);
    };
    parser.start_interrupt_receiving_func = [](void* plugged, std::uint64_t id,
                                               usb_redir_start_interrupt_receiving_header* asked) {
      self(plugged).listen(id, asked->endpoint, true);
    };
    parser.stop_interrupt_receiving_func = [](void* plugged, std::uint64_t id,
                                              usb_redir_stop_interrupt_receiving_header* asked) {
      self(plugged).listen(id, asked->endpoint, false);
    };
  }

  void introduce() {
    describe();
    const Bytes device = device_.device_descriptor();
    const auto pair = [&](std::size_t at) {
      return static_cast<std::uint16_t>(device[at] | device[at + 1] << 8);
    };
    usb_redir_device_connect_header header{
        usb_redir_speed_high, device[4], device[5], device[6], pair(8), pair(10), pair(12)};
    usbredirparser_send_device_connect(parser_.get(), &header);
  }

  // Endpoints are numbered 0 to 15 towards the device, 16 to 31 from it.
  void describe() {
    usb_redir_interface_info_header interfaces{};
    for (const UsbDevice::Interface& interface : device_.interfaces()) {
      const std::uint32_t i = interfaces.interface_count++;
      interfaces.interface[i] = static_cast<std::uint8_t>(i);
      interfaces.interface_class[i] = interface.device_class;
      interfaces.interface_subclass[i] = interface.subclass;
      interfaces.interface_protocol[i] = interface.protocol;
    }
    usbredirparser_send_interface_info(parser_.get(), &interfaces);
    usb_redir_ep_info_header endpoints{};
    std::ranges::fill(endpoints.type, static_cast<std::uint8_t>(usb_redir_type_invalid));
    endpoints.type[0] = endpoints.type[16] = usb_redir_type_control;
    endpoints.max_packet_size[0] = endpoints.max_packet_size[16] = 64;
    const UsbDevice::Input input = device_.input();
    const int at = 16 + (input.endpoint & 15);
    endpoints.type[at] = static_cast<std::uint8_t>(input.kind);
    endpoints.interval[at] = input.interval;
    endpoints.interface[at] = input.interface;
    endpoints.max_packet_size[at] = input.packet_bytes;
    usbredirparser_send_ep_info(parser_.get(), &endpoints);
  }

  void configured(std::uint64_t id, std::uint8_t configuration) {
    usb_redir_configuration_status_header header{usb_redir_success, configuration};
    usbredirparser_send_configuration_status(parser_.get(), id, &header);
  }

  void set_to_first_alternative(std::uint64_t id, std::uint8_t interface) {
    usb_redir_alt_setting_status_header header{usb_redir_success, interface, 0};
    usbredirparser_send_alt_setting_status(parser_.get(), id, &header);
  }

  void answer(std::uint64_t id, usb_redir_control_packet_header header,
              std::span<const std::uint8_t> data) {
    std::optional<Bytes> answer =
        control({header.requesttype, header.request, header.value, header.index}, data);
    header.status = answer ? usb_redir_success : usb_redir_stall;
    Bytes bytes = std::move(answer).value_or(Bytes{});
    bytes.resize(std::min<std::size_t>(bytes.size(), header.length));
    if ((header.requesttype & to_host) != 0)
      header.length = static_cast<std::uint16_t>(bytes.size());
    usbredirparser_send_control_packet(parser_.get(), id, &header, bytes.data(),
                                       static_cast<int>(bytes.size()));
  }

  std::optional<Bytes> control(const SetupPacket& setup, std::span<const std::uint8_t> data) {
    const bool standard = (setup.type & kind_mask) == 0,
               asks_descriptor = setup.request == get_descriptor;
    if (!standard) return device_.control(setup, data);
    if (!asks_descriptor) return setup.request == get_status ? Bytes{0, 0} : Bytes{};
    return setup.type == to_host ? described(setup.value) : device_.control(setup, data);
  }

  std::optional<Bytes> described(std::uint16_t value) const {
    const std::size_t which = value & 255;
    switch (value >> 8) {
      case descriptor_of_device:
        return device_.device_descriptor();
      case of_configuration:
        return device_.configuration_descriptor();
      case of_string: {
        if (which == 0) return descriptor(of_string, {number(0x0409, 2)});  // the only language
        const std::vector<std::string> strings = device_.strings();
        if (which <= strings.size()) return string_descriptor(strings[which - 1]);
        return std::nullopt;
      }
      default:
        return std::nullopt;
    }
  }

  void cancel(std::uint64_t id) {
    if (std::erase_if(wanted_, [&](const Wanted& wanted) { return wanted.id == id; }) > 0)
      send_bulk(id, usb_redir_cancelled, {});
  }

  void listen(std::uint64_t id, std::uint8_t endpoint, bool on) {
    listened_to_ = on;
    usb_redir_interrupt_receiving_status_header header{usb_redir_success, endpoint};
    usbredirparser_send_interrupt_receiving_status(parser_.get(), id, &header);
  }

  void say() {
    const UsbDevice::Input input = device_.input();
    if (input.kind == UsbDevice::Input::Kind::bulk) {
      while (!wanted_.empty()) {
        std::optional<Bytes> said = device_.say(wanted_.front().room);
        if (!said) return;
        send_bulk(wanted_.front().id, usb_redir_success, std::move(*said));
        wanted_.pop_front();
      }
    } else if (listened_to_) {
      while (std::optional<Bytes> said = device_.say(input.packet_bytes)) {
        usb_redir_interrupt_packet_header header{input.endpoint, usb_redir_success,
                                                 static_cast<std::uint16_t>(said->size())};
        usbredirparser_send_interrupt_packet(parser_.get(), reports_++, &header, said->data(),
                                             static_cast<int>(said->size()));
      }
    }
  }

  void send_bulk(std::uint64_t id, std::uint8_t status, Bytes bytes) {
    usb_redir_bulk_packet_header header{device_.input().endpoint, status,
                                        static_cast<std::uint16_t>(bytes.size()), 0,
                                        static_cast<std::uint16_t>(bytes.size() >> 16)};
    usbredirparser_send_bulk_packet(parser_.get(), id, &header, bytes.data(),
                                    static_cast<int>(bytes.size()));
  }

  struct Wanted {
    std::uint64_t id;
    std::size_t room;
  };

  UsbDevice& device_;
  const OwnedDescriptor socket_;
  const std::unique_ptr<usbredirparser, Destroy> parser_;
  std::deque<Wanted> wanted_;  // bulk transfers that the host waits for
  bool listened_to_ = false;   // the interrupt endpoint
  std::uint64_t reports_ = 0;
  bool ended_ = false;
};

}  // namespace

Bytes number(std::uint64_t value, int bytes) {
  Bytes little_endian;
  for (int i = 0; i < bytes; ++i)
    little_endian.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  return little_endian;
}

Bytes descriptor(std::uint8_t kind, std::initializer_list<Bytes> parts) {
  Bytes whole{0, kind};
  for (const Bytes& part : parts) whole = joined(whole, part);
  whole[0] = static_cast<std::uint8_t>(whole.size());
  return whole;
}

void serve(UsbDevice& device, const std::filesystem::path& socket,
           const std::filesystem::path& cable) {
  for (std::optional<Plugged> plugged;;) {
    const bool in = exists(cable);
    if (in && !plugged) plugged.emplace(device, socket);
    if (!in) plugged.reset();
    if (!plugged)
      std::this_thread::sleep_for(tick);
    else if (!plugged->serve_for(tick))
      return;
  }
}

}  // namespace previz::test
