#include "daemon/core/scene/gltf_text.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <utility>

#include "daemon/core/scene/other_format.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"
#include "drivers/letters.hpp"

namespace previz::scene {
namespace {

using Json = nlohmann::json;

constexpr int max_json_depth = 128;
constexpr std::string_view byte_order_mark = "\xef\xbb\xbf";
constexpr std::string_view replacement = "\xef\xbf\xbd";  // U+FFFD
constexpr char mark = '\1';  // begins the strings that stand for numbers that are not finite

int nesting_depth(std::string_view json) {
  int depth = 0, deepest = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      deepest = std::max(deepest, ++depth);
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return deepest;
}

// Returns the text with U+FFFD in place of bytes that are not UTF-8.
std::string utf8_of(std::string_view text) {
  const Json string = text;
  return Json::parse(string.dump(-1, ' ', false, Json::error_handler_t::replace))
      .get<std::string>();
}

// Returns whether a word is a number that is not finite, as some program writes it: NaN, -Infinity,
// -nan(ind) and 1.#INF, or one that no double can hold.
bool is_not_finite(std::string_view written) {
  std::string word = lower_case(written);
  if (!word.empty() && (word[0] == '-' || word[0] == '+')) word.erase(0, 1);
  if (word.starts_with("nan") || word.starts_with("inf") || word.find(".#") != std::string::npos)
    return true;
  char* end = nullptr;
  const double number = std::strtod(word.c_str(), &end);
  return !word.empty() && word[0] >= '0' && word[0] <= '9' && *end == '\0' && std::isinf(number);
}

// Returns the text with U+FFFD for bytes that are not UTF-8, and with marked strings for numbers
// that are not finite.
std::string mended(std::string_view bytes) {
  constexpr std::string_view around_words = " \t\r\n{}[],:\"";
  const std::string text = utf8_of(bytes);
  std::string result;
  result.reserve(text.size() + text.size() / 8);
  bool in_string = false;
  for (std::size_t i = 0, size = 1; i < text.size(); i += size) {
    const bool ends_word = around_words.find(text[i]) != std::string_view::npos;
    size = in_string && text[i] == '\\' && i + 1 < text.size() ? 2 : 1;
    if (!in_string && !ends_word)
      size = std::min(text.find_first_of(around_words, i), text.size()) - i;
    if (text[i] == '"') in_string = !in_string;
    const std::string word = text.substr(i, size);
    if (in_string || ends_word || !is_not_finite(word)) {
      result += word;
      continue;
    }
    result += "\"\\u0001";
    for (const char c : word) result += c > ' ' && c != '\\' && c < 0x7f ? c : '?';
    result += '"';
  }
  return result;
}

bool is_marked(const Json& value) {
  if (value.is_string()) return value.get_ref<const std::string&>().starts_with(mark);
  return value.is_array() && std::ranges::any_of(value, is_marked);
}

// Finds what stands in a tree for what the text had and JSON does not have.
class Mending {
 public:
  Mending(GltfJson& json, const std::string& file) : json_(json), file_(file) {}

  void run() {
    take_out_bounds();
    walk(json_.root, nullptr, false);
    note(bounds_, "is not finite", "bounds are not needed; ignored");
    note(letters_, "has letters that are not UTF-8",
         std::string(replacement) + " stands for each; export the file again for the right ones");
  }

 private:
  struct Found {
    std::string first;
    std::size_t count = 0;
    void add(const JsonPlace* place) {
      if (count++ == 0) first = in_words(place);
    }
  };

  void note(const Found& found, const std::string& what, const std::string& then) {
    if (found.count == 0) return;
    std::string others;
    if (found.count > 1) others = ", as " + std::to_string(found.count - 1) + " more of the file";
    json_.notes.push_back(found.first + " " + what + others + ": " + then);
  }

  void take_out_bounds() {
    const auto accessors = json_.root.find("accessors");
    if (accessors == json_.root.end() || !accessors->is_array()) return;
    const JsonPlace root{nullptr, "accessors"};
    for (std::size_t i = 0; i < accessors->size(); ++i) {
      Json& accessor = (*accessors)[i];
      const JsonPlace element{&root, "", i};
      for (const char* const key : {"min", "max"}) {
        if (!accessor.is_object() || !accessor.contains(key) || !is_marked(accessor[key])) continue;
        const JsonPlace at{&element, key};
        bounds_.add(&at);
        accessor.erase(key);
      }
    }
  }

  void walk(Json& value, const JsonPlace* place, bool is_extra) {
    if (value.is_array()) {
      for (std::size_t i = 0; i < value.size(); ++i) {
        const JsonPlace at{place, "", i};
        walk(value[i], &at, is_extra);
      }
    } else if (value.is_object()) {
      for (auto member = value.begin(); member != value.end(); ++member) {
        const JsonPlace at{place, member.key()};
        if (member.key().find(replacement) != std::string::npos) letters_.add(&at);
        walk(*member, &at, is_extra || member.key() == "extras");
      }
    } else if (value.is_string()) {
      const auto& text = value.get_ref<const std::string&>();
      if (text.find(replacement) != std::string::npos) letters_.add(place);
      if (!is_marked(value)) return;
      if (!is_extra)
        throw Error(file_ + ": " + in_words(place) + " is " + set::one_line(text.substr(1)) +
                    "; it must be a finite number; export the file again, or correct it there");
      value = nullptr;
    }
  }

  GltfJson& json_;
  const std::string& file_;
  Found bounds_, letters_;
};

// Follows a parser to the place where it fails.
class Follower {
 public:
  bool operator()(Json::parse_event_t event, const Json& parsed) {
    using Event = Json::parse_event_t;
    if (event == Event::key) {
      steps_.back().place.key = parsed.get<std::string>();
    } else if (event == Event::object_start || event == Event::array_start) {
      steps_.push_back({{nullptr, "", 0}, event == Event::array_start});
    } else {
      if (event != Event::value) steps_.pop_back();
      if (!steps_.empty()) ++steps_.back().place.index;
    }
    return true;
  }
  std::string place() {
    const JsonPlace* above = nullptr;
    for (auto& [place, is_array] : steps_) {
      if (!is_array && place.key.empty()) continue;  // before its first member
      place.above = above;
      above = &place;
    }
    return in_words(above);
  }

 private:
  struct Step {
    JsonPlace place;
    bool is_array;
  };
  std::vector<Step> steps_;
};

// Throws what is wrong with a text that cannot be parsed.
[[noreturn]] void refuse_text(std::string_view text, const std::string& file) {
  Follower follower;
  std::size_t at = text.size();
  try {
    const Json ignored = Json::parse(
        text, [&](int, Json::parse_event_t event, Json& value) { return follower(event, value); });
  } catch (const Json::parse_error& error) {
    at = std::max<std::size_t>(error.byte, 1) - 1;
  } catch (const Json::exception&) {  // a number that no double can hold is mended before
  }
  const std::string near = follower.place();
  const std::string place = near.empty() ? "" : ", near " + near;
  const std::string what = file + ": is not a valid glTF file: its JSON ";
  if (at >= text.size())
    throw Error(what + "ends too early" + place +
                ": the file is cut short; copy it or export it again");
  const std::string_view before = text.substr(0, at);
  const std::size_t line_start = before.rfind('\n') + 1;  // npos + 1 is 0
  const std::string_view rest =
      text.substr(at, std::min<std::size_t>(text.find('\n', at) - at, 20));
  throw Error(what + "is damaged in line " + std::to_string(std::ranges::count(before, '\n') + 1) +
              ", column " + std::to_string(at - line_start + 1) + place + ", at \"" +
              set::one_line(mended('"' + std::string(rest)).substr(1)) +
              "\"; export the file again, or correct it there");
}

}  // namespace

std::string in_words(const JsonPlace* place) {
  if (!place) return "";
  std::string words = in_words(place->above);
  if (place->key.empty()) return words + "[" + std::to_string(place->index) + "]";
  return words + (words.empty() ? "" : ".") + set::one_line(place->key);
}

GltfJson parsed_json(std::string_view text, const std::string& file) {
  if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
  const std::size_t start = text.find_first_not_of(" \t\r\n");
  if (start == std::string_view::npos)
    throw Error(file + ": is not a valid glTF file: it is empty; export it again");
  constexpr std::string_view beginnings = "{[/";  // a comment is damage of JSON
  if (beginnings.find(text[start]) != std::string_view::npos &&
      nesting_depth(text) > max_json_depth)
    throw Error(file + ": its JSON is nested more than " + std::to_string(max_json_depth) +
                " levels deep");
  GltfJson json;
  if (text[start] == '{') json.root = Json::parse(text, nullptr, false);
  if (json.root.is_object()) return json;
  if (text[start] != '{') {
    refuse_other_format({reinterpret_cast<const unsigned char*>(text.data()), text.size()}, file);
    if (text.substr(start).starts_with("//") || text.substr(start).starts_with("/*"))
      refuse_text(text, file);
    throw Error(file +
                ": is not a valid glTF file: it is neither binary glTF nor JSON; an object is glTF "
                "2.0 (.glb or .gltf)");
  }
  const std::string repaired = mended(text);
  json.root = Json::parse(repaired, nullptr, false);
  if (!json.root.is_object()) refuse_text(repaired, file);
  json.is_changed = true;
  Mending(json, file).run();
  return json;
}

}  // namespace previz::scene
