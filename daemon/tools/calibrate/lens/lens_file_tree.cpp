#include "daemon/tools/calibrate/lens/lens_file_tree.hpp"

#include <fmt/format.h>
#include <tinyxml2.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <utility>

#include "drivers/box/reading.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"

namespace previz::calibrate {
namespace {

constexpr std::size_t most_levels = 32, most_keys = 1000;
constexpr int most_values = 200'000;

// Builds a tree from what a parser reports in the order of the file.
class TreeBuilder {
 public:
  explicit TreeBuilder(std::string file, bool may_repeat = false)
      : file_(std::move(file)), may_repeat_(may_repeat) {}

  // A word, which in a map that waits for a key is the key.
  void word(int line, std::string text) {
    if (!open_.empty() && open_.back().tree.kind == Tree::Kind::map && !open_.back().key)
      return key(line, std::move(text));
    Tree tree;
    tree.kind = Tree::Kind::word;
    tree.line = line;
    tree.word = std::move(text);
    add(std::move(tree));
  }

  void nothing(int line) {
    Tree tree;
    tree.line = line;
    add(std::move(tree));
  }

  void key(int line, std::string text) {
    Open& map = open_.back();
    if (may_repeat_) {
      map.key = std::move(text);
      return;
    }
    if (std::ranges::find(map.tree.keys, text) != map.tree.keys.end())
      fail_at({file_, line, printable(text)}, "is given twice; remove one of the two");
    if (map.tree.keys.size() >= most_keys)
      fail_at({file_, line, ""}, "one map has more than 1000 keys; it is not a calibration");
    map.key = std::move(text);
  }

  void begin(Tree::Kind kind, int line) {
    if (open_.size() >= most_levels)
      fail_at({file_, line, ""}, "is nested in more than 32 levels; it is not a calibration");
    if (!open_.empty() && open_.back().tree.kind == Tree::Kind::map && !open_.back().key)
      fail_at({file_, line, ""}, "a list or a map is used as a key; allowed: words");
    Open open;
    open.tree.kind = kind;
    open.tree.line = line;
    open_.push_back(std::move(open));
  }

  void end() {
    Tree tree = std::move(open_.back().tree);
    open_.pop_back();
    add(std::move(tree));
  }

  Tree take() { return std::move(root_); }

 private:
  struct Open {
    Tree tree;
    std::optional<std::string> key;
  };

  void add(Tree tree) {
    if (++values_ > most_values)
      fail_at({file_, tree.line, ""}, "has more than 200 000 values; it is not a calibration");
    if (open_.empty()) {
      root_ = std::move(tree);
      return;
    }
    Open& parent = open_.back();
    if (parent.tree.kind == Tree::Kind::map) {
      if (!parent.key) return key(tree.line, "");  // nothing, as the key
      parent.tree.keys.push_back(*std::exchange(parent.key, std::nullopt));
    }
    parent.tree.children.push_back(std::move(tree));
  }

  std::string file_;
  bool may_repeat_ = false;  // keys, any number of them
  std::vector<Open> open_;
  Tree root_;
  int values_ = 0;
};

class YamlEvents : public YAML::EventHandler {
 public:
  explicit YamlEvents(const std::string& file) : file_(file), builder_(file) {}

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    refuse(mark, anchor);
    builder_.nothing(line(mark));
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { refuse(mark, 1); }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                const std::string& value) override {
    refuse(mark, anchor);
    builder_.word(line(mark), value);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    refuse(mark, anchor);
    builder_.begin(Tree::Kind::list, line(mark));
  }
  void OnSequenceEnd() override { builder_.end(); }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    refuse(mark, anchor);
    builder_.begin(Tree::Kind::map, line(mark));
  }
  void OnMapEnd() override { builder_.end(); }

  Tree take() { return builder_.take(); }

 private:
  static int line(const YAML::Mark& mark) { return mark.line + 1; }
  void refuse(const YAML::Mark& mark, YAML::anchor_t anchor) const {
    if (anchor != YAML::NullAnchor)
      fail_at({file_, line(mark), ""},
              "anchors (&) and aliases (*) are not supported; write the value itself");
  }

  std::string file_;
  TreeBuilder builder_;
};

class JsonEvents : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit JsonEvents(const std::string& file) : file_(file), builder_(file) {}

  bool null() override { return builder_.nothing(0), true; }
  bool boolean(bool value) override { return word(value ? "true" : "false"); }
  bool number_integer(number_integer_t value) override { return word(std::to_string(value)); }
  bool number_unsigned(number_unsigned_t value) override { return word(std::to_string(value)); }
  bool number_float(number_float_t, const string_t& text) override { return word(text); }
  bool string(string_t& value) override { return word(value); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return builder_.begin(Tree::Kind::map, 0), true; }
  bool key(string_t& value) override { return builder_.key(0, value), true; }
  bool end_object() override { return builder_.end(), true; }
  bool start_array(std::size_t) override { return builder_.begin(Tree::Kind::list, 0), true; }
  bool end_array() override { return builder_.end(), true; }
  bool parse_error(std::size_t, const std::string&,
                   const nlohmann::json::exception& error) override {
    fail_at({file_, 0, ""}, "is not valid JSON: " + printable(error.what()));
  }

  Tree take() { return builder_.take(); }

 private:
  bool word(const std::string& text) { return builder_.word(0, text), true; }

  std::string file_;
  TreeBuilder builder_;
};

void add_words(const char* text, int line, TreeBuilder& builder) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  if (words.size() == 1) return builder.word(line, words.front());
  if (words.empty()) return builder.nothing(line);
  builder.begin(Tree::Kind::list, line);
  for (const std::string& word : words) builder.word(line, word);
  builder.end();
}

// tinyxml2 itself refuses elements that are nested deeper than it can follow.
void add_element(const tinyxml2::XMLElement& element, TreeBuilder& builder) {
  const int line = element.GetLineNum();
  const tinyxml2::XMLElement* child = element.FirstChildElement();
  if (!child) return add_words(element.GetText() ? element.GetText() : "", line, builder);
  const bool is_list = std::string_view(child->Name()) == "_";
  builder.begin(is_list ? Tree::Kind::list : Tree::Kind::map, line);
  for (; child; child = child->NextSiblingElement()) {
    if (!is_list) builder.key(child->GetLineNum(), child->Name());
    add_element(*child, builder);
  }
  builder.end();
}

// Adds an element under its name, with its attributes.
void add_whole_element(const tinyxml2::XMLElement& element, TreeBuilder& builder) {
  const int line = element.GetLineNum();
  builder.key(line, element.Name());
  if (element.GetText() && !element.FirstChildElement())
    return add_words(element.GetText(), line, builder);
  builder.begin(Tree::Kind::map, line);
  for (const auto* attribute = element.FirstAttribute(); attribute; attribute = attribute->Next()) {
    builder.key(line, attribute->Name());
    builder.word(line, attribute->Value());
  }
  for (const auto* child = element.FirstChildElement(); child; child = child->NextSiblingElement())
    add_whole_element(*child, builder);
  builder.end();
}

void parse(std::string_view text, const std::string& file, tinyxml2::XMLDocument& document) {
  const box::Reading reading(file);
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS)
    fail_at({file, document.ErrorLineNum(), ""},
            fmt::format("is not valid XML: {}", printable(document.ErrorName())));
}

}  // namespace

const Tree* Tree::find(std::string_view key) const {
  const auto found = std::ranges::find(keys, key);
  return found == keys.end() ? nullptr : &children[std::size_t(found - keys.begin())];
}

void fail_at(const FilePlace& place, const std::string& what) {
  std::string text = place.file;
  if (place.line > 0) text += ":" + std::to_string(place.line);
  if (!place.key.empty()) text += ": " + place.key;
  throw Error(text + ": " + what);
}

YamlTree parse_yaml(std::string_view text, const std::string& file) {
  const box::Reading reading(file);
  std::string lines(text);
  // OpenCV's own first line, "%YAML:1.0", is not a directive of YAML.
  if (lines.starts_with("%YAML")) lines.replace(0, std::min(lines.find('\n'), lines.size()), "");
  YamlEvents events(file);
  bool has_more = false;
  try {
    std::istringstream stream(lines);
    YAML::Parser parser(stream);
    // One document: a library may find any number of them in a damaged text.
    parser.HandleNextDocument(events);
    has_more = bool(parser);
  } catch (const YAML::Exception& error) {
    fail_at({file, error.mark.is_null() ? 0 : error.mark.line + 1, ""},
            "is not valid YAML: " + printable(error.msg));
  }
  return {events.take(), has_more};
}

Tree parse_json(std::string_view text, const std::string& file) {
  JsonEvents events(file);
  nlohmann::json::sax_parse(text.begin(), text.end(), &events);
  return events.take();
}

Tree parse_xml(std::string_view text, const std::string& file) {
  tinyxml2::XMLDocument document;
  parse(text, file, document);
  TreeBuilder builder(file);
  if (const tinyxml2::XMLElement* root = document.RootElement()) add_element(*root, builder);
  return builder.take();
}

Tree parse_whole_xml(std::string_view text, const std::string& file) {
  tinyxml2::XMLDocument document;
  parse(text, file, document);
  TreeBuilder builder(file, true);
  builder.begin(Tree::Kind::map, 1);
  if (const tinyxml2::XMLElement* root = document.RootElement()) add_whole_element(*root, builder);
  builder.end();
  return builder.take();
}

}  // namespace previz::calibrate
