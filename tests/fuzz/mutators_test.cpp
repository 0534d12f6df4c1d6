// Thousands of changes of structure, the same ones on every run: what comes out is still of its
// format and other than what went in.
#include <toml++/toml.h>

#include <nlohmann/json.hpp>

#include "tests/fuzz/mutators.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::fuzz::mutators_test {

using Json = nlohmann::json;

constexpr std::uint32_t many = 2000;

std::string kept(const char* target, const char* file) {
  return session::content_of(std::filesystem::path(PREVIZ_SOURCE_DIR) / "tests/fuzz/corpus" /
                             target / file);
}

// As libFuzzer's entry asks: by the target, and with one seed for each change.
std::optional<std::string> mutated(const char* target, const std::string& input,
                                   std::uint32_t seed) {
  std::mt19937 random(seed);
  return find_target(target)->mutate(bytes_of(input), random);
}

// Those of the seeds from 0 on. All must be there, be the same once more, and of 100 at most one
// may be equal to the input: changes that change nothing are tried up to five times, each with a
// chance below one in three.
std::vector<std::string> mutations(const char* target, const std::string& input) {
  std::vector<std::string> all;
  std::size_t equal = 0;
  for (std::uint32_t seed = 0; seed < many; ++seed) {
    const std::optional<std::string> output = mutated(target, input, seed);
    if (!output) {
      ADD_FAILURE() << "refused by seed " << seed;
      continue;
    }
    if (seed % 16 == 0) {
      EXPECT_EQ(output, mutated(target, input, seed));
    }
    equal += *output == input ? 1 : 0;
    all.push_back(*output);
  }
  EXPECT_LT(equal, many / 100);
  const std::set<std::string> different(all.begin(), all.end());
  EXPECT_GT(different.size(), many / 2);
  return all;
}

// ---- trees

// Returns the tree of a TOML document, or a discarded one if it is none. Infinite numbers and NaN
// are texts.
Json tree_of_toml(const std::string& text) {
  try {
    const toml::table table = toml::parse(text);
    std::ostringstream json;
    json << toml::json_formatter(table);
    return Json::parse(json.str(), nullptr, false);
  } catch (const toml::parse_error&) {
    return Json(Json::value_t::discarded);
  }
}

Json tree_of_json(const std::string& text) {
  return Json::parse(text, nullptr, false);
}

// The writers write what their parsers take, whatever the tree is, so all are of the format.
void expect_trees(const char* target, const char* file, Json (*tree_of)(const std::string&)) {
  const std::vector<std::string> all = mutations(target, kept(target, file));
  for (const std::string& output : all) ASSERT_FALSE(tree_of(output).is_discarded()) << output;
  const std::size_t leaves = tree_of(kept(target, file)).flatten().size();
  const auto has = [&](const std::function<bool(const std::string&)>& is) {
    return std::ranges::any_of(all, is);
  };
  const auto leaves_of = [&](const std::string& output) {
    return tree_of(output).flatten().size();
  };
  EXPECT_TRUE(has([&](const std::string& output) { return leaves_of(output) < leaves; })) << "drop";
  EXPECT_TRUE(has([&](const std::string& output) { return leaves_of(output) > leaves; })) << "add";
  for (const char* extreme : {"9223372036854775807", "9007199254740993", "-1", "../.."})
    EXPECT_THAT(all, Contains(HasSubstr(extreme)));
}

TEST(Mutators, ChangeToml) {
  expect_trees("session_toml", "take.toml", tree_of_toml);
  expect_trees("set", "demo.toml", tree_of_toml);
}

TEST(Mutators, ChangeJson) {
  expect_trees("frames_json", "list", tree_of_json);
  expect_trees("import_video", "both", tree_of_json);
  expect_trees("gltf", "pane.gltf", tree_of_json);
}

TEST(Mutators, ChangeLinesOfJson) {
  for (const auto& [target, file] :
       {std::pair{"frame_lines", "observer.jsonl"}, std::pair{"track_lines", "track.jsonl"},
        std::pair{"button_lines", "events.jsonl"}}) {
    SCOPED_TRACE(target);
    const std::string input = kept(target, file);
    std::set<std::ptrdiff_t> counts;
    for (const std::string& output : mutations(target, input)) {
      std::istringstream lines(output);
      for (std::string line; std::getline(lines, line);) ASSERT_TRUE(Json::accept(line)) << line;
      counts.insert(std::ranges::count(output, '\n'));
    }
    const std::ptrdiff_t before = std::ranges::count(input, '\n');
    EXPECT_LT(*counts.begin(), before) << "no line is dropped";
    EXPECT_GT(*counts.rbegin(), before) << "no line is repeated";
  }
}

// ---- binary glTF

std::uint32_t number_at(const std::string& file, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < 4; ++i)
    number |= static_cast<std::uint32_t>(static_cast<unsigned char>(file.at(at + i))) << 8 * i;
  return number;
}

// Returns the chunks, each with its type of four letters; fails where a length is wrong.
std::vector<std::string> chunks_of(const std::string& file) {
  std::vector<std::string> chunks;
  EXPECT_EQ(file.substr(0, 4), "glTF");
  EXPECT_EQ(number_at(file, 8), file.size());
  std::size_t at = 12;
  while (at + 8 <= file.size()) {
    const std::uint32_t length = number_at(file, at);
    EXPECT_EQ(length % 4, 0u);
    chunks.push_back(file.substr(at + 4, 4 + std::size_t{length}));
    at += 8 + std::size_t{length};
  }
  EXPECT_EQ(at, file.size());
  return chunks;
}

TEST(Mutators, ChangeBinaryGltfWithTheRightLengths) {
  const std::string input = kept("gltf", "draco.glb");
  ASSERT_EQ(chunks_of(input).size(), 2u);
  std::set<std::size_t> counts;
  for (const std::string& output : mutations("gltf", input)) {
    const std::vector<std::string> after = chunks_of(output);
    ASSERT_FALSE(after.empty());
    ASSERT_EQ(after[0].substr(0, 4), "JSON");
    ASSERT_TRUE(Json::accept(after[0].substr(4)));
    counts.insert(after.size());
  }
  EXPECT_THAT(counts, ElementsAre(1, 2, 3));  // the buffer is dropped and repeated
}

// ---- Matroska

// Those of the kept file that hold others.
constexpr std::array<std::uint64_t, 12> holding = {0x1a45dfa3, 0x18538067, 0x114d9b74, 0x4dbb,
                                                   0x1549a966, 0x1654ae6b, 0xae,       0xe0,
                                                   0x1f43b675, 0x7373,     0x1254c367, 0x1c53bb6b};

// Takes a number of `width` bytes, or what is there.
std::uint64_t take(std::string_view& bytes, std::size_t width) {
  std::uint64_t number = 0;
  for (const char byte : bytes.substr(0, width))
    number = number << 8 | static_cast<unsigned char>(byte);
  bytes.remove_prefix(std::min(width, bytes.size()));
  return number;
}

std::size_t width_of(std::string_view bytes) {
  if (bytes.empty()) return 9;
  return static_cast<std::size_t>(std::countl_zero(static_cast<unsigned char>(bytes[0]))) + 1;
}

// Returns whether all the bytes are elements, each of which ends within what holds it.
bool is_matroska(std::string_view bytes) {
  while (!bytes.empty()) {
    const std::size_t id_width = width_of(bytes);
    const std::uint64_t id = take(bytes, id_width);
    const std::size_t size_width = width_of(bytes);
    if (id_width > 4 || size_width > 8 || size_width > bytes.size()) return false;
    const std::uint64_t size = take(bytes, size_width) ^ std::uint64_t{1} << 7 * size_width;
    if (size > bytes.size()) return false;
    if (std::ranges::find(holding, id) != holding.end() && !is_matroska(bytes.substr(0, size)))
      return false;
    bytes.remove_prefix(size);
  }
  return true;
}

// A change makes a size wrong in 1/16 * 5/8 of cases, and those of all that hold what is changed in
// 1/32: below 0.071, and below 0.2 for three changes.
TEST(Mutators, ChangeMatroska) {
  for (const auto& [target, file, mark] :
       {std::tuple{"matroska", "observer.mkv", ""}, std::tuple{"import_video", "vp9", "v0"}}) {
    SCOPED_TRACE(target);
    const std::size_t first = std::string(mark).size();
    const std::string input = kept(target, file);
    ASSERT_TRUE(is_matroska(std::string_view(input).substr(first)));
    std::uint32_t right = 0;
    for (const std::string& output : mutations(target, input)) {
      ASSERT_THAT(output, StartsWith(mark));
      right += is_matroska(std::string_view(output).substr(first)) ? 1 : 0;
    }
    EXPECT_GT(right, many * 80 / 100);
    EXPECT_LT(right, many) << "no size is wrong";
  }
}

// ---- what is not of the format

TEST(Mutators, RefuseWhatIsNotOfTheFormat) {
  const std::string deep = std::string(100, '[') + std::string(100, ']');
  const std::string binary = std::string("glTF\2\0\0\0\x1a\0\0\0\6\0\0\0", 16);
  const std::pair<const char*, std::string> refused[] = {
      {"set", "a = "},
      {"session_toml", std::string("\xff\0", 2)},
      {"frames_json", "{}"},
      {"frames_json", deep},
      {"gltf", binary + "BIN [1, 2]"},
      {"button_lines", "{\"a\": 1\n{\"b\": 1"},
      {"matroska", "RIFF, and so on"},
      {"import_video", "v0RIFF, and so on"},
  };
  for (const auto& [target, input] : refused)
    for (std::uint32_t seed = 0; seed < 16; ++seed)
      EXPECT_FALSE(mutated(target, input, seed)) << target << ": " << input;
  EXPECT_TRUE(mutated("gltf", binary + "JSON[1, 2]", 0));
}

}  // namespace previz::fuzz::mutators_test
