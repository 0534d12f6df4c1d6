// What moves in a take, from end to end: a lamp on a stick with a tag, and an object that is
// animated; found in pictures whose poses the test knows, shown, recorded, and rendered again.
#include <glm/gtc/matrix_transform.hpp>

#include "drivers/plate.hpp"
#include "tests/support/gltf_writer.hpp"
#include "tests/support/lighting.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::moving_test {

using pipeline::Shot;
using Json = test::GltfWriter::Json;

constexpr int frames = 4;
constexpr int without_stick = 2;  // the frame in which it is out of the picture
constexpr std::int64_t start_ns = 1'000'000'000'000, interval_ns = 40'000'000;
constexpr double albedo = 0.5, lamp_over_tag_m = 0.2;

test::TagScene table() {
  test::TagScene scene;
  scene.lens = test::plain_lens(320, 240, 300);
  scene.tags = {test::flat_tag(0, 0.08, {0, 0.05, 0}), test::flat_tag(1, 0.08, {0.22, -0.05, 0}),
                test::flat_tag(2, 0.08, {-0.18, 0.15, 0})};
  scene.world_from_camera = test::camera_looking({0.1, -0.6, 0.45}, {0.02, 0.03, 0});
  return scene;
}

// Held towards the camera, and moved along X.
glm::dmat4 world_from_stick(int frame) {
  return glm::rotate(glm::translate(glm::dmat4(1), {-0.1 + 0.05 * frame, -0.2, 0.06}), 0.5,
                     glm::dvec3(1, 0.2, 0));
}

Frame picture(int index) {
  test::TagScene scene = table();
  if (index != without_stick) {
    scene.tags.push_back(test::flat_tag(9, 0.08, {0, 0, 0}));
    scene.tags.back().world_from_tag = world_from_stick(index);
  }
  std::mt19937 random(1);
  Frame frame = test::expose(test::render(scene), {}, random);
  frame.sequence = static_cast<std::uint64_t>(index);
  frame.timestamp_ns = frame.arrival_ns = start_ns + index * interval_ns;
  return frame;
}

// A square of this side, facing up, of a matt grey; `animated`: each second it goes along X and
// back while one of its corners is lifted.
void write_square(const std::filesystem::path& file, float side_m, float height_m, bool animated) {
  test::GltfWriter gltf;
  const float s = side_m / 2;
  const int positions =
      gltf.positions({{-s, height_m, s}, {s, height_m, s}, {s, height_m, -s}, {-s, height_m, -s}});
  const int indices = gltf.indices({0, 1, 2, 0, 2, 3});
  const int material = gltf.add(
      "materials", {{"pbrMetallicRoughness",
                     {{"baseColorFactor", {albedo, albedo, albedo, 1}}, {"metallicFactor", 0}}},
                    {"extensions", {{"KHR_materials_specular", {{"specularFactor", 0}}}}}});
  gltf.json["extensionsUsed"] = {"KHR_materials_specular"};
  Json primitive = {
      {"attributes", {{"POSITION", positions}}}, {"indices", indices}, {"material", material}};
  if (animated) {
    primitive["targets"] = {
        {{"POSITION", gltf.positions({{0, 0, 0}, {0, s, 0}, {0, 0, 0}, {0, 0, 0}})}}};
    const int times = gltf.values<float>(5126, "SCALAR", {0, 0.5, 1});
    const int places = gltf.positions({{0, 0, 0}, {0.1f, 0, 0}, {0, 0, 0}});
    const int weights = gltf.values<float>(5126, "SCALAR", {0, 1, 0});
    gltf.json["animations"] = {
        {{"name", "sway"},
         {"channels",
          {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}},
           {{"sampler", 1}, {"target", {{"node", 0}, {"path", "weights"}}}}}},
         {"samplers",
          {{{"input", times}, {"output", places}}, {{"input", times}, {"output", weights}}}}}};
  }
  gltf.root("square", gltf.mesh(primitive));
  gltf.save(file);
}

std::string set_text(const std::string& more) {
  std::ostringstream text;
  text
      << "[observer]\ndriver = \"replay\"\ndevice = \"session\"\n"
         "[light_camera]\ndriver = \"none\"\n[lighting]\nenvironment = \"black.exr\"\n"
         "[[object]]\nname = \"floor\"\nfile = \"floor.gltf\"\npresence = \"phantom\"\n"
         "[[light]]\nname = \"lamp\"\ntype = \"point\"\nemission = [1, 1, 1]\ncarrier = \"stick\"\n"
         "position_m = [0, 0, "
      << lamp_over_tag_m << "]\n[[tag]]\nid = 9\nsize_m = 0.08\ncarrier = \"stick\"\n";
  for (const set::Tag& tag : table().tags) {
    const glm::dvec4& at = tag.world_from_tag[3];
    text << "[[tag]]\nid = " << tag.id << "\nsize_m = 0.08\nposition_m = [" << at.x << ", " << at.y
         << ", 0]\n";
  }
  return text.str() + more;
}

class MovingTake : public test::RigLive {
 protected:
  void write_take(const std::string& more = "") {
    write_square(directory_ / "floor.gltf", 4, 0, false);
    write_square(directory_ / "card.gltf", 0.1f, 0.05f, true);
    lighting::write_exr_picture(directory_ / "black.exr", {8, 4, std::vector<glm::vec3>(32)});
    std::ofstream(directory_ / "set.toml") << set_text(more);
    session::SessionInfo info;
    info.set_text = set_text(more);
    info.observer.emplace();
    info.observer->intrinsics = table().lens;
    session::SessionWriter writer(directory_ / "session", info);
    for (int i = 0; i < frames; ++i) writer.write(picture(i));
    writer.close();
  }

  // Frames as `previz render` makes them.
  std::vector<Shot> rendered_shots(const std::filesystem::path& take,
                                   const std::filesystem::path& set,
                                   const std::optional<post::FrameRange>& range = {}) {
    post::RenderOptions options;
    options.session = take;
    options.set_file = set;
    options.frames = range;
    options.directory = directory_ / "out";
    options.force = true;
    options.neighbours = 0;
    options.exr = options.png = options.video = false;
    std::vector<Shot> shots;
    options.on_frame = [&](const Shot& shot) { shots.push_back(shot); };
    post::render_session(options, out_);
    return shots;
  }

  std::ostringstream out_;
};

// What a matt floor sends back of a point lamp of 1 W/sr: rho / pi * h / r^3.
double floor_radiance(const glm::dvec3& lamp, const glm::dvec3& point) {
  const double r = glm::distance(lamp, point);
  return albedo / std::numbers::pi * lamp.z / (r * r * r);
}

glm::dvec3 floor_seen_at(const Shot& shot, double x, double y) {
  const PinholeIntrinsics lens = table().lens;
  const glm::dmat4& camera = shot.track.pose->world_from_camera;
  const glm::dvec3 ray =
      glm::dmat3(camera) * glm::dvec3((x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy, 1);
  const glm::dvec3 eye(camera[3]);
  return eye - ray * (eye.z / ray.z);
}

// All samples of a pixel see the floor within 1.5 px of its centre: their mean lies between the
// extremes there, which nine points find to a thousandth: the radiance bends by 4.5 / h^2 of
// itself, h at least 0.2 m, and a pixel is some 3 mm.
void expect_lit_by(const glm::dvec3& lamp, const Shot& shot) {
  for (int y = 20; y < shot.layers->height; y += 20)
    for (int x = 20; x < shot.layers->width; x += 20) {
      double low = HUGE_VAL, high = 0;
      for (const double dy : {-1.5, 0.0, 1.5})
        for (const double dx : {-1.5, 0.0, 1.5}) {
          const double radiance = floor_radiance(lamp, floor_seen_at(shot, x + dx, y + dy));
          low = std::min(low, radiance);
          high = std::max(high, radiance);
        }
      const float found = shot.layers->diff[static_cast<std::size_t>(y * shot.layers->width + x)].r;
      EXPECT_GE(found, low * (1 - 1e-3)) << x << ", " << y;
      EXPECT_LE(found, high * (1 + 1e-3)) << x << ", " << y;
    }
}

double sigma(const session::CarrierState& carrier, int first) {
  const auto& c = carrier.covariance;
  return std::sqrt(c[7 * first] + c[7 * first + 7] + c[7 * first + 14]);
}

// P20 by hand: the lamp lights the floor from where the stick holds it, in every frame.
TEST_F(MovingTake, ALampOnAStickLightsFromWhereItIsHeld) {
  write_take("[quality]\nsamples = 2\n");
  const std::vector<Shot> shots = rendered_shots(directory_ / "session", directory_ / "set.toml");
  ASSERT_EQ(shots.size(), std::size_t{frames});
  for (const Shot& shot : shots) {
    ASSERT_TRUE(shot.track.pose) << shot.index << ": " << shot.track.reason;
    const session::CarrierState& stick = shot.motion.carriers.at("stick");
    const bool is_seen = shot.index != without_stick;
    EXPECT_EQ(stick.tags, is_seen ? std::vector<int>{9} : std::vector<int>{});
    const glm::dmat4 truth = world_from_stick(int(is_seen ? shot.index : shot.index - 1));
    // Five standard deviations of what it claims, and that is small.
    const glm::dvec3 miss(stick.world_from_carrier[3] - truth[3]);
    EXPECT_LT(glm::length(miss), 5 * sigma(stick, 3)) << shot.index;
    EXPECT_LT(sigma(stick, 3), 0.005);
    EXPECT_LT(sigma(stick, 0), 0.05);
    expect_lit_by(glm::dvec3(stick.world_from_carrier * glm::dvec4(0, 0, lamp_over_tag_m, 1)),
                  shot);
  }
  EXPECT_THAT(out_.str(),
              HasSubstr("carrier \"stick\" is not found (none of its tags in the picture); it "
                        "stays where it was"));
}

// A range that begins where the stick is out of the picture gives what the whole take gives.
TEST_F(MovingTake, ARangeKnowsWhatCameBeforeIt) {
  write_take("[quality]\nsamples = 1\n");
  const auto stick_of = [](const Shot& shot) { return shot.motion.carriers.at("stick"); };
  const std::vector<Shot> whole = rendered_shots(directory_ / "session", directory_ / "set.toml");
  const std::vector<Shot> alone = rendered_shots(directory_ / "session", directory_ / "set.toml",
                                                 post::FrameRange{without_stick, without_stick});
  ASSERT_EQ(alone.size(), 1u);
  EXPECT_EQ(stick_of(alone[0]), stick_of(whole.at(without_stick)));
}

// Returns by how many codes two pictures differ at most.
int most_codes_between(const Plate& a, const Plate& b) {
  if (a.samples.size() != b.samples.size()) return 1 << 16;
  int most = 0;
  for (std::size_t i = 0; i < a.samples.size(); ++i)
    most = std::max(most, std::abs(a.samples[i] - b.samples[i]));
  return most;
}

// P21: the rig records the take while it plays it; what is rendered of the recording with its poses
// is what the display showed, but for a code by which that was dithered, where live neither
// averages over frames nor smooths poses.
TEST_F(MovingTake, IsRenderedAsItWasShown) {
  const std::string more =
      "[quality]\nsamples = 2\naccumulate = false\n[recording]\npreroll_s = 0\nslate = "
      "\"12A\"\nreserve_mb = 1\n"
      "[[object]]\nname = \"card\"\nfile = \"card.gltf\"\npresence = \"virtual\"\n"
      "position_m = [-0.1, 0, 0]\nanimation = \"sway\"\n"
      "[[button]]\nname = \"record\"\naction = \"record\"\n"
      "[tracking]\nsmooth = false\n";
  write_take(more);
  std::map<std::int64_t, Shot> shown;
  while_shown_ = [&] {
    const std::lock_guard lock(mutex_);
    if (shown_.shot.untouched.empty()) shown[shown_.shot.frame->timestamp_ns] = shown_.shot;
  };
  run([&] {
    begin_take();
    until_more(8);
  });

  std::ofstream(directory_ / "as_recorded.toml") << set_text(more) + "enabled = false\n";
  session::Session take = session::open_session(take_folder());
  const auto stream = session::open_stream(take, "observer");
  const auto& records = stream->records();
  int compared = 0;
  double first_s = 0, last_s = 0;
  for (std::uint64_t i = 0; i < records.size() && compared < 3; ++i) {
    const auto was = shown.find(records[i].timestamp_ns);
    if (was == shown.end()) continue;
    const Shot again =
        rendered_shots(take.directory, directory_ / "as_recorded.toml", post::FrameRange{i, i})
            .at(0);
    EXPECT_EQ(again.scene, was->second.scene);
    EXPECT_EQ(again.motion.carriers, was->second.motion.carriers);
    EXPECT_LE(most_codes_between(*again.picture, *was->second.picture), 1) << i;
    ASSERT_TRUE(again.scene.animation_s);
    if (compared++ == 0) first_s = *again.scene.animation_s;
    last_s = *again.scene.animation_s;
  }
  EXPECT_EQ(compared, 3);
  EXPECT_GT(last_s, first_s);
}

}  // namespace previz::moving_test
