// `previzd check`: right sets are described, wrong ones refused with every problem.
#include "daemon/core/check/check.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/table.hpp"
#include "daemon/core/tracking/apriltag_tracker.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::check::check_test {

// One triangle (0,0,0) (1,0,0) (0,1,0); `material` is a glTF material's body.
std::string triangle(const std::string& material) {
  return R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
 "nodes": [{"mesh": 0}],
 "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
 "materials": [{)" +
         material +
         R"(}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                "min": [0, 0, 0], "max": [1, 1, 0]}],
 "bufferViews": [{"buffer": 0, "byteLength": 36}],
 "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,)"
         "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}]}";
}

class Check : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) {
    std::ofstream(directory_ / name) << text;
  }

  // Exit status; what was printed is in `said_`.
  int check_file(const std::string& name) {
    std::ostringstream out;
    const int status = check_set({directory_ / name}, out);
    said_ = out.str();
    return status;
  }
  int check(const std::string& set) {
    write("stage.toml", set);
    return check_file("stage.toml");
  }
  // Writes a file of a triangle and a sun in its plane.
  void write_sun() {
    std::string file = triangle("");
    file.insert(1, R"("extensionsUsed": ["KHR_lights_punctual"], "extensions":
      {"KHR_lights_punctual": {"lights": [{"type": "directional", "name": "sun",
                                           "intensity": 100000}]}}, )");
    const std::string plain = R"("nodes": [{"mesh": 0)";
    file.replace(file.find(plain), plain.size(),
                 plain + R"(, "extensions": {"KHR_lights_punctual": {"light": 0}})");
    write("a.gltf", file);
  }
  // Exit status for a set of one virtual object of a material, a glTF material's body.
  int check_material(const std::string& material) {
    write("a.gltf", triangle(material));
    return check(object);
  }

  // A take of one black frame of 16x8 pixels by each camera, with the object's file if there is
  // one.
  void write_take(const char* set, const std::vector<std::string>& cameras, double exposure = 1) {
    session::SessionInfo info;
    info.set_text = set;
    info.observer.emplace();
    info.observer->intrinsics = {
        .width = 16, .height = 8, .fx = 20, .fy = 20, .cx = 7.5, .cy = 3.5};
    info.observer->lens = {.focal_length_m = 0.035, .f_number = 2.8, .focus_distance_m = 1.5};
    session::SessionWriter writer(directory_ / "take", info);
    if (std::filesystem::exists(directory_ / "a.gltf"))
      writer.add_asset("a.gltf", directory_ / "a.gltf");
    for (const std::string& camera : cameras) {
      Frame frame;
      frame.source = camera;
      frame.width = 16;
      frame.height = 8;
      frame.exposure = exposure;
      frame.bytes.resize(frame_bytes(frame.format, frame.width, frame.height));
      writer.write(frame);
    }
    writer.close();
  }

  void expect_said(const std::string& words) { EXPECT_THAT(said_, HasSubstr(words)); }

  void expect_used(const std::string& words) { expect_in_list(words, false); }
  void expect_left_out(const std::string& words) { expect_in_list(words, true); }

  static inline const std::string object =
      "[[object]]\nname='a'\nfile='a.gltf'\npresence='virtual'\n";
  test::TemporaryDirectory directory_;
  std::string said_;

 private:
  // The list of what is left out comes after that of what is used.
  void expect_in_list(const std::string& words, bool is_left_out) {
    const auto at = said_.find(words);
    const auto left_out = said_.find("not used by this set, so switched off");
    ASSERT_NE(left_out, std::string::npos) << said_;
    ASSERT_THAT(said_, HasSubstr(words));
    if (is_left_out)
      EXPECT_THAT(said_.substr(left_out), HasSubstr(words));
    else
      EXPECT_LT(at, left_out) << words;
  }
};

TEST_F(Check, RemarksThatBothFoldersOfTakesAreOnOneDisk) {
  ASSERT_EQ(check("[recording]\nsecond_directory='more'\n"), 0) << said_;
  expect_said("recording.second_directory is now on the same disk as recording.directory");
  ASSERT_EQ(check("[recording]\nsecond_directory='/dev/shm/takes'\n"), 0) << said_;
  EXPECT_THAT(said_, Not(HasSubstr("second_directory")));
}

TEST_F(Check, RefusesAFolderOfTakesThatIsAFile) {
  write("takes", "a file");
  ASSERT_EQ(check("[recording]\ndirectory='takes'\n"), 1) << said_;
  expect_said("recording.directory: " + (directory_ / "takes").string() + " is a file");
  ASSERT_EQ(check("[recording]\nsecond_directory='takes/more'\n"), 1) << said_;
  expect_said("recording.second_directory: " + (directory_ / "takes").string() + " is a file");
}

constexpr const char* live_set = R"(
[observer]
driver = "v4l2"
device = "usb-camera"
[observer.camera]
width = 1920
height = 1080
rate_hz = 25.0
[light_camera]
driver = "none"
)";

TEST_F(Check, SaysForHowLongTheDiskLasts) {
  ASSERT_EQ(check(live_set), 0) << said_;
  expect_said("the cameras' pictures: about 104 MB per second, and about half of that recorded");
  expect_said("takes go to " + (directory_ / "takes").string());
  expect_said(" free, enough for at least ");
  ASSERT_EQ(check(std::string(live_set) + "[recording]\ncodec='raw'\n"), 0) << said_;
  expect_said("recorded as they are");
}

TEST_F(Check, SaysWhatItNeedsToKnowForThat) {
  ASSERT_EQ(check("[observer]\ndriver='v4l2'\ndevice='usb-camera'\n"), 0) << said_;
  expect_said("cannot be said without [observer.camera] rate_hz and the picture's size");
}

TEST_F(Check, RemarksOnADiskThatIsAlmostFull) {
  ASSERT_EQ(check("[recording]\nreserve_mb = 1e9\n"), 0) << said_;
  expect_said("recording.directory: the disk is almost full");
  expect_said("keeps 1e+06 GB free; no take can begin there");
}

TEST_F(Check, RemarksOnMemoryTooSmallForThePreRoll) {
  const auto with = [](const char* recording) {
    return std::string(live_set) + "[recording]\n" + recording;
  };
  // 1920 * 1080 * 2 * 25 bytes a second, of which half of a gigabyte holds 4.8 seconds.
  ASSERT_EQ(check(with("preroll_s = 10\nqueue_mb = 1000\n")), 0) << said_;
  expect_said("recording.preroll_s = 10: this needs about 1.04 GB of memory and there are 500 MB");
  expect_said("begins about 4.8 s before the button");
  ASSERT_EQ(check(with("preroll_s = 4\nqueue_mb = 1000\n")), 0) << said_;
  EXPECT_THAT(said_, Not(HasSubstr("preroll_s")));
  ASSERT_EQ(check(with("queue_mb = 1e6\n")), 0) << said_;
  expect_said("recording.queue_mb = 1e+06: this computer has ");
}

// A light camera that the set does not have sees nothing.
TEST_F(Check, NoLightCameraSeesNoLight) {
  write("a.gltf", triangle(R"("pbrMetallicRoughness": {"metallicFactor": 1})"));
  ASSERT_EQ(check(object + "[light_camera]\ndriver = 'none'\n"), 0) << said_;
  expect_said("light camera  none");
  expect_said("environment: from the session's light camera, if it has one");
}

// Nobody takes a panorama with its middle along the set's X by chance.
TEST_F(Check, RemarksOnAnEnvironmentThatNobodyTurned) {
  std::string grey;
  for (int pixel = 0; pixel < 8; ++pixel) grey += "\x80\x80\x80\x81";
  write("room.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n" + grey);
  const std::string set = "[lighting]\nenvironment='room.hdr'\n";
  ASSERT_EQ(check(set), 0) << said_;
  expect_said("previz calibrate light TAKE --rotation");
  ASSERT_EQ(check(set + "environment_rotation_deg=70\n"), 0) << said_;
  EXPECT_THAT(said_, Not(HasSubstr("--rotation")));
}

TEST_F(Check, DescribesWhatASetAsksFor) {
  write("table.gltf", triangle(R"("pbrMetallicRoughness": {"metallicFactor": 0})"));
  write("ring.gltf", triangle(R"("pbrMetallicRoughness": {"metallicFactor": 1})"));
  ASSERT_EQ(check(R"(
tag = [{id = 4, size_m = 0.0805, position_m = [0, 0, 0]},
       {id = 9, size_m = 0.05, carrier = "stick"}]
object = [{name = "table", file = "table.gltf", presence = "phantom"},
          {name = "ring", file = "ring.gltf", presence = "virtual"}]
[[light]]
name = "spot"
type = "point"
position_m = [0, 0, 1]
emission = [1, 1, 1]
gain_mixed = 0.5
gain_real = 1
[set]
name = "ring on a table"
[quality]
samples = 1500
)"),
            0)
      << said_;
  expect_said("ring on a table (");
  expect_said("1 tag of family tag36h11: 4 (80.5 mm)");
  expect_said("carrier stick: 1 tag: 9 (50 mm)");
  expect_said("table: phantom, 1 triangle in 1 instance, from table.gltf");
  expect_said("ring: virtual, 1 triangle in 1 instance, from ring.gltf");
  expect_said("spot: point, dimmed, gain 0.5 in the composite, 1 on the real set");
  expect_said("1 500 samples per pixel");
  expect_said("geometry: 2 triangles, or 2 counting every copy of an object");
  expect_used("metal: an object is metal");
  expect_used("two worlds: an object is virtual, removed");
  expect_used("lamps: the set or a model has lamps");
  expect_used("relighting: a lamp is added, switched off, dimmed");
  expect_used("denoiser: noise is removed");
  expect_left_out("refraction");
  expect_left_out("removed objects");
  expect_left_out("lens");
  expect_left_out("photons");
  expect_said("scene in the GPU's memory: about 1 MiB");
  expect_said("no film camera calibration here");
}

TEST_F(Check, SaysWhatDraws) {
  ASSERT_EQ(check_material(""), 0) << said_;
  EXPECT_THAT(said_, testing::ContainsRegex("this computer\n  draws .*[(].*; memory: [0-9]"));
}

// 1920x1080 pixels with two frames on each side: 5 kept frames of 176 bytes and 3 layers of 80 can
// lie in files; 400 MB and 10 frames of 9 cannot. On the card a pixel has 190 bytes and 226 of a
// band, and 168 of history where it is averaged.
TEST_F(Check, SaysHowMuchMemoryARenderTakes) {
  const std::string lens =
      "[observer.intrinsics]\nwidth=1920\nheight=1080\nfx=1866.0\nfy=1866.0\ncx=959.5\ncy=539.5\n";
  const std::string words = "offline, in the computer's memory: about ";
  ASSERT_EQ(check(lens), 0) << said_;
  expect_said(words + "2975 MiB, or 578 MiB and scratch files of 2397 MiB");
  ASSERT_EQ(check(lens + "[quality]\nneighbours=1\n"), 0) << said_;
  expect_said("picture in the GPU's memory: about 1169 MiB");
  for (const char* quality : {"neighbours=0\n", "denoise=false\n"}) {
    ASSERT_EQ(check(lens + "[quality]\n" + quality), 0) << said_;
    expect_said("scratch files of 499 MiB");
  }
  expect_said("picture in the GPU's memory: about 837 MiB");
}

// E lux are E / pi times white at exposure 1. A live camera's is its shutter time times its gain
// and responsivity; while it exposes by itself, nothing is known of its white.
TEST_F(Check, ComparesLampsWithWhite) {
  write_sun();
  const std::string sun =
      "sun: directional, added, gain 1 in the composite, 0 on the real set; 100000 lux in its "
      "file: a white sheet that faces it is ";
  const std::string too_bright = "  object \"a\": with its lamp \"sun\" of 100000 lux";
  ASSERT_EQ(check(object), 0) << said_;
  expect_said(sun + "31831 times white at exposure 1\n");
  expect_said(too_bright);
  ASSERT_EQ(check(object + "lamp_gain=1e-4\n"), 0) << said_;
  expect_said(sun + "3.183 times white at exposure 1\n");
  EXPECT_THAT(said_, Not(HasSubstr(too_bright)));
  ASSERT_EQ(check("[observer]\nexposure=0.01\n" + object), 0) << said_;
  expect_said(sun + "318.3 times white\n");
  expect_said(too_bright);
  ASSERT_EQ(check(live_set + object), 0) << said_;
  expect_said(sun + "31831 times white at exposure 1\n");
  EXPECT_THAT(said_, Not(HasSubstr(too_bright)));
  ASSERT_EQ(check("[observer]\ndriver='v4l2'\ndevice='usb-camera'\n"
                  "camera={exposure_s=0.004, gain=2.5}\n[light_camera]\ndriver='none'\n" +
                  object),
            0)
      << said_;
  expect_said(sun + "318.3 times white\n");
  expect_said(too_bright);
  for (const char* gain : {"-1", "inf", "nan", "1e7"})
    EXPECT_EQ(check(object + "lamp_gain=" + gain + "\n"), 1) << gain;
}

// The take has the exposure of its frames, and lamp_gain as it was recorded.
TEST_F(Check, ComparesLampsWithTheWhiteOfATake) {
  write_sun();
  write_take((object + "lamp_gain=0.25\n").c_str(), {"observer", "light"}, 0.02);
  ASSERT_EQ(check_file("take"), 0) << said_;
  expect_said("100000 lux in its file: a white sheet that faces it is 159.2 times white\n");
  expect_said("set the object's lamp_gain = 0.00157 (just white)");
}

// One of a virtual object is chosen by the set, and all are there for the buttons.
TEST_F(Check, NamesTheVariantsOfAnObject) {
  std::string file = triangle(R"("name": "matt"}, {"name": "gold", "emissiveFactor": [1, 1, 0])");
  const std::string plain = R"("material": 0})";
  file.replace(file.find(plain), plain.size(), R"("material": 0, "extensions":
    {"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [1]}]}}})");
  file.insert(1, R"("extensionsUsed": ["KHR_materials_variants"], "extensions":
    {"KHR_materials_variants": {"variants": [{"name": "by day"}, {"name": "by night"}]}}, )");
  write("a.gltf", file);
  ASSERT_EQ(check(object + "variant='by night'\n"), 0) << said_;
  expect_said("from a.gltf, variant \"by night\"\n");
  expect_said("its variants, for the buttons: \"by day\", \"by night\"\n");
  ASSERT_EQ(check(object), 0) << said_;
  expect_used("glowing surfaces: a surface gives off light");  // it may, at the press of a button
  EXPECT_EQ(check(object + "variant='at noon'\n"), 1);
  expect_said("a.gltf: no variant \"at noon\"; it has \"by day\", \"by night\"");
}

// A material may be of a kind that lets light through and let none through: the renderer then
// leaves alpha out (`Alpha.is_left_out_where_every_texel_is_opaque`), and that is what is said.
TEST_F(Check, AgreesWithTheRendererThatSolidBlendingNeedsNoAlpha) {
  const auto material = [](const char* alpha) {
    return std::string(R"("alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": )") +
           "[1, 1, 1, " + alpha + "]}";
  };
  ASSERT_EQ(check_material(material("1")), 0) << said_;
  expect_left_out("alpha");
  ASSERT_EQ(check_material(material("0.5")), 0) << said_;
  expect_used("alpha: a surface has holes or is see-through");
}

TEST_F(Check, SaysWhatIsColouredInside) {
  const int status = check_material(R"("name": "bottle",
    "pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": {
    "KHR_materials_transmission": {"transmissionFactor": 1},
    "KHR_materials_volume": {"thicknessFactor": 0.01, "attenuationColor": [0, 1, 0],
                             "attenuationDistance": 0.1}})");
  ASSERT_EQ(status, 0) << said_;
  expect_used("coloured glass: glass or a liquid tints light, the more the thicker it is");
}

TEST_F(Check, TakesSetAndCalibrationOfASession) {
  write_take(
      "[set]\nname = 'recorded'\n[tracking]\nenabled = false\n[lighting]\nmode = 'sources'\n",
      {"observer", "light"});
  ASSERT_EQ(check_file("take"), 0) << said_;
  expect_said("recorded (");
  expect_said("its lamps light the set; the rest is blurred");
  expect_used(
      "lamps: the set or a model has lamps, a surface glows, or lamps are found in the "
      "environment light");
  expect_said("16x8, 35 mm lens at f/2.8, focus at 1.5 m");
  expect_used("lens: the aperture blurs what is out of focus");
  expect_said("tracking is off: only a session with recorded poses can be used");
}

// It said that nothing is virtual, and nothing of the tracking.
TEST_F(Check, SaysThatATakeCannotBeTracked) {
  write_take(
      "[set]\nname = 'lost'\n[lighting]\nmode = 'sources'\n[[tag]]\nid = 3\nsize_m = 0.1\n"
      "position_m = [0, 0, 0]\n",
      {"observer", "light"});
  ASSERT_EQ(check_file("take"), 0) << said_;
  expect_said("tracking: none of 1 frame looked at has a pose (no tag in the picture)");
}

// `render` refuses it later.
TEST_F(Check, ATakeWithoutLightIsAProblem) {
  write_take("[set]\nname = 'dark'\n[tracking]\nenabled = false\n", {"observer"});
  EXPECT_EQ(check_file("take"), 1);
  expect_said("the session has no light frames, and the set file no lighting.environment: give");
}

// Twenty-two mistakes of beginners; what is allowed and odd is said, and the rest refused.
TEST_F(Check, FindsImplausibleUnits) {
  const auto odd = [&](const std::string& set, const std::string& words) {
    EXPECT_EQ(check(set), 0) << said_;
    expect_said(words);
  };
  const std::string lens = "[observer.intrinsics]\nwidth=1920\nheight=1080\ncx=959.5\ncy=539.5\n";
  odd("[[tag]]\nid=3\nsize_m=80.0\nposition_m=[0.0,0.0,0.0]\n",
      "tag 3: its side is 80 m; sizes are in metres, so 80 mm is 0.08");
  odd("[[tag]]\nid=3\nsize_m=0.8\nposition_m=[0.0,0.0,0.0]\n",
      "tag 3: its side is 0.8 m; sizes are in metres, so 80 mm is 0.08");
  odd("[[tag]]\nid=3\nsize_m=0.08\nposition_m=[1350.0,0.0,0.0]\n",
      "tag 3: it is 1350 m from the origin");
  odd(lens + "fx=18.664\nfy=18.664\n",
      "fx = 18.664: a picture 1920 px wide would show 178 degrees");
  odd(lens + "fx=1866.0\nfy=1244.0\n", "differ by 50 %");
  odd("[observer.intrinsics]\nwidth=1920\nheight=1080\ncx=319.5\ncy=239.5\nfx=1866.0\nfy=1866.0\n",
      "are these numbers for another picture size?");
  odd(lens +
          "fx=1866.0\nfy=1866.0\n[observer.lens]\nfocal_length_mm=0.035\nf_number=2.8\n"
          "focus_distance_m=1.8\n",
      "focal_length_mm = 0.035: it is in millimetres");
  odd("[observer]\ndriver='v4l2'\ndevice='a'\n[observer.camera]\nrate_hz=30.0\nexposure_s=0.5\n",
      "exposes for 0.5 s, longer than a frame lasts at 30 per second (0.0333 s)");
}

// The numbers of another picture size: a live set would be refused.
TEST_F(Check, RefusesTheIntrinsicsOfAnotherPictureSize) {
  const std::string set =
      "[observer]\ndriver='v4l2'\ndevice='a'\n[observer.camera]\nwidth=1280\nheight=720\n"
      "[observer.intrinsics]\nwidth=1920\nheight=1080\nfx=1866.0\nfy=1866.0\ncx=959.5\ncy=539.5\n";
  EXPECT_EQ(check(set), 1);
  expect_said("[observer.camera] is 1280x720 and [observer.intrinsics] is for 1920x1080");
  expect_said("multiply fx and cx + 0.5 by 0.666667");
}

// What somebody copies on the first day, with the models that come along.
TEST_F(Check, TheExampleIsRightAsCopied) {
  const std::filesystem::path config = PREVIZ_SOURCE_DIR "/config";
  std::filesystem::copy(config / "set.example.toml", directory_ / "my_set.toml");
  std::filesystem::copy(config / "stage", directory_ / "stage",
                        std::filesystem::copy_options::recursive);
  EXPECT_EQ(check_file("my_set.toml"), 0) << said_;
  EXPECT_THAT(said_, Not(HasSubstr("[observer")));  // nothing is odd
}

TEST_F(Check, RefusesWithEveryProblemOfTheSetFile) {
  EXPECT_EQ(check("[quality]\nsamples = 0\nscala = 1\n"), 1);
  expect_said("stage.toml:2:11: quality.samples: ");
  expect_said("stage.toml:3:1: quality.scala: ");
  expect_said("2 problems\n");
}

TEST_F(Check, RefusesWithEveryFileThatIsWrong) {
  write("a.gltf", "no glTF");
  write("b.gltf", "{}");
  write("env.exr", "no EXR");
  EXPECT_EQ(check("[[object]]\nname='a'\nfile='a.gltf'\npresence='phantom'\n"
                  "[[object]]\nname='b'\nfile='b.gltf'\npresence='virtual'\n"
                  "[lighting]\nenvironment='env.exr'\n"),
            1);
  expect_said("a.gltf");
  expect_said("b.gltf");
  expect_said("env.exr");
  expect_said("3 problems\n");
}

TEST_F(Check, RefusesWhatIsNotThere) {
  EXPECT_EQ(check_file("no.toml"), 1);
  expect_said("no.toml");
  EXPECT_EQ(check_file("."), 1);  // a folder that is no session
}

// The families that the set file's table offers are those that the tracker names. (It is not made
// for each: the large families take it minutes.)
TEST_F(Check, TagFamiliesOfTheTableAreTheTrackers) {
  std::string of_table;
  set::Draft draft;
  for (const auto& section : set::sections(draft))
    if (section.path == "tracking")
      for (const auto& key : section.open().keys)
        if (key.name == "family") of_table = key.allowed;
  std::erase(of_table, '"');
  of_table = std::regex_replace(of_table, std::regex(R"( \| )"), ", ");
  set::Tracking tracking;
  tracking.family = "none of them";
  EXPECT_THAT(test::error_of([&] {
                tracking::make_apriltag_tracker(
                    tracking, {.width = 640, .height = 480, .fx = 600, .fy = 600});
              }),
              testing::EndsWith(of_table));
}

TEST_F(Check, LoadsTheRoom) {
  const std::string camera =
      "[light_camera.intrinsics]\nwidth=64\nheight=64\nfx=20.0\nfy=20.0\ncx=31.5\ncy=31.5\n"
      "max_angle_deg=90\n[light_camera.pose]\nposition_m=[0,0,5]\n";
  EXPECT_NE(check(camera + "[lighting.room]\nsize_m=[4,4,3]\n"), 0);
  expect_said("lighting.room: the light camera is not inside the box");
  write("empty.gltf", R"({"asset": {"version": "2.0"}})");
  EXPECT_NE(check(camera + "[lighting.room]\nfile='empty.gltf'\n"), 0);
  expect_said("holds no surface");
  EXPECT_EQ(check(camera + "[lighting.room]\nsize_m=[4,4,3]\nposition_m=[0,0,4]\n"
                           "seen_from_m=[0,0,4]\n"),
            0);
}

// Tag 1 is a node of the phantom, tag 7 is not.
TEST_F(Check, NamesTagsThatCannotBeHidden) {
  std::string file = triangle("\"name\": \"paper\"");
  file.insert(file.find("\"mesh\": 0}"), "\"name\": \"tag 1 paper\", ");
  write("real.gltf", file);
  const std::string set =
      "[[object]]\nname='real'\nfile='real.gltf'\npresence='phantom'\n"
      "[[tag]]\nid=1\nsize_m=0.1\nposition_m=[0,0,0]\n[[tag]]\nid=7\nsize_m=0.1\nposition_m=[1,0,0]"
      "\n";
  check(set);
  EXPECT_THAT(said_, Not(HasSubstr("tags are hidden")));
  EXPECT_THAT(said_, HasSubstr("the composite will equal the plate"));
  check(set + "[tags]\nhide = true\n");
  EXPECT_THAT(said_, Not(HasSubstr("the composite will equal the plate")));
  EXPECT_THAT(said_, HasSubstr("tags are hidden, but these are in no phantom and stay in the "
                               "picture: 7;"));
  EXPECT_THAT(said_, HasSubstr("no phantom has what is under these, so that their outlines may be "
                               "seen: 1;"));
}

}  // namespace previz::check::check_test
