#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/fuzz/mutate_tree.hpp"
#include "tests/fuzz/mutators.hpp"

namespace previz::fuzz {
namespace mutate_json_cpp {

constexpr int deepest = 64;

std::string_view view_of(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// Brackets in texts count too, which refuses a little more than it must. A tree that is nested as
// deep as it is long would end the stack where it is written.
bool is_shallow(std::string_view text) {
  int depth = 0;
  return std::ranges::all_of(text, [&](char c) {
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') --depth;
    return depth <= deepest;
  });
}

// Returns null for what has no parts, too.
std::optional<Tree> parse(std::string_view text) {
  if (!is_shallow(text)) return std::nullopt;
  Tree tree = Tree::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!tree.is_structured() || tree.empty()) return std::nullopt;
  return tree;
}

// JSON has no NaN and no infinity: both are written as null.
std::string written(const Tree& tree) {
  return tree.dump(-1, ' ', false, Tree::error_handler_t::replace);
}

using ChangeTree = void (*)(Tree& root, std::mt19937& random);

std::optional<std::string> mutate(std::string_view text, std::mt19937& random, ChangeTree change) {
  std::optional<Tree> tree = parse(text);
  if (!tree) return std::nullopt;
  change_some(*tree, random, change);
  return written(*tree);
}

void change_any(Tree& root, std::mt19937& random) {
  change_tree(root, random, {});
}

// ---- lines

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    lines.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

// Returns the position of a random line that is JSON, or null if there is none.
std::optional<std::size_t> some_document(const std::vector<std::string>& lines,
                                         std::mt19937& random) {
  if (lines.empty()) return std::nullopt;
  const std::size_t first = below(random, lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i)
    if (const std::size_t at = (first + i) % lines.size(); parse(lines[at])) return at;
  return std::nullopt;
}

// The line at `at` is JSON.
void change_lines(std::vector<std::string>& lines, std::size_t at, std::mt19937& random) {
  const auto line = lines.begin() + static_cast<std::ptrdiff_t>(at);
  switch (below(random, 8)) {
    case 0:
      line->swap(lines[below(random, lines.size())]);
      break;
    case 1: {
      const std::size_t to = below(random, lines.size() + 1);
      const std::string copy = *line;
      lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(to), copy);
      break;
    }
    case 2:
      lines.erase(line);
      break;
    default:
      if (std::optional<std::string> changed = mutate(*line, random, change_any))
        *line = std::move(*changed);
  }
}

// ---- glTF

// The list of the root whose elements a member counts.
constexpr std::array<std::pair<std::string_view, std::string_view>, 24> lists = {{
    {"scene", "scenes"},         {"node", "nodes"},
    {"nodes", "nodes"},          {"children", "nodes"},
    {"joints", "nodes"},         {"skeleton", "nodes"},
    {"mesh", "meshes"},          {"skin", "skins"},
    {"camera", "cameras"},       {"material", "materials"},
    {"index", "textures"},       {"source", "images"},
    {"sampler", "samplers"},     {"bufferView", "bufferViews"},
    {"buffer", "buffers"},       {"indices", "accessors"},
    {"input", "accessors"},      {"output", "accessors"},
    {"POSITION", "accessors"},   {"NORMAL", "accessors"},
    {"TEXCOORD_0", "accessors"}, {"JOINTS_0", "accessors"},
    {"WEIGHTS_0", "accessors"},  {"inverseBindMatrices", "accessors"},
}};

const std::vector<Tree>& gltf_words() {
  static const std::vector<Tree> words = {
      5120,   5121,   5122,   5123,     5125,   5126,    "SCALAR", "VEC2",   "VEC3",        "VEC4",
      "MAT2", "MAT3", "MAT4", "OPAQUE", "MASK", "BLEND", "STEP",   "LINEAR", "CUBICSPLINE", 34962,
      34963,  0,      1,      2,        4,      5,       6,        9728,
  };
  return words;
}

// Returns one of the numbers that count the list's elements, or one of the two after them.
std::size_t index_in(const Tree& root, std::string_view list, std::mt19937& random) {
  const auto found = root.find(std::string(list));
  const std::size_t count = found != root.end() && found->is_array() ? found->size() : 0;
  return below(random, count + 2);
}

// Makes a number that counts something count another.
void change_index(Tree& root, std::mt19937& random) {
  for (int tries = 0; tries < 32; ++tries) {
    const Place place = place_in(root, random);
    const auto* known = std::ranges::find(lists, place.key, [](const auto& l) { return l.first; });
    if (!place.value().is_number_integer() || known == lists.end()) continue;
    // Once in four times the list is another one.
    if (below(random, 4) == 0) known = &lists[below(random, lists.size())];
    place.value() = index_in(root, known->second, random);
    return;
  }
}

void change_gltf(Tree& root, std::mt19937& random) {
  if (root.is_object() && !root.empty() && below(random, 3) == 0)
    change_index(root, random);
  else
    change_tree(root, random, gltf_words());
}

// ---- binary glTF

struct Chunk {
  std::string type;  // four bytes
  std::string content;
};

constexpr std::size_t file_head = 12;  // "glTF", the version and the length
constexpr std::size_t chunk_head = 8;  // the length and the type
constexpr std::string_view json_type{"JSON"};

std::uint32_t number_at(std::string_view text, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = 4; i > 0; --i)
    number = number << 8 | static_cast<unsigned char>(text[at + i - 1]);
  return number;
}

std::string four_bytes(std::size_t number) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) text += static_cast<char>(number >> shift & 0xff);
  return text;
}

// A chunk that is longer than the file ends with it.
std::vector<Chunk> chunks_of(std::string_view file) {
  std::vector<Chunk> chunks;
  std::size_t at = file_head;
  while (at + chunk_head <= file.size()) {
    const std::size_t length =
        std::min<std::size_t>(number_at(file, at), file.size() - at - chunk_head);
    chunks.push_back(
        {std::string(file.substr(at + 4, 4)), std::string(file.substr(at + chunk_head, length))});
    at += chunk_head + length;
  }
  return chunks;
}

std::string written(const std::vector<Chunk>& chunks, std::string_view version) {
  std::string body;
  for (Chunk chunk : chunks) {
    const char padding = chunk.type == json_type ? ' ' : '\0';
    chunk.content.resize((chunk.content.size() + 3) / 4 * 4, padding);
    body += four_bytes(chunk.content.size()) + chunk.type + chunk.content;
  }
  return "glTF" + std::string(version) + four_bytes(file_head + body.size()) + body;
}

// Changes what lies behind the JSON. There must be such a chunk.
void change_chunks(std::vector<Chunk>& chunks, std::mt19937& random) {
  const std::size_t at = 1 + below(random, chunks.size() - 1);
  std::string& content = chunks[at].content;
  const std::size_t cut = below(random, content.size() + 1);
  switch (below(random, 8)) {
    case 0:
      chunks.erase(chunks.begin() + static_cast<std::ptrdiff_t>(at));
      break;
    case 1:
      chunks.push_back(Chunk(chunks[at]));
      break;
    case 2:
      content.resize(cut);
      break;
    case 3:
      content.append(content, cut);
      break;
    default:  // a number somewhere: 0, or the largest of its four bytes, or a float that is none
      static constexpr std::array<std::uint32_t, 5> words = {0, 0xffffffff, 0x7fffffff, 0x7f800000,
                                                             0x7fc00000};
      if (cut / 4 * 4 + 4 <= content.size())
        content.replace(cut / 4 * 4, 4, four_bytes(words[below(random, words.size())]));
  }
}

std::optional<std::string> mutate_binary(std::string_view file, std::mt19937& random) {
  std::vector<Chunk> chunks = chunks_of(file);
  if (chunks.empty() || chunks[0].type != json_type) return std::nullopt;
  std::optional<std::string> json = mutate(chunks[0].content, random, change_gltf);
  if (!json) return std::nullopt;
  if (chunks.size() > 1 && below(random, 4) == 0)
    change_chunks(chunks, random);
  else
    chunks[0].content = std::move(*json);
  return written(chunks, file.substr(4, 4));
}

}  // namespace mutate_json_cpp

std::optional<std::string> mutate_json(Bytes bytes, std::mt19937& random) {
  return mutate_json_cpp::mutate(mutate_json_cpp::view_of(bytes), random,
                                 mutate_json_cpp::change_any);
}

std::optional<std::string> mutate_json_lines(Bytes bytes, std::mt19937& random) {
  using namespace mutate_json_cpp;
  std::vector<std::string> lines = lines_of(view_of(bytes));
  const std::vector<std::string> before = lines;
  std::optional<std::size_t> at = some_document(lines, random);
  if (!at) return std::nullopt;
  const std::size_t wanted = 1 + below(random, 2);
  for (std::size_t i = 0; at && (i < wanted || (i < wanted + 4 && lines == before)); ++i) {
    change_lines(lines, *at, random);
    at = some_document(lines, random);
  }
  std::string text;
  for (const std::string& line : lines) text += line + '\n';
  return text;
}

std::optional<std::string> mutate_gltf(Bytes bytes, std::mt19937& random) {
  using namespace mutate_json_cpp;
  const std::string_view text = view_of(bytes);
  if (text.size() >= file_head && text.starts_with("glTF")) return mutate_binary(text, random);
  return mutate(text, random, change_gltf);
}

std::optional<std::string> mutate_import_video(Bytes bytes, std::mt19937& random) {
  constexpr std::size_t head = 2;
  if (bytes.size() < head || bytes[0] != 'v') return mutate_json(bytes, random);
  std::optional<std::string> video = mutate_matroska(bytes.subspan(head), random);
  if (video) video->insert(0, text_of(bytes.first(head)));
  return video;
}

}  // namespace previz::fuzz
