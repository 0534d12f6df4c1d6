#include "drivers/aravis/aravis_camera.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "drivers/aravis/configure.hpp"
#include "drivers/aravis/gobject.hpp"
#include "drivers/aravis/pixel_formats.hpp"
#include "drivers/clock_map.hpp"
#include "drivers/exposure_ledger.hpp"
#include "drivers/host_clock.hpp"
#include "drivers/other_clock.hpp"

namespace previz {
namespace {

using aravis::Failure;
using aravis::Owned;

// Buffers the receiver may fill while the pipeline is busy: at 60 Hz a quarter of a second.
constexpr int buffers_in_flight = 16;
// Many cameras latch an exposure for the next frame but one.
constexpr int latch_frames = 2;

// Block ids of GigE Vision 1.x have 16 bits and leave out 0; later ones have 64 bits.
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
    return sequence_ += step;
  }

 private:
  std::optional<std::uint64_t> last_id_;
  std::uint64_t sequence_ = 0;
};

class AravisCamera final : public Camera {
 public:
  explicit AravisCamera(const CameraSettings& settings)
      : settings_(settings),
        camera_(aravis::find_camera(settings.device)),
        device_(arv_camera_get_device(camera_.get())),
        agreed_(aravis::configure(*camera_, settings)),
        ledger_(agreed_.exposure, latch_frames) {
    if (agreed_.chunks) chunks_.reset(arv_camera_create_chunk_parser(camera_.get()));
    lost_handler_ =
        g_signal_connect(device_, "control-lost", G_CALLBACK(+[](ArvDevice*, gpointer self) {
                           static_cast<AravisCamera*>(self)->control_lost_ = true;
                         }),
                         this);
  }

  ~AravisCamera() override {
    stop();
    g_signal_handler_disconnect(device_, lost_handler_);
  }
  AravisCamera(const AravisCamera&) = delete;
  AravisCamera& operator=(const AravisCamera&) = delete;

  std::string name() const override { return settings_.device; }
  CameraFormat format() const override { return agreed_.format; }

  void start() override {
    if (stream_) return;
    Failure failure;
    stream_.reset(arv_camera_create_stream(camera_.get(), nullptr, nullptr, failure.out()));
    if (!stream_) throw Error(name() + ": its stream cannot be opened: " + failure.text());
    if (ARV_IS_GV_STREAM(stream_.get())) aravis::configure_gige_stream(*stream_, agreed_.payload);
    for (int i = 0; i < buffers_in_flight; ++i)
      arv_stream_push_buffer(stream_.get(), arv_buffer_new(agreed_.payload, nullptr));
    sequence_.restart();
    triggered_ = false;
    arv_camera_start_acquisition(camera_.get(), failure.out());
    if (failure.failed()) {
      stream_.reset();
      failure.check(name(), "cannot start");
    }
  }

  // Destroys the stream with its buffers, so that none of them can come again.
  void stop() override {
    if (!stream_) return;
    Failure ignored;  // a camera that is gone cannot be stopped
    if (!control_lost_) arv_camera_stop_acquisition(camera_.get(), ignored.out());
    add_stream_counters(counters_);
    stream_.reset();
  }

  CameraEvent next(std::chrono::milliseconds timeout) override {
    if (control_lost_) return DeviceTrouble{name(), "does not answer any more", true};
    if (!stream_) return NoFrame{};
    if (agreed_.software_trigger && !triggered_) {
      Failure failure;
      arv_camera_software_trigger(camera_.get(), failure.out());
      if (failure.failed())
        return DeviceTrouble{name(), "cannot be triggered: " + failure.text(), true};
      triggered_ = true;
    }
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    for (;;) {
      const auto left = std::chrono::duration_cast<std::chrono::microseconds>(
          deadline - std::chrono::steady_clock::now());
      ArvBuffer* buffer = left.count() > 0
                              ? arv_stream_timeout_pop_buffer(
                                    stream_.get(), static_cast<std::uint64_t>(left.count()))
                              : arv_stream_try_pop_buffer(stream_.get());
      if (!buffer) return NoFrame{};
      FramePtr frame = take(*buffer);
      arv_stream_push_buffer(stream_.get(), buffer);
      triggered_ = false;
      if (frame) return frame;
      if (std::chrono::steady_clock::now() >= deadline) return NoFrame{};
    }
  }

  bool set_exposure(double exposure_s, double gain) override {
    if (control_lost_ || !agreed_.drives_exposure) return false;
    try {
      const std::int64_t before_ns = monotonic_ns();
      const Exposure applied = aravis::set_exposure(*camera_, name(), {exposure_s, gain});
      ledger_.changed(before_ns, monotonic_ns(), applied);
      return true;
    } catch (const Error&) {
      ++counters_["exposures refused"];
      return false;
    }
  }

  DeviceCounters counters() const override {
    DeviceCounters all = counters_;
    all["steps of the time of day"] = time_of_day_.steps();
    all["arrivals left out of the clock's map"] = clock_.left_out();
    all["maps of the clock begun anew"] = clock_.begun_anew();
    add_stream_counters(all);
    return all;
  }

 private:
  // Returns the frame of a filled buffer; null, and counted, if it is not whole.
  FramePtr take(ArvBuffer& buffer) {
    // Aravis stamps a buffer's first packet with the time of day.
    const std::int64_t arrival_ns = time_of_day_.to_monotonic(
        static_cast<std::int64_t>(arv_buffer_get_system_timestamp(&buffer)));
    if (const char* damage = damage_of(buffer)) return left_out(damage);
    auto frame = std::make_shared<Frame>();
    std::size_t size = 0;
    const auto* data = static_cast<const std::uint8_t*>(arv_buffer_get_image_data(&buffer, &size));
    int padding = 0, ignored = 0;
    arv_buffer_get_image_padding(&buffer, &padding, &ignored);
    const std::size_t row = convert::row_bytes(agreed_.wire, agreed_.format.width);
    if (padding < 0 || !data) return left_out("frames without a picture");
    if (convert::convert({agreed_.wire,
                          agreed_.format.width,
                          agreed_.format.height,
                          row + static_cast<std::size_t>(padding),
                          {data, size}},
                         *frame))
      return left_out("frames cut short");
    frame->source = settings_.source;
    frame->sequence = sequence_.of(arv_buffer_get_frame_id(&buffer));
    frame->arrival_ns = arrival_ns;
    frame->timestamp_ns =
        clock_.to_host(static_cast<std::int64_t>(arv_buffer_get_timestamp(&buffer)), arrival_ns);
    const std::optional<Exposure> exposure = exposure_of(buffer, frame->timestamp_ns);
    if (!exposure) return left_out("frames between two exposures");
    apply_exposure(*frame, *exposure, settings_.responsivity);
    return frame;
  }

  FramePtr left_out(const char* why) {
    ++counters_[why];
    return nullptr;
  }

  // Returns what keeps a buffer from being a picture as agreed; null if nothing does.
  const char* damage_of(ArvBuffer& buffer) const {
    switch (arv_buffer_get_status(&buffer)) {
      case ARV_BUFFER_STATUS_SUCCESS:
        break;
      case ARV_BUFFER_STATUS_MISSING_PACKETS:
        return "frames with packets missing";
      case ARV_BUFFER_STATUS_TIMEOUT:
        return "frames that ended in a time-out";
      case ARV_BUFFER_STATUS_SIZE_MISMATCH:
        return "frames larger than agreed";
      default:
        return "frames given up by the receiver";
    }
    const bool as_agreed = arv_buffer_get_image_pixel_format(&buffer) == agreed_.pfnc &&
                           arv_buffer_get_image_width(&buffer) == agreed_.format.width &&
                           arv_buffer_get_image_height(&buffer) == agreed_.format.height;
    return as_agreed ? nullptr : "frames of another format";
  }

  std::optional<Exposure> exposure_of(ArvBuffer& buffer, std::int64_t timestamp_ns) {
    const std::optional<Exposure> by_time = ledger_.of_frame(timestamp_ns);
    if (!chunks_ || !arv_buffer_has_chunks(&buffer)) return by_time;
    Failure failure;
    const double us = arv_chunk_parser_get_float_value(chunks_.get(), &buffer, "ChunkExposureTime",
                                                       failure.out());
    if (failure.failed() || !(us > 0)) return by_time;
    const double gain_db =
        arv_chunk_parser_get_float_value(chunks_.get(), &buffer, "ChunkGain", failure.out());
    if (failure.failed())
      return by_time ? std::optional(Exposure{1e-6 * us, by_time->gain}) : std::nullopt;
    return Exposure{1e-6 * us, agreed_.gain_in_db ? std::pow(10.0, gain_db / 20.0) : 1.0};
  }

  // Adds all of Aravis' own counters, which depend on the kind of stream.
  void add_stream_counters(DeviceCounters& counters) const {
    if (!stream_) return;
    for (unsigned i = 0; i < arv_stream_get_n_infos(stream_.get()); ++i)
      if (arv_stream_get_info_type(stream_.get(), i) == G_TYPE_UINT64)
        counters[aravis::counter_name(arv_stream_get_info_name(stream_.get(), i))] +=
            arv_stream_get_info_uint64(stream_.get(), i);
  }

  const CameraSettings settings_;
  Owned<ArvCamera> camera_;
  ArvDevice* device_;  // owned by camera_
  const aravis::Agreed agreed_;
  Owned<ArvChunkParser> chunks_;  // null: frames do not carry their exposure
  std::atomic<bool> control_lost_ = false;
  gulong lost_handler_ = 0;
  Owned<ArvStream> stream_;  // null: not streaming
  bool triggered_ = false;   // by software; no frame has answered yet
  SequenceCounter sequence_;
  OtherClock time_of_day_{read_beside_monotonic(CLOCK_REALTIME)};
  ClockMap clock_;
  ExposureLedger ledger_;
  DeviceCounters counters_;
};

}  // namespace

std::unique_ptr<Camera> open_aravis(const CameraSettings& settings) {
  return std::make_unique<AravisCamera>(settings);
}

}  // namespace previz
