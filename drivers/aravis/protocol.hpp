// The messages between the driver of an Aravis camera and the process that receives from the
// camera.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "drivers/camera_settings.hpp"
#include "drivers/descriptor.hpp"

namespace previz::aravis {

enum class Kind : std::uint32_t {
  // Requests of the driver. Each is answered by `done` or `refused`, in the order of the requests.
  list,     // -> Listing
  open,     // Order -> Terms, and a duplicate of the control socket of a network camera
  start,    // Ring, and its memory
  stop,     // ends the stream; no frame follows the answer
  expose,   // ExposureWords -> ExposureWords as they applied
  trigger,  // by software, one frame
  // Says that a buffer may be filled again; it is not answered.
  give_back,
  // Answers.
  done,
  refused,  // a text: why; every version has it in this place, for programs of two versions
  // Sent unasked.
  frame,  // FrameNote: a buffer was filled
  pulse,  // Pulse: the receiver is alive, and what its stream has counted
  lost,   // the camera does not answer any more
};

// No message is longer; a text is cut where it would be.
constexpr std::size_t most_message = 16384, most_text = 2048;

// Appends values to a message.
class Writer {
 public:
  template <class Value>
  Writer& operator()(const Value& value) {
    if constexpr (std::is_arithmetic_v<Value>) {
      const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
      bytes_.insert(bytes_.end(), bytes, bytes + sizeof value);
    } else {
      exchange(*this, const_cast<Value&>(value));
    }
    return *this;
  }
  Writer& operator()(const std::string& text) {
    const std::string cut = text.substr(0, most_text);
    (*this)(static_cast<std::uint32_t>(cut.size()));
    bytes_.insert(bytes_.end(), cut.begin(), cut.end());
    return *this;
  }
  template <class Value>
  Writer& operator()(const std::optional<Value>& value) {
    (*this)(value.has_value());
    if (value) (*this)(*value);
    return *this;
  }
  template <class Value>
  Writer& operator()(const std::vector<Value>& values) {
    (*this)(static_cast<std::uint32_t>(values.size()));
    for (const Value& value : values) (*this)(value);
    return *this;
  }

  const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
};

// Reads foreign bytes: what is missing is read as zero, and whole() is then false.
class Reader {
 public:
  explicit Reader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <class Value>
  Reader& operator()(Value& value) {
    if constexpr (std::is_same_v<Value, bool>) {
      std::uint8_t byte = 0;
      (*this)(byte);
      value = byte != 0;
    } else if constexpr (std::is_arithmetic_v<Value>) {
      value = 0;
      if (const auto from = next(sizeof value); !from.empty())
        std::memcpy(&value, from.data(), sizeof value);
    } else {
      exchange(*this, value);
    }
    return *this;
  }
  Reader& operator()(std::string& text) {
    std::uint32_t size = 0;
    (*this)(size);
    const auto from = next(size);
    text.assign(from.begin(), from.end());
    return *this;
  }
  template <class Value>
  Reader& operator()(std::optional<Value>& value) {
    bool there = false;
    (*this)(there);
    value.reset();
    if (there) (*this)(value.emplace());
    return *this;
  }
  template <class Value>
  Reader& operator()(std::vector<Value>& values) {
    std::uint32_t count = 0;
    (*this)(count);
    values.clear();
    for (std::uint32_t i = 0; i < count && whole_; ++i) (*this)(values.emplace_back());
    return *this;
  }

  // Returns whether there was as much as was read.
  bool whole() const { return whole_; }

 private:
  std::span<const std::uint8_t> next(std::size_t size) {
    if (size > bytes_.size()) whole_ = false;
    if (!whole_) return {};
    const auto from = bytes_.first(size);
    bytes_ = bytes_.subspan(size);
    return from;
  }

  std::span<const std::uint8_t> bytes_;
  bool whole_ = true;
};

// The structures below name their fields once, for writing and for reading.

// What a set asks of a camera.
struct Order {
  CameraSettings settings;
};
template <class Archive>
void exchange(Archive& archive, Order& order) {
  CameraSettings& s = order.settings;
  archive(s.device)(s.format)(s.width)(s.height)(s.rate_hz)(s.exposure_s)(s.gain)(s.raw_gain)(
      s.white_balance_k)(s.trigger)(s.packet_size);
}

// What the camera and the receiver have agreed on.
struct Terms {
  std::uint32_t pfnc = 0;  // PFNC code of the pixel format
  std::int32_t width = 0, height = 0;
  std::int64_t payload = 0;  // bytes of a buffer
  double rate_hz = 0;        // 0: unknown
  double exposure_s = 0, gain = 1;
  bool drives_exposure = false;
  std::uint32_t address = 0;  // IPv4 of a network camera, in the host's order; otherwise 0
};
template <class Archive>
void exchange(Archive& archive, Terms& t) {
  archive(t.pfnc)(t.width)(t.height)(t.payload)(t.rate_hz)(t.exposure_s)(t.gain)(t.drives_exposure)(
      t.address);
}

// The memory that frames are passed in; `shared_buffers.hpp` lays it out.
struct Ring {
  std::uint32_t buffers = 0;
  std::uint64_t payload = 0;
};
template <class Archive>
void exchange(Archive& archive, Ring& ring) {
  archive(ring.buffers)(ring.payload);
}

struct ExposureWords {
  double exposure_s = 0, gain = 1;
};
template <class Archive>
void exchange(Archive& archive, ExposureWords& words) {
  archive(words.exposure_s)(words.gain);
}

enum class Damage : std::uint8_t { none, packets_missing, timed_out, too_large, given_up };

// A buffer that was filled.
struct FrameNote {
  std::uint32_t buffer = 0;
  std::uint8_t damage = 0;  // a Damage
  std::uint32_t pfnc = 0;
  std::int32_t width = 0, height = 0;
  std::int32_t row_padding = 0;         // bytes
  std::uint64_t offset = 0, size = 0;   // the picture within the buffer, bytes
  std::uint64_t id = 0;                 // of the camera
  std::int64_t device_ns = 0;           // the camera's time stamp
  std::int64_t arrival_ns = 0;          // CLOCK_MONOTONIC when its first packet came
  std::optional<double> exposure_s;     // of its chunk data
  std::optional<double> exposure_gain;  // of its chunk data, a factor
};
template <class Archive>
void exchange(Archive& archive, FrameNote& n) {
  archive(n.buffer)(n.damage)(n.pfnc)(n.width)(n.height)(n.row_padding)(n.offset)(n.size)(n.id)(
      n.device_ns)(n.arrival_ns)(n.exposure_s)(n.exposure_gain);
}

struct Counter {
  std::string name;
  std::uint64_t count = 0;
};
template <class Archive>
void exchange(Archive& archive, Counter& counter) {
  archive(counter.name)(counter.count);
}
struct Pulse {
  std::vector<Counter> counters;
};
template <class Archive>
void exchange(Archive& archive, Pulse& pulse) {
  archive(pulse.counters);
}

struct Listed {
  std::string id, address, serial, vendor, model, protocol;
};
template <class Archive>
void exchange(Archive& archive, Listed& listed) {
  archive(listed.id)(listed.address)(listed.serial)(listed.vendor)(listed.model)(listed.protocol);
}
struct Listing {
  std::vector<Listed> devices;
};
template <class Archive>
void exchange(Archive& archive, Listing& listing) {
  archive(listing.devices);
}

// A message as it came.
struct Message {
  Kind kind = Kind::pulse;
  std::vector<std::uint8_t> bytes;
  OwnedDescriptor descriptor;  // that came with it, if any
};

// Reads the body of a message; none if it is shorter than it must be.
template <class Body>
std::optional<Body> body_of(const Message& message) {
  Body body;
  Reader reader(message.bytes);
  reader(body);
  return reader.whole() ? std::optional<Body>(std::move(body)) : std::nullopt;
}

// Sends a message over a socket of SOCK_SEQPACKET, and with it a descriptor unless that is -1.
// Returns false if the other side is gone, or if it does not take more and `may_wait` is false.
bool send(int socket, Kind kind, const Writer& body, int descriptor, bool may_wait);

enum class Received { message, nothing, closed };

// Takes a message if there is one, without waiting for it.
Received receive(int socket, Message& message);

}  // namespace previz::aravis
