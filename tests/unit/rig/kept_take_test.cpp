// Takes that earlier versions recorded stay readable for ever: each folder of tests/kept_takes
// holds one, and expected.json, what was in it on the day it was recorded.
//
// A version that records something new gets a further folder; those that are there are never made
// anew. It is recorded by
//   build/release/tests/unit/test_rig --gtest_also_run_disabled_tests
//   --gtest_filter=KeptTakeRecording.*
#include <nlohmann/json.hpp>

#include "tests/support/content_of.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::kept_take_test {

using Json = nlohmann::json;
namespace fs = std::filesystem;

const fs::path kept = fs::path(PREVIZ_SOURCE_DIR) / "tests/kept_takes";
constexpr int samples = 64, blocks_across = 4, blocks_down = 3;

// FNV-1a of 64 bits, in words that JSON keeps.
std::string hash_of(const std::vector<std::uint8_t>& bytes) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const std::uint8_t byte : bytes) hash = (hash ^ byte) * 0x100000001b3u;
  std::ostringstream text;
  text << std::hex << hash;
  return text.str();
}

// Every picture of the take, bit for bit, and what is known of it.
Json streams_of(const fs::path& take) {
  session::Session session = session::open_session(take);
  Json streams;
  for (const char* source : {"observer", "light", "composite"}) {
    const auto stream = session::open_stream(session, source);
    if (!stream) continue;
    Json& frames = streams[source] = Json::array();
    for (std::size_t i = 0; i < stream->records().size(); ++i) {
      const FramePtr frame = stream->read(i);
      frames.push_back({{"sequence", frame->sequence},
                        {"timestamp_ns", frame->timestamp_ns},
                        {"arrival_ns", frame->arrival_ns},
                        {"exposure_s", frame->exposure_s},
                        {"gain", frame->gain},
                        {"exposure", frame->exposure},
                        {"format", to_string(frame->format)},
                        {"width", frame->width},
                        {"height", frame->height},
                        {"bytes", hash_of(frame->bytes)}});
    }
  }
  EXPECT_TRUE(session.missing.empty()) << testing::PrintToString(session.missing);
  return streams;
}

// The mean of the composite over each block of a picture, and the variance of that mean by the
// renderer's own estimate.
Json blocks_of(const render::Layers& layers) {
  const int width = layers.width / blocks_across, height = layers.height / blocks_down;
  Json blocks = Json::array();
  for (int block = 0; block < blocks_across * blocks_down; ++block) {
    glm::dvec3 sum(0), variance(0);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const int column = block % blocks_across * width + x,
                  row = block / blocks_across * height + y;
        const auto pixel = static_cast<std::size_t>(row * layers.width + column);
        sum += glm::dvec3(layers.composite[pixel]);
        variance += glm::dvec3(layers.variance[pixel]);
      }
    const double pixels = width * height;
    for (int c = 0; c < 3; ++c)
      blocks.push_back({sum[c] / pixels, variance[c] / (pixels * pixels)});
  }
  return blocks;
}

// Each frame's blocks, and why its plate was left as it is, where it was.
Json pictures_of(const fs::path& take, const fs::path& directory) {
  post::RenderOptions options;
  options.session = take;
  options.directory = directory;
  options.samples = samples;
  options.neighbours = 0;
  options.exr = options.video = false;
  Json pictures = Json::array();
  options.on_frame = [&](const pipeline::Shot& shot) {
    pictures.push_back({{"untouched", shot.untouched},
                        {"blocks", shot.layers ? blocks_of(*shot.layers) : Json::array()}});
  };
  std::ostringstream ignored;
  post::render_session(options, ignored);
  return pictures;
}

// Returns the lines of a take's file as they are written, for this test to read by itself.
std::vector<Json> lines_of(const fs::path& file) {
  std::ifstream stream(file);
  std::vector<Json> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(Json::parse(line));
  return lines;
}

// Compares with the numbers of a line, by which a matrix is written row by row.
void expect_matrix(const glm::dmat4& matrix, const Json& numbers) {
  ASSERT_EQ(numbers.size(), 16u);
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      EXPECT_EQ(matrix[column][row], numbers[static_cast<std::size_t>(4 * row + column)]);
}

void expect_vector(const glm::dvec3& vector, const Json& numbers) {
  ASSERT_EQ(numbers.size(), 3u);
  for (int c = 0; c < 3; ++c) EXPECT_EQ(vector[c], numbers[static_cast<std::size_t>(c)]);
}

void expect_light(const session::CapturedLight& light, const Json& line) {
  ASSERT_EQ(light.sources.size(), line.at("sources").size());
  for (std::size_t i = 0; i < light.sources.size(); ++i) {
    const Json& source = line["sources"][i];
    EXPECT_EQ(light.sources[i].id, source.at("id"));
    EXPECT_EQ(light.sources[i].solid_angle_sr, source.at("solid_angle_sr"));
    expect_vector(light.sources[i].direction, source.at("direction"));
    expect_vector(light.sources[i].flux, source.at("flux"));
  }
  EXPECT_EQ(
      static_cast<std::size_t>(light.ambient_size) * static_cast<std::size_t>(light.ambient_size),
      light.ambient.size());
}

// Poses, tags, what was moved, relit and given other materials, and the light, bit for bit.
void expect_track(const fs::path& take) {
  const session::Session session = session::open_session(take);
  const std::vector<Json> lines = lines_of(take / "track.jsonl");
  ASSERT_EQ(session.track.size(), lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    SCOPED_TRACE(i);
    const session::TrackRecord& record = session.track[i];
    const Json& line = lines[i];
    EXPECT_EQ(record.frame, line.at("frame"));
    EXPECT_EQ(record.timestamp_ns, line.at("timestamp_ns"));
    EXPECT_EQ(record.tracked, line.at("tracked"));
    EXPECT_EQ(Json(record.tags), line.at("tags"));
    if (record.tracked) {
      expect_matrix(record.world_from_camera, line.at("world_from_camera"));
      EXPECT_EQ(Json(record.covariance), line.at("covariance"));
    }
    EXPECT_EQ(record.scene.objects.size(), line.value("objects", Json::object()).size());
    for (const auto& [name, place] : record.scene.objects)
      expect_matrix(place.value(), line["objects"].at(name));
    EXPECT_EQ(record.scene.lights.size(), line.value("lights", Json::object()).size());
    for (const auto& [name, lamp] : record.scene.lights) {
      EXPECT_EQ(lamp->gain_mixed, line["lights"].at(name).at("gain_mixed"));
      expect_vector(lamp->tint, line["lights"].at(name).at("tint"));
    }
    EXPECT_EQ(Json(record.scene.variants), line.value("variants", Json::object()));
    ASSERT_EQ(record.captured_light.has_value(), line.contains("captured_light"));
    if (record.captured_light) expect_light(*record.captured_light, line["captured_light"]);
  }
}

// A version may choose other random numbers or take samples in another way: a block's mean then
// differs by the noise of both. The tolerance is five standard errors of the difference, which one
// of two million such means exceeds, and what rounding of floats adds to a mean of 144 pixels.
void expect_alike(const Json& now, const Json& then) {
  ASSERT_EQ(now.size(), then.size());
  for (std::size_t i = 0; i < now.size(); ++i) {
    const double mean = then[i][0],
                 tolerance = 5 * std::sqrt(now[i][1].get<double>() + then[i][1].get<double>()) +
                             1e-5 * std::abs(mean);
    EXPECT_NEAR(now[i][0].get<double>(), mean, tolerance)
        << "block " << i / 3 << ", channel " << i % 3;
  }
}

TEST(KeptTake, IsReadAndRenderedAsEver) {
  int takes = 0;
  for (const auto& folder : fs::directory_iterator(kept)) {
    if (!folder.is_directory()) continue;
    SCOPED_TRACE(folder.path());
    ++takes;
    const fs::path take = folder.path() / "take";
    const Json expected = Json::parse(test::content_of(folder.path() / "expected.json"));
    EXPECT_EQ(streams_of(take), expected.at("streams"));
    expect_track(take);
    const session::SessionInfo info = session::open_session(take).info;
    EXPECT_EQ(info.observer->intrinsics.fx, 40);
    EXPECT_EQ(info.observer->intrinsics.k1, 0.05);
    EXPECT_EQ(info.light->intrinsics.max_angle_rad, 1.57);
    EXPECT_EQ(info.take->slate, "12A");
    EXPECT_TRUE(info.take->good);
    EXPECT_EQ(info.assets.size(), 2u);
    const test::TemporaryDirectory directory;
    const Json pictures = pictures_of(take, directory / "post");
    ASSERT_EQ(pictures.size(), expected.at("pictures").size());
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      SCOPED_TRACE("frame " + std::to_string(i));
      const Json& then = expected["pictures"][i];
      EXPECT_EQ(pictures[i]["untouched"], then.at("untouched"));
      expect_alike(pictures[i]["blocks"], then.at("blocks"));
    }
  }
  EXPECT_GE(takes, 1);
}

// Records the next take to keep, with everything that this version records.
class KeptTakeRecording : public test::RigLive {};
TEST_F(KeptTakeRecording, DISABLED_IsDoneOnceAVersion) {
  write_set("preroll_s = 0\ncomposite = true\n", 400'000'000);
  test::write_card_with_variants(directory_ / "card.gltf");
  run_rendering([&] {
    for (const char* button :
         {"move_right", "next_variant", "next_variant", "light_down", "light_warmer"})
      press(button);
    until([](const Shown& s) { return s.shot.scene.variants.contains("card"); });
    const Shown first = begin_take();
    // A whole lap of the small take, in which the light camera's frames come once.
    until([&](const Shown& s) {
      return s.shot.frame->timestamp_ns >= first.shot.frame->timestamp_ns + 8 * 400'000'000ll;
    });
    press("mark_good");
    end_take();
  });
  int number = 1;
  while (fs::exists(kept / std::to_string(number))) ++number;
  const fs::path folder = kept / std::to_string(number), take = folder / "take";
  fs::create_directories(folder);
  fs::copy(take_folder(), take, fs::copy_options::recursive);
  const Json expected = {{"streams", streams_of(take)},
                         {"pictures", pictures_of(take, directory_ / "post")}};
  std::ofstream(folder / "expected.json") << expected.dump() << "\n";
}

}  // namespace previz::rig::kept_take_test
