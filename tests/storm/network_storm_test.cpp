// The storm over a rig whose film camera is on a network with hosts that mean harm: it is plugged
// and unplugged, whoever receives from it is killed or stands still, and every port gets packets
// that nobody asked for, from others and in the camera's name.
#include <arv.h>

#include <csignal>

#include "daemon/core/set/actions.hpp"
#include "tests/devices/hostile_packets.hpp"
#include "tests/storm/storm.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::rig::network_storm_test {

using namespace test::hostile;
using storm_test::Gust;

// The small take's floor from 0.75 m above it, with one tag of 40 pixels.
std::vector<std::uint8_t> picture_of_a_tag() {
  test::TagScene scene;
  scene.lens = test::plain_lens(width, height, 60);
  scene.world_from_camera = test::camera_looking({0, 0, 0.75}, {0, 0, 0}, {0, 1, 0});
  scene.tags = {test::flat_tag(0, 0.5, {0, 0, 0})};
  test::Sensor sensor;
  sensor.format = PixelFormat::gray8;
  std::mt19937 random(1);
  return test::expose(test::render(scene), sensor, random).bytes;
}

// A GigE Vision camera on the loopback network that sends that picture.
class NetworkCamera {
 public:
  NetworkCamera() { plug(); }
  ~NetworkCamera() { unplug(); }
  NetworkCamera(const NetworkCamera&) = delete;
  NetworkCamera& operator=(const NetworkCamera&) = delete;

  void unplug() {
    if (camera_) g_object_unref(camera_);
    camera_ = nullptr;
  }
  // Returns whether the camera's port was free.
  bool plug() {
    camera_ = arv_gv_fake_camera_new(address, "previz-storm");
    if (!arv_gv_fake_camera_is_running(camera_)) return false;
    fake_ = arv_gv_fake_camera_get_fake_camera(camera_);
    arv_fake_camera_write_register(fake_, ARV_FAKE_CAMERA_REGISTER_WIDTH, width);
    arv_fake_camera_write_register(fake_, ARV_FAKE_CAMERA_REGISTER_HEIGHT, height);
    arv_fake_camera_set_fill_pattern(
        fake_,
        [](ArvBuffer* buffer, void* self, guint32, guint32, ArvPixelFormat) {
          static_cast<const NetworkCamera*>(self)->fill(*buffer);
        },
        this);
    return true;
  }
  bool is_plugged() const { return camera_ && arv_gv_fake_camera_is_running(camera_); }

 private:
  // On the camera's own thread. The buffer does not know its size yet.
  void fill(ArvBuffer& buffer) const {
    std::memcpy(const_cast<void*>(arv_buffer_get_data(&buffer, nullptr)), picture_.data(),
                std::min(arv_fake_camera_get_payload(fake_), picture_.size()));
  }

  const std::vector<std::uint8_t> picture_ = picture_of_a_tag();
  ArvGvFakeCamera* camera_ = nullptr;
  ArvFakeCamera* fake_ = nullptr;  // the camera's
};

class NetworkStorm : public storm_test::Storm {
 protected:
  void write_network_set() {
    write_stormy_set();
    const std::string driver = "driver = \"aravis\"\ndevice = \"" + std::string(address) + "\"\n";
    replace("[observer]\ndriver = \"replay\"\ndevice = \"session\"\n",
            "[observer]\nexposure = 1.0\n" + driver);
    replace("[light_camera]",
            "[observer.camera]\nrate_hz = 40.0\npacket_size = 1500\nstall_timeout_s = 0.5\n"
            "[observer.intrinsics]\nwidth = 64\nheight = 48\nfx = 60.0\nfy = 60.0\ncx = 31.5\n"
            "cy = 23.5\n[light_camera]");
    replace("enabled = false\n",
            "family = \"tag36h11\"\n[[tag]]\nid = 0\nsize_m = 0.5\n"
            "position_m = [0.0, 0.0, 0.0]\n");
    // A set with a real camera takes real buttons only. There is no such chip, so that this driver
    // is in trouble all the time as well.
    contact_ = "gpio:storm:";
    for (const set::Action& action : set::actions())
      replace("name = \"" + std::string(action.name) + "\"\naction",
              "name = \"" + contact_ + action.name + "\"\naction");
  }

  // Somebody on the network sends to every port what is not wanted there.
  Gust flood(const char* from) {
    return [this, sender = std::make_shared<Sender>(from), packets = unwanted(from)] {
      const std::vector<std::uint16_t> ports = udp_ports();
      for (int i = 0; i < 50; ++i)
        sender->send(dice_.one_in(50) ? pending(too_much_ms) : packets[dice_.below(packets.size())],
                     ports);
      tally_.packets += 50 * static_cast<int>(ports.size());
      dice_.rest(20);
    };
  }

  NetworkCamera camera_;
};

TEST_F(NetworkStorm, TheRigOutlivesItAndEveryTakeIsWhole) {
  if (!camera_.is_plugged())
    GTEST_SKIP() << "Aravis' fake camera cannot listen on " << address
                 << ", and this process may have no network of its own";
  write_network_set();
  most_ms_between_sets_ = 6000;  // each opens the camera anew, which takes a second
  const Gust pull_the_cable = [this] {
    dice_.rest(4000);
    camera_.unplug();
    dice_.rest(1500);
    while (!camera_.plug()) {
      camera_.unplug();
      dice_.rest(10);  // until the port is free
    }
    ++tally_.unplugs;
  };
  const Gust harm_the_receiver = [this] {
    dice_.rest(3000);
    static constexpr std::array signals = {SIGKILL, SIGSTOP};
    for (const pid_t receiver : receivers()) {
      kill(receiver, signals[dice_.below(signals.size())]);
      ++tally_.receivers;
    }
  };
  weather({pull_the_cable, harm_the_receiver, flood(another), flood(address)});
  EXPECT_GT(tally_.unplugs, 0);
  EXPECT_GT(tally_.packets, 0);
  EXPECT_TRUE(receivers().empty());
}

}  // namespace previz::rig::network_storm_test
