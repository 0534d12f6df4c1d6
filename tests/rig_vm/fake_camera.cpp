// A GigE Vision camera on the loopback network (GVCP and GVSP, by Aravis' fake camera) that sends
// the observer's frames of a recorded take, at half their size, again and again. Ending the program
// is unplugging the camera.
//   rig_vm_camera SESSION FRAMES_PER_SECOND
#include <arv.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <vector>

#include "daemon/core/session/session.hpp"
#include "drivers/error.hpp"

namespace {

using Bytes = std::vector<std::uint8_t>;

struct Take {
  int width = 0, height = 0;
  std::vector<Bytes> frames;  // rgb8
};

// Every pixel the mean of four.
Bytes halved(const previz::Frame& frame) {
  const int width = frame.width / 2, height = frame.height / 2, row = 3 * frame.width;
  Bytes half(static_cast<std::size_t>(3) * width * height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) {
        const std::uint8_t* from = &frame.bytes[static_cast<std::size_t>(2 * y * row + 6 * x + c)];
        half[static_cast<std::size_t>(3 * (y * width + x) + c)] =
            static_cast<std::uint8_t>((from[0] + from[3] + from[row] + from[row + 3] + 2) / 4);
      }
  return half;
}

Take read_take(const char* directory) {
  previz::session::Session session = previz::session::open_session(directory);
  const auto stream = previz::session::open_stream(session, "observer");
  if (!stream || stream->format() != previz::PixelFormat::rgb8)
    throw previz::Error(std::string(directory) + ": no observer in rgb8");
  Take take{stream->width() / 2, stream->height() / 2, {}};
  for (std::size_t i = 0; i < stream->records().size(); ++i)
    take.frames.push_back(halved(*stream->read(i)));
  return take;
}

class FakeCamera {
 public:
  FakeCamera(Take take, double rate_hz)
      : take_(std::move(take)), camera_(arv_gv_fake_camera_new("127.0.0.1", "RIG1")) {
    if (!camera_ || !arv_gv_fake_camera_is_running(camera_))
      throw previz::Error("nothing can listen at 127.0.0.1");
    fake_ = arv_gv_fake_camera_get_fake_camera(camera_);
    set(ARV_FAKE_CAMERA_REGISTER_WIDTH, take_.width);
    set(ARV_FAKE_CAMERA_REGISTER_HEIGHT, take_.height);
    set(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, ARV_PIXEL_FORMAT_RGB_8_PACKED);
    set(ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US, std::lround(1e6 / rate_hz));
    arv_fake_camera_set_fill_pattern(
        fake_,
        [](ArvBuffer* buffer, void* self, guint32, guint32, ArvPixelFormat) {
          static_cast<FakeCamera*>(self)->fill(*buffer);
        },
        this);
  }
  ~FakeCamera() { g_object_unref(camera_); }
  FakeCamera(const FakeCamera&) = delete;
  FakeCamera& operator=(const FakeCamera&) = delete;

 private:
  void set(std::uint64_t address, long value) {
    arv_fake_camera_write_register(fake_, static_cast<guint32>(address),
                                   static_cast<guint32>(value));
  }

  // On the camera's own thread. The buffer does not know its size yet.
  void fill(ArvBuffer& buffer) {
    const Bytes& frame = take_.frames[sent_++ % take_.frames.size()];
    std::memcpy(const_cast<void*>(arv_buffer_get_data(&buffer, nullptr)), frame.data(),
                std::min(arv_fake_camera_get_payload(fake_), frame.size()));
  }

  const Take take_;
  std::size_t sent_ = 0;
  ArvGvFakeCamera* camera_;
  ArvFakeCamera* fake_ = nullptr;  // the camera's
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: rig_vm_camera SESSION FRAMES_PER_SECOND\n";
    return 2;
  }
  // Before the camera's threads are there, so that they leave the signals to this one.
  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGINT);
  sigaddset(&ends, SIGTERM);
  sigprocmask(SIG_BLOCK, &ends, nullptr);
  try {
    const FakeCamera camera(read_take(argv[1]), std::atof(argv[2]));
    int received = 0;
    sigwait(&ends, &received);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "rig_vm_camera: " << error.what() << "\n";
    return 1;
  }
}
