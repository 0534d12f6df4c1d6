// A GenICam camera that describes itself absurdly, or sends what it has not announced: refused with
// its name, or counted and left out. Aravis' fake camera with its own description and registers
// changed, over real GVCP and GVSP.
#include <arv.h>

#include "drivers/camera_drivers.hpp"
#include "tests/devices/private_network.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::test::aravis_malformed_test {

constexpr const char* address = "127.0.0.1";

struct UnrefFake {
  void operator()(gpointer object) const { g_object_unref(object); }
};

// What the fake camera says of itself.
std::string description() {
  const std::unique_ptr<ArvFakeCamera, UnrefFake> fake(arv_fake_camera_new("previz"));
  std::size_t size = 0;
  const char* xml = arv_fake_camera_get_genicam_xml(fake.get(), &size);
  return {xml, size};
}

class AbsurdCamera : public testing::Test {
 protected:
  // Plugs in a camera with this description.
  void plug(const std::string& xml) {
    const bool is_private = enter_private_network();  // its control port is fixed
    camera_.reset();
    const std::filesystem::path file = directory_ / "camera.xml";
    std::ofstream(file) << xml;
    camera_.reset(arv_gv_fake_camera_new_full(address, "previz-absurd", file.c_str()));
    fake_ = nullptr;
    if (arv_gv_fake_camera_is_running(camera_.get()))
      fake_ = arv_gv_fake_camera_get_fake_camera(camera_.get());
    ASSERT_TRUE(fake_ || !is_private)
        << "Aravis' fake camera cannot listen on " << address << ", in a network of its own";
    if (!fake_)
      GTEST_SKIP() << "Aravis' fake camera cannot listen on " << address
                   << ", and this process may have no network of its own";
    write(ARV_FAKE_CAMERA_REGISTER_WIDTH, 64);
    write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, 48);
  }

  void write(std::uint32_t at, std::uint32_t value) const {
    ASSERT_TRUE(arv_fake_camera_write_register(fake_, at, value));
  }

  static std::unique_ptr<Camera> open(std::optional<double> rate_hz = std::nullopt) {
    CameraSettings settings;
    settings.device = address;
    settings.packet_size = 1500;
    settings.rate_hz = rate_hz;
    return camera_driver("aravis").open(settings);
  }
  static std::string refusal(std::optional<double> rate_hz = std::nullopt) {
    return error_of([&] { open(rate_hz); });
  }

  // Takes what comes until `what` has been counted so often, for at most ten seconds.
  static testing::AssertionResult counts(Camera& camera, const std::string& what,
                                         std::uint64_t least = 1) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (std::chrono::steady_clock::now() < end) {
      const CameraEvent event = camera.next(std::chrono::milliseconds(100));
      if (const auto* frame = std::get_if<FramePtr>(&event)) {
        EXPECT_EQ((*frame)->width, camera.format().width);
        EXPECT_EQ((*frame)->bytes.size(), 64u * 48u);
      }
      const DeviceCounters counted = camera.counters();
      if (counted.contains(what) && counted.at(what) >= least) return testing::AssertionSuccess();
    }
    return testing::AssertionFailure() << testing::PrintToString(camera.counters());
  }

  TemporaryDirectory directory_;
  std::unique_ptr<ArvGvFakeCamera, UnrefFake> camera_;
  ArvFakeCamera* fake_ = nullptr;  // the camera's
};

std::string with(std::string xml, const std::string& what, const std::string& instead) {
  const std::size_t at = xml.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return at == std::string::npos ? xml : xml.replace(at, what.size(), instead);
}

const std::string payload_formula = "WIDTH * HEIGHT * ((PIXELFORMAT>>16)&amp;0xFF) / 8";

TEST_F(AbsurdCamera, ASizeThatCannotBeIsRefused) {
  plug(description());
  for (const std::uint32_t side : {0u, 0xffffffffu, 0x80000000u, 1'000'000'000u, 65'536u}) {
    write(ARV_FAKE_CAMERA_REGISTER_WIDTH, side);
    EXPECT_THAT(refusal(), StartsWith("127.0.0.1: ")) << side;
    write(ARV_FAKE_CAMERA_REGISTER_WIDTH, 64);
    write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, side);
    EXPECT_THAT(refusal(), StartsWith("127.0.0.1: ")) << side;
    write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, 48);
  }
  write(ARV_FAKE_CAMERA_REGISTER_WIDTH, 0);
  EXPECT_THAT(refusal(), HasSubstr("reports pictures of 0x48 pixels, which is impossible"));
  write(ARV_FAKE_CAMERA_REGISTER_WIDTH, 64);
  EXPECT_EQ(refusal(), "");
}

TEST_F(AbsurdCamera, AFrameSizeThatDoesNotFitThePictureIsRefused) {
  for (const char* bytes : {"0", "0 - 1", "3071", "1 &lt;&lt; 40"}) {
    plug(with(description(), payload_formula, bytes));
    EXPECT_THAT(refusal(), HasSubstr("its picture needs 3072")) << bytes;
  }
}

TEST_F(AbsurdCamera, AnExposureThatCannotBeIsRefused) {
  for (const char* formula :
       {"0 - TO", "0 * TO", "1e308 * 1e308", "(1e308 * 1e308) - (1e308 * 1e308)"}) {
    plug(with(description(), "<FormulaFrom>TO</FormulaFrom>",
              "<FormulaFrom>" + std::string(formula) + "</FormulaFrom>"));
    EXPECT_THAT(refusal(), HasSubstr("reports an")) << formula;
  }
}

// 60.3 is within a hundredth of what the camera has.
TEST_F(AbsurdCamera, ARateBeyondItsBoundsIsRefusedInTheWordsOfEveryDriver) {
  const std::string rate = "<pValue>AcquisitionFrameRateConverter</pValue>";
  plug(with(description(), rate, rate + "<Min>10</Min><Max>60</Max>"));
  EXPECT_EQ(
      refusal(120),
      "127.0.0.1: rate_hz 120 is not possible; allowed: 10 to 60; change rate_hz or remove it");
  EXPECT_EQ(refusal(5),
            "127.0.0.1: rate_hz 5 is not possible; allowed: 10 to 60; change rate_hz or remove it");
  const auto camera = open(60.3);
  EXPECT_NEAR(camera->format().rate_hz, 60, 0.01);
  EXPECT_TRUE(camera->doubts().empty());
}

TEST_F(AbsurdCamera, ADescriptionThatIsNoneIsRefused) {
  const std::string whole = description();
  for (const std::string& xml :
       {std::string("<"), std::string("no XML at all"), whole.substr(0, whole.size() / 2),
        with(whole, "<Integer Name=\"Width\"", "<Integer Name=\"Wdith\""),
        with(whole, "<pValue>WidthRegister</pValue>", "<pValue>Nothing</pValue>"),
        with(whole, "<IntSwissKnife Name=\"PayloadSize\"", "<IntSwissKnife Name=\"Payload\"")}) {
    plug(xml);
    EXPECT_THAT(refusal(), StartsWith("127.0.0.1: ")) << xml.substr(0, 40);
  }
}

TEST_F(AbsurdCamera, FramesOfAnotherSizeThanAgreedAreCountedAndLeftOut) {
  plug(description());
  const auto camera = open();
  write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, 96);
  camera->start();
  EXPECT_TRUE(counts(*camera, "stream size mismatch errors"));
  EXPECT_TRUE(counts(*camera, "frames of another format"));
  const std::uint64_t longer = camera->counters().at("frames of another format");
  write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, 24);
  EXPECT_TRUE(counts(*camera, "frames of another format", longer + 3));
}

TEST_F(AbsurdCamera, FramesOfAnotherFormatThanAgreedAreCountedAndLeftOut) {
  plug(description());
  const auto camera = open();
  camera->start();
  write(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, ARV_PIXEL_FORMAT_BAYER_BG_8);  // as many bytes
  EXPECT_TRUE(counts(*camera, "frames of another format"));
}

// Every counter of Aravis' stream, by a name that can be read.
TEST_F(AbsurdCamera, StreamCountersHavePlainNames) {
  plug(description());
  const auto camera = open();
  camera->start();
  ASSERT_TRUE(counts(*camera, "stream completed buffers"));
  for (const char* name :
       {"stream failures", "stream underruns", "stream missing packets", "stream resent packets",
        "stream timeouts", "stream transferred bytes", "stream duplicated packets"})
    EXPECT_TRUE(camera->counters().contains(name)) << name;
  for (const auto& [name, count] : camera->counters()) EXPECT_THAT(name, Not(HasSubstr("_")));
}

}  // namespace previz::test::aravis_malformed_test
