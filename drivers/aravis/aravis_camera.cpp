#include "drivers/aravis/aravis_camera.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "drivers/aravis/pixel_formats.hpp"
#include "drivers/aravis/receiver_process.hpp"
#include "drivers/aravis/shared_buffers.hpp"
#include "drivers/clock_map.hpp"
#include "drivers/convert/convert.hpp"
#include "drivers/error.hpp"
#include "drivers/exposure_ledger.hpp"
#include "drivers/frame_rate.hpp"
#include "drivers/host_clock.hpp"

namespace previz {
namespace {

using aravis::Message;
using aravis::Reach;
using aravis::ReceiverProcess;
using aravis::Writer;
using std::chrono::milliseconds;

// Buffers the receiver may fill while the pipeline is busy: at 60 Hz a quarter of a second. Of
// large frames there are fewer, so that all of them together are a gibibyte at most.
constexpr std::size_t most_buffers = 16, least_buffers = 4;
constexpr std::int64_t most_buffer_bytes = std::int64_t{1} << 30;
constexpr std::int64_t most_payload = most_buffer_bytes / least_buffers;
// Many cameras latch an exposure for the next frame but one.
constexpr int latch_frames = 2;
// Aravis reads a camera's description, which may be a megabyte, in blocks of 512 bytes, and tries
// packet sizes until one gets through.
constexpr milliseconds time_to_open{10'000}, time_to_list{5'000}, time_to_answer{2'000};

bool is_address(const std::string& text) {
  std::array<unsigned char, 16> ignored{};
  return inet_pton(AF_INET, text.c_str(), ignored.data()) == 1;
}

// A camera that is not on the USB is looked for in the network, by a process that has no USB.
Reach reach_of(const std::string& device) {
  if (device.empty()) throw Error("an aravis camera needs its serial number or address");
  return !is_address(device) && usb_place_of_aravis(device) ? Reach::usb : Reach::network;
}

struct Agreed {
  CameraFormat format;
  convert::WireFormat wire;
  std::uint32_t pfnc = 0;
  std::size_t payload = 0;  // bytes of a buffer
  Exposure exposure;
  bool drives_exposure = false;
};

// Checks what the receiver says that it has agreed on with the camera. Throws previz::Error.
Agreed checked(const aravis::Terms& terms) {
  const std::optional<convert::WireFormat> wire = aravis::wire_format(terms.pfnc);
  if (!wire) throw Error("its pixel format cannot be converted");
  if (terms.width < 1 || terms.height < 1 || terms.width > 65535 || terms.height > 65535)
    throw Error("reports pictures of " + std::to_string(terms.width) + "x" +
                std::to_string(terms.height) + " pixels, which is impossible");
  const auto least =
      static_cast<std::int64_t>(convert::picture_bytes(*wire, terms.width, terms.height));
  if (terms.payload < least || terms.payload > most_payload)
    throw Error("reports a frame size of " + std::to_string(terms.payload) +
                " bytes; its picture needs " + std::to_string(least) + ", and at most " +
                std::to_string(most_payload) + " are accepted");
  const bool unknown = terms.exposure_s == 0 && terms.gain == 1;
  if (!unknown && !is_exposure(terms.exposure_s, terms.gain))
    throw Error("reports an impossible exposure");
  Agreed agreed;
  agreed.format.format = convert::delivered_format(*wire);
  agreed.format.bayer = convert::bayer_pattern(*wire);
  agreed.format.width = terms.width;
  agreed.format.height = terms.height;
  if (std::isfinite(terms.rate_hz) && terms.rate_hz > 0) agreed.format.rate_hz = terms.rate_hz;
  agreed.wire = *wire;
  agreed.pfnc = terms.pfnc;
  agreed.payload = static_cast<std::size_t>(terms.payload);
  agreed.exposure = {terms.exposure_s, terms.gain};
  agreed.drives_exposure = terms.drives_exposure;
  return agreed;
}

// Block ids of GigE Vision 1.x have 16 bits and leave out 0; later ones have 64 bits. A step that
// no camera makes within a day counts as one frame.
class SequenceCounter {
 public:
  void restart() { last_id_.reset(); }

  std::uint64_t of(std::uint64_t id) {
    std::uint64_t step = 1;
    if (last_id_) {
      const bool wrapped = id < *last_id_ && *last_id_ <= 0xffff && *last_id_ - id > 0x8000;
      if (id > *last_id_)
        step = id - *last_id_;
      else if (wrapped)
        step = id + 0xffff - *last_id_;
    }
    last_id_ = id;
    return sequence_ += step < 0x1000000 ? step : 1;
  }

 private:
  std::optional<std::uint64_t> last_id_;
  std::uint64_t sequence_ = 0;
};

// Aravis itself runs in a process of its own (receiver/), because it believes what any host of the
// network sends. A frame makes no copy more than it would without: the receiver puts packets
// together in memory that both share, and convert() reads from there.
class AravisCamera final : public Camera {
 public:
  explicit AravisCamera(const CameraSettings& settings)
      : settings_(settings),
        receiver_(reach_of(settings.device)),
        agreed_(open()),
        ledger_(agreed_.exposure, latch_frames) {}

  // A camera that is lost cannot be given back in order.
  ~AravisCamera() override {
    if (trouble_) receiver_.give_up("lost its camera");
  }
  AravisCamera(const AravisCamera&) = delete;
  AravisCamera& operator=(const AravisCamera&) = delete;

  std::string name() const override { return settings_.device; }
  CameraFormat format() const override { return agreed_.format; }
  std::vector<std::string> doubts() const override {
    const auto other = other_rate(settings_, agreed_.format.rate_hz, "");
    return other ? std::vector{*other} : std::vector<std::string>{};
  }

  void start() override {
    if (buffers_) return;
    const std::size_t buffers =
        std::clamp(most_buffer_bytes / agreed_.payload, least_buffers, most_buffers);
    buffers_.emplace(aravis::Ring{static_cast<std::uint32_t>(buffers), agreed_.payload});
    sequence_.restart();
    triggered_ = false;
    last_frame_ns_ = monotonic_ns();
    try {
      receiver_.ask(aravis::Kind::start, Writer()(buffers_->ring()), time_to_answer,
                    buffers_->descriptor());
    } catch (const Error& error) {
      buffers_.reset();
      throw Error(named(error.what()));
    }
  }

  void stop() override {
    if (!buffers_) return;
    if (!receiver_.gone() && !trouble_) {
      try {
        receiver_.ask(aravis::Kind::stop, {}, time_to_answer);
      } catch (const Error&) {  // a camera that is gone cannot be stopped
      }
    }
    buffers_.reset();  // so that no frame is taken from what came before the answer
    for (std::size_t i = 0; i < 2 * most_buffers; ++i)
      if (const std::optional<Message> message = receiver_.next({})) handle(*message);
    for (const auto& [name, count] : std::exchange(stream_counters_, {})) counters_[name] += count;
  }

  CameraEvent next(milliseconds timeout) override {
    const auto deadline = ReceiverProcess::Clock::now() + timeout;
    if (!trouble_ && agreed_triggers() && buffers_ && !triggered_) trigger();
    while (!trouble_) {
      // Without a stream only whether the camera is still there is of interest.
      std::optional<Message> message =
          receiver_.next(buffers_ ? deadline : ReceiverProcess::Clock::time_point());
      if (message) {
        if (FramePtr frame = handle(*message)) return frame;
      }
      if (receiver_.gone()) lose_receiver();
      if (trouble_) break;
      if (ReceiverProcess::Clock::now() >= deadline || !buffers_) return NoFrame{};
    }
    return *trouble_;
  }

  bool set_exposure(double exposure_s, double gain) override {
    if (trouble_ || receiver_.gone() || !agreed_.drives_exposure) return false;
    const std::int64_t before_ns = monotonic_ns();
    try {
      const Message answer = receiver_.ask(
          aravis::Kind::expose, Writer()(aravis::ExposureWords{exposure_s, gain}), time_to_answer);
      const auto applied = aravis::body_of<aravis::ExposureWords>(answer);
      if (!applied || !is_exposure(applied->exposure_s, applied->gain)) {
        receiver_.give_up("reports an impossible exposure");
        return false;
      }
      ledger_.changed(before_ns, monotonic_ns(), {applied->exposure_s, applied->gain});
      return true;
    } catch (const Error&) {
      ++counters_["exposures refused"];
      return false;
    }
  }

  DeviceCounters counters() const override {
    DeviceCounters all = counters_;
    for (const auto& [name, count] : stream_counters_) all[name] += count;
    all["arrivals ignored by the clock map"] = clock_.left_out();
    all["clock map restarts"] = clock_.begun_anew();
    return all;
  }

 private:
  std::string named(const std::string& what) const {
    return what.starts_with(name() + ": ") ? what : name() + ": " + what;
  }

  Agreed open() {
    try {
      Message answer =
          receiver_.ask(aravis::Kind::open, Writer()(aravis::Order{settings_}), time_to_open);
      const auto terms = aravis::body_of<aravis::Terms>(answer);
      if (!terms) throw Error("its receiver sent no valid settings");
      if (answer.descriptor) receiver_.hold(std::move(answer.descriptor), terms->address);
      return checked(*terms);
    } catch (const Error& error) {
      throw Error(named(error.what()));
    }
  }

  bool agreed_triggers() const { return settings_.trigger == "software"; }

  void trigger() {
    try {
      receiver_.ask(aravis::Kind::trigger, {}, time_to_answer);
      triggered_ = true;
    } catch (const Error& error) {
      if (!receiver_.gone())
        trouble_ = DeviceTrouble{name(), "cannot be triggered: " + std::string(error.what()), true};
    }
  }

  void lose_receiver() {
    trouble_ = DeviceTrouble{name(), receiver_.why_gone(), true};
    if (!buffers_ || agreed_triggers()) return;
    const double silent_s = 1e-9 * static_cast<double>(monotonic_ns() - last_frame_ns_);
    counters_["frames lost with their receiver"] +=
        static_cast<std::uint64_t>(std::max(0.0, silent_s) * std::min(agreed_.format.rate_hz, 1e4));
  }

  // Takes a message; returns the frame, if it is a whole one.
  FramePtr handle(const Message& message) {
    if (message.kind == aravis::Kind::lost) {
      trouble_ = DeviceTrouble{name(), "stopped responding", true};
    } else if (message.kind == aravis::Kind::pulse) {
      take_counters(message);
    } else if (buffers_) {
      const auto note = aravis::body_of<aravis::FrameNote>(message);
      if (!note || note->buffer >= buffers_->ring().buffers) {
        receiver_.give_up("names a nonexistent buffer");
        return nullptr;
      }
      FramePtr frame = take(*note);
      receiver_.post(aravis::Kind::give_back, Writer()(note->buffer));
      triggered_ = false;
      if (frame) last_frame_ns_ = frame->arrival_ns;
      return frame;
    }
    return nullptr;
  }

  // The names become keys of the status on the bus.
  void take_counters(const Message& message) {
    const auto pulse = aravis::body_of<aravis::Pulse>(message);
    if (!pulse || pulse->counters.size() > 64) return receiver_.give_up("sends invalid counters");
    for (const aravis::Counter& counter : pulse->counters)
      if (counter.name.starts_with("stream ") && counter.name.size() < 64 &&
          (stream_counters_.size() < 64 || stream_counters_.contains(counter.name)))
        stream_counters_[aravis::printable(counter.name)] = counter.count;
  }

  // Returns the frame of a filled buffer; null, and counted, if it is not whole. The receiver could
  // change the picture while it is read here; nothing but the picture depends on its bytes.
  FramePtr take(const aravis::FrameNote& note) {
    if (const char* damage = damage_of(note)) return left_out(damage);
    const std::span<const std::uint8_t> buffer = buffers_->at(note.buffer);
    if (note.row_padding < 0 || note.size > buffer.size() ||
        note.offset > buffer.size() - note.size || note.size == 0)
      return left_out("frames without a picture");
    auto frame = std::make_shared<Frame>();
    const std::size_t row = convert::row_bytes(agreed_.wire, agreed_.format.width);
    if (convert::convert({agreed_.wire, agreed_.format.width, agreed_.format.height,
                          row + static_cast<std::size_t>(note.row_padding),
                          buffer.subspan(note.offset, note.size)},
                         *frame))
      return left_out("frames cut short");
    frame->source = settings_.source;
    frame->sequence = sequence_.of(note.id);
    const std::int64_t now_ns = monotonic_ns();
    frame->arrival_ns = std::clamp(note.arrival_ns, now_ns - 10'000'000'000, now_ns);
    // A time that a clock of nanoseconds since 1970 does not reach in this century is none.
    const bool has_clock = note.device_ns >= 0 && note.device_ns < 4'000'000'000'000'000'000;
    frame->timestamp_ns =
        clock_.to_host(has_clock ? note.device_ns : frame->arrival_ns, frame->arrival_ns);
    const std::optional<Exposure> exposure =
        ledger_.of_frame(frame->timestamp_ns, note.exposure_s, note.exposure_gain);
    if (!exposure) return left_out("frames during an exposure change");
    apply_exposure(*frame, *exposure, settings_.responsivity);
    return frame;
  }

  FramePtr left_out(const char* why) {
    ++counters_[why];
    return nullptr;
  }

  // Returns what keeps a buffer from being a picture as agreed; null if nothing does.
  const char* damage_of(const aravis::FrameNote& note) const {
    const char* const other_format = "frames of another format";
    switch (static_cast<aravis::Damage>(note.damage)) {
      case aravis::Damage::none:
        break;
      case aravis::Damage::packets_missing:
        return "frames with packets missing";
      case aravis::Damage::timed_out:
        return "frames that timed out";
      case aravis::Damage::too_large:
        return other_format;
      default:
        return "frames abandoned by the receiver";
    }
    const bool as_agreed = note.pfnc == agreed_.pfnc && note.width == agreed_.format.width &&
                           note.height == agreed_.format.height;
    return as_agreed ? nullptr : other_format;
  }

  const CameraSettings settings_;
  ReceiverProcess receiver_;
  const Agreed agreed_;
  std::optional<aravis::SharedBuffers> buffers_;  // none: not streaming
  std::optional<DeviceTrouble> trouble_;          // the camera is lost
  bool triggered_ = false;                        // by software; no frame has answered yet
  std::int64_t last_frame_ns_ = 0;
  SequenceCounter sequence_;
  ClockMap clock_;
  ExposureLedger ledger_;
  DeviceCounters counters_;
  DeviceCounters stream_counters_;  // of this stream, as last reported
};

}  // namespace

std::unique_ptr<Camera> open_aravis(const CameraSettings& settings) {
  return std::make_unique<AravisCamera>(settings);
}

// A process that may look at one of the two at a time; what keeps one from its answer is no reason
// not to list the other.
std::vector<FoundCamera> find_aravis() {
  std::vector<FoundCamera> found;
  for (const Reach reach : {Reach::network, Reach::usb}) {
    ReceiverProcess receiver(reach);
    std::optional<aravis::Listing> listing;
    try {
      listing =
          aravis::body_of<aravis::Listing>(receiver.ask(aravis::Kind::list, {}, time_to_list));
      if (!listing) throw Error("its receiver does not report its devices");
    } catch (const Error& error) {
      const std::string where = reach == Reach::usb ? "on the USB" : "in the network";
      found.push_back({"aravis", "", "", "cannot look for cameras " + where + ": " + error.what()});
      continue;
    }
    for (const aravis::Listed& listed : listing->devices)
      found.push_back({"aravis",
                       aravis::printable(listed.serial.empty() ? listed.id : listed.serial),
                       aravis::printable(listed.vendor + " " + listed.model + ", " +
                                         listed.protocol + " at " + listed.address)});
  }
  return found;
}

// Finds USB3 Vision cameras only, because a network camera's serial number is on no USB.
std::optional<usb::Place> usb_place_of_aravis(const std::string& device) {
  if (const std::optional<usb::Place> place = usb::place_of_serial(device)) return place;
  const std::size_t dash = device.rfind('-');  // an id ends in the serial
  return dash == std::string::npos ? std::nullopt : usb::place_of_serial(device.substr(dash + 1));
}

}  // namespace previz
