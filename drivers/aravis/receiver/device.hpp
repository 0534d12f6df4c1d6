// An open Aravis camera, as the receiving process has it.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "drivers/aravis/protocol.hpp"
#include "drivers/aravis/receiver/configure.hpp"
#include "drivers/aravis/receiver/gobject.hpp"
#include "drivers/aravis/shared_buffers.hpp"
#include "drivers/camera_settings.hpp"
#include "drivers/descriptor.hpp"

namespace previz::aravis {

// Functions throw previz::Error where the camera refuses. One thread uses it; Aravis' own threads
// fill its buffers.
class Device {
 public:
  explicit Device(const CameraSettings& settings);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  Terms terms() const;
  // The socket of the control channel; -1 for a camera on the USB.
  int control_socket() const { return control_socket_; }

  void start(const Ring& ring, OwnedDescriptor memory);
  void stop();
  void trigger();
  ExposureWords expose(const ExposureWords& wanted);
  // Lets a buffer be filled again; does nothing for a number that is none.
  void give_back(std::uint32_t buffer);

  // Becomes readable when a buffer is filled or the camera is lost.
  int event() const { return event_.get(); }
  // Returns the buffers filled since the last call, in order.
  std::vector<FrameNote> filled();
  bool is_lost() const { return lost_; }
  // Returns all of Aravis' own counters, which depend on the kind of stream.
  Pulse pulse() const;

 private:
  struct Filled {
    ArvBuffer* buffer;
    std::int64_t arrival_ns;
    bool is_too_large;
  };

  static void on_stream(void* self, ArvStreamCallbackType type, ArvBuffer* buffer);
  void wake() const;
  void begin_stream();
  void check_stream() const;
  bool more_mismatches(ArvStream& stream);
  FrameNote note_of(const Filled& filled);
  void add_chunk_exposure(ArvBuffer& buffer, FrameNote& note);

  const std::string name_;
  OwnedDescriptor event_;
  Owned<ArvCamera> camera_;
  const Agreed agreed_;
  std::uint32_t address_ = 0;
  int control_socket_ = -1;
  Owned<ArvChunkParser> chunks_;  // null: frames do not carry their exposure
  std::atomic<bool> lost_ = false;
  gulong lost_handler_ = 0;
  std::optional<SharedBuffers> memory_;        // none: not streaming
  std::atomic<ArvStream*> filling_ = nullptr;  // what Aravis' thread may use; stream_, or null
  std::mutex mutex_;                           // of filled_
  std::vector<Filled> filled_;
  // When buffers were begun that are not done yet; Aravis' thread only.
  std::deque<std::int64_t> begun_ns_;
  std::uint64_t mismatches_ = 0;  // Aravis' thread only, while it streams
  std::vector<ArvBuffer*> lent_;  // buffers that the driver has, by their number; otherwise null
  Owned<ArvStream> stream_;       // destroyed first: it ends Aravis' thread
};

}  // namespace previz::aravis
