// What libcamera's thread reports while a camera is opened and closed, on a camera of the test's
// own that has libcamera's signals.
#include <libcamera/base/signal.h>

#include "drivers/libcamera/mailbox.hpp"
#include "tests/support/test.hpp"

namespace previz::libcam::libcamera_mailbox_test {

using std::chrono::milliseconds;

struct SignallingCamera {
  ::libcamera::Signal<::libcamera::Request*> requestCompleted;
  ::libcamera::Signal<> disconnected;
};

// Nobody looks into it.
::libcamera::Request* request() {
  return reinterpret_cast<::libcamera::Request*>(16);
}

TEST(LibcameraMailbox, TakesRequestsWhileItIsOpen) {
  const auto camera = std::make_shared<SignallingCamera>();
  const auto mailbox = mailbox_of(camera);
  camera->requestCompleted.emit(request());
  EXPECT_EQ(mailbox->wait(milliseconds(0)), nullptr);
  mailbox->open();
  camera->requestCompleted.emit(request());
  EXPECT_EQ(mailbox->wait(milliseconds(0)), request());
  EXPECT_EQ(mailbox->wait(milliseconds(1)), nullptr);
  camera->requestCompleted.emit(request());
  mailbox->close();
  mailbox->open();
  EXPECT_EQ(mailbox->wait(milliseconds(0)), nullptr);
  EXPECT_FALSE(mailbox->unplugged());
  camera->disconnected.emit();
  EXPECT_TRUE(mailbox->unplugged());
}

TEST(LibcameraMailbox, IsTheSameForEveryOpeningOfACameraAndGoesWithIt) {
  auto camera = std::make_shared<SignallingCamera>();
  std::weak_ptr<Mailbox> first = mailbox_of(camera);
  EXPECT_FALSE(first.expired());
  EXPECT_EQ(mailbox_of(camera), first.lock());
  const auto other = std::make_shared<SignallingCamera>();
  EXPECT_NE(mailbox_of(other), first.lock());
  camera.reset();
  EXPECT_TRUE(first.expired());
  EXPECT_FALSE(mailbox_of(other)->unplugged());
}

// Under the address sanitizer, a receiver that is disconnected when its camera is closed is often
// seen to be called after its end.
TEST(LibcameraMailbox, MayBeLeftWhileTheCameraReports) {
  const auto camera = std::make_shared<SignallingCamera>();
  std::atomic<int> reported = 0;
  std::jthread reports([&](const std::stop_token& stop) {
    for (; !stop.stop_requested(); ++reported) {
      camera->requestCompleted.emit(request());
      camera->disconnected.emit();
    }
  });
  while (reported < 200'000) {
    const auto mailbox = mailbox_of(camera);
    mailbox->open();
    mailbox->close();
  }
}

}  // namespace previz::libcam::libcamera_mailbox_test
