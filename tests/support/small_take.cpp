#include "tests/support/small_take.hpp"

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <vector>

#include "daemon/core/session/clusters.hpp"
#include "daemon/core/session/crc32.hpp"
#include "daemon/core/session/session.hpp"
#include "tests/support/gltf_writer.hpp"

namespace previz::test {
namespace {

constexpr int width = 48, height = 36, light_size = 32;
constexpr std::int64_t start_ns = 1'000'000'000'000;

std::string set_text(bool with_card, const std::string& more) {
  std::string text =
      "[set]\nname = \"small\"\n"
      "[observer]\ndriver = \"replay\"\ndevice = \"session\"\n"
      "[light_camera]\ndriver = \"replay\"\ndevice = \"session\"\n"
      "[tracking]\nenabled = false\n"
      "[[object]]\nname = \"floor\"\nfile = \"floor.gltf\"\npresence = \"phantom\"\n";
  if (with_card)
    text += "[[object]]\nname = \"card\"\nfile = \"card.gltf\"\npresence = \"virtual\"\n";
  return text + "[quality]\nsamples = 2\n" + more;
}

session::SessionInfo session_info() {
  session::SessionInfo info;
  info.name = "small";
  info.set_name = "set.toml";
  info.observer.emplace();
  info.observer->intrinsics = {width, height, 40, 40, 23.5, 17.5, 0.05, -0.02, 0.001, 0, 0};
  info.light.emplace();
  info.light->intrinsics = {light_size, light_size, 10, 10, 15.5, 15.5, {}, 1.57};
  return info;
}

Frame light_frame(int index) {
  Frame frame;
  frame.source = "light";
  frame.sequence = static_cast<std::uint64_t>(index);
  frame.timestamp_ns = start_ns + small_take_interval_ns / 2 + index * 1'000'000;
  frame.arrival_ns = frame.timestamp_ns;
  frame.exposure = 0.25 * (1 << index);
  frame.width = frame.height = light_size;
  frame.bytes.assign(frame_bytes(frame.format, light_size, light_size), 100);
  return frame;
}

}  // namespace

void write_square(const std::filesystem::path& file, float side_m, float height_m) {
  test::GltfWriter gltf;
  const float s = side_m / 2, y = height_m;
  const int positions = gltf.positions({{-s, y, s}, {s, y, s}, {s, y, -s}, {-s, y, -s}});
  const int indices = gltf.indices({0, 1, 2, 0, 2, 3});
  const int material = gltf.add(
      "materials", {{"name", "paper"},
                    {"pbrMetallicRoughness", {{"metallicFactor", 0.0}, {"roughnessFactor", 1.0}}}});
  gltf.root("square", gltf.mesh({{"attributes", {{"POSITION", positions}}},
                                 {"indices", indices},
                                 {"material", material}}));
  gltf.save(file);
}

Frame small_take_frame(int index) {
  Frame frame;
  frame.source = "observer";
  frame.sequence = static_cast<std::uint64_t>(index);
  frame.timestamp_ns = start_ns + index * small_take_interval_ns;
  frame.arrival_ns = frame.timestamp_ns + 3'000'000;
  frame.width = width;
  frame.height = height;
  std::mt19937 random(static_cast<std::uint32_t>(index));
  frame.bytes.resize(frame_bytes(frame.format, width, height));
  for (std::uint8_t& byte : frame.bytes) byte = static_cast<std::uint8_t>(random());
  return frame;
}

void write_small_take(const std::filesystem::path& directory, bool with_card,
                      const std::string& more, const std::optional<session::CapturedLight>& light,
                      std::int64_t interval_ns) {
  write_square(directory / "floor.gltf", 2.0f, 0.0f);
  write_square(directory / "card.gltf", 0.3f, 0.1f);
  session::SessionInfo info = session_info();
  info.set_text = set_text(with_card, more);
  std::ofstream(directory / "set.toml") << info.set_text;

  session::SessionWriter writer(directory / "session", info);
  writer.add_asset("floor.gltf", directory / "floor.gltf");
  if (with_card) writer.add_asset("card.gltf", directory / "card.gltf");
  for (int i = 0; i < 3; ++i) writer.write(light_frame(i));
  for (int i = 0; i < small_take_frames; ++i) {
    Frame frame = small_take_frame(i);
    frame.timestamp_ns = start_ns + i * interval_ns;
    writer.write(frame);
    session::TrackRecord record;
    record.frame = static_cast<std::uint64_t>(i);
    record.timestamp_ns = frame.timestamp_ns;
    record.tracked = i != small_take_lost;
    record.captured_light = light;
    // A metre above the floor, looking straight down, picture up along Y.
    record.world_from_camera = {{1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}, {0, 0.01 * i, 1, 1}};
    writer.write(record);
  }
  writer.close();
}

void make_unreadable(const std::filesystem::path& session, int index) {
  const std::filesystem::path video = session / "observer.mkv", file = session / "observer.jsonl";
  std::string lines;
  std::ifstream lines_before(file);
  int number = 0;
  for (std::string line; std::getline(lines_before, line); ++number) {
    if (number == index) {
      nlohmann::ordered_json json = nlohmann::ordered_json::parse(line);
      const auto sum = std::stoul(json["crc32"].get<std::string>(), nullptr, 16);
      const session::PacketPlace place =
          session::find_packets(video, {{json["video_ms"], static_cast<std::uint32_t>(sum)}},
                                1 << 20)
              .at(0);
      const std::vector<std::uint8_t> spoiled(place.bytes, 0xff);
      std::fstream bytes(video, std::ios::in | std::ios::out | std::ios::binary);
      bytes.seekp(static_cast<std::streamoff>(place.offset));
      bytes << std::string(spoiled.begin(), spoiled.end());
      char text[9];
      std::snprintf(text, sizeof(text), "%08x", session::crc32(spoiled));
      json["crc32"] = text;
      line = json.dump();
    }
    lines += line + '\n';
  }
  std::ofstream(file) << lines;
}

void write_card_with_variants(const std::filesystem::path& file) {
  GltfWriter gltf;
  const auto paper = [&](double grey, double glow) {
    return gltf.add("materials",
                    {{"pbrMetallicRoughness",
                      {{"baseColorFactor", {grey, grey, grey, 1}},
                       {"metallicFactor", 0.0},
                       {"roughnessFactor", 1.0}}},
                     {"emissiveFactor", {glow, glow, glow}},
                     {"extensions", {{"KHR_materials_specular", {{"specularFactor", 0.0}}}}}});
  };
  const int grey = paper(0.5, 0), black = paper(0, 0), lamp = paper(0, 1);
  gltf.json["extensionsUsed"] = {"KHR_materials_specular", "KHR_materials_variants"};
  gltf.json["extensions"]["KHR_materials_variants"]["variants"] = {
      {{"name", "grey"}}, {{"name", "black"}}, {{"name", "lamp"}}};
  const int positions = gltf.positions(
      {{-0.15f, 0.1f, 0.15f}, {0.15f, 0.1f, 0.15f}, {0.15f, 0.1f, -0.15f}, {-0.15f, 0.1f, -0.15f}});
  gltf.root("card", gltf.mesh({{"attributes", {{"POSITION", positions}}},
                               {"indices", gltf.indices({0, 1, 2, 0, 2, 3})},
                               {"material", grey},
                               {"extensions",
                                {{"KHR_materials_variants",
                                  {{"mappings",
                                    {{{"material", grey}, {"variants", {0}}},
                                     {{"material", black}, {"variants", {1}}},
                                     {{"material", lamp}, {"variants", {2}}}}}}}}}}));
  gltf.save(file);
}

}  // namespace previz::test
