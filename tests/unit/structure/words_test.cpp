// What a person reads keeps to one list of words: messages, the comments of configuration,
// README.md.
#include <cctype>

#include "tests/support/test.hpp"

namespace previz::words_test {

namespace fs = std::filesystem;

struct Word {
  const char* never;  // a regular expression
  const char* use;
};

const Word words[] = {
    {"cannot be had", "is not available, is busy"},
    {" anew", "is restarting, rebuilt, again"},
    {"is not understood", "is not valid; allowed: ..."},
    {"(is|are) no such", "not found, unknown"},
    {"(^|[^e] )is no (?!longer|more)", "is not a"},
    {"it is to end", "interrupted"},
    {"certain to ", "accurate to"},
    {"not answer|disk answers", "does not respond, responds again"},
    {"(is|are) left out", "is skipped, dropped, ignored or rejected"},
    {"leave (it|one|this) out", "remove it"},
    {"go(es)? with ", "conflicts with, needs"},
    {"none such", "which it does not have, not in this set"},
    {"go(es)? on in ", "continues in"},
    {"(is|are) waited for", "waiting for it"},
    {"which cannot be", "which is impossible"},
    {"graphics device", "graphics card"},
    {"light sensor", "light camera"},
    {"(frames|pictures|MB|GB|bytes|images) a second", "per second"},
    {"(line|folder) a (frame|take)", "one line per frame, one folder per take"},
    {"(samples|floats|bytes) a pixel", "per pixel"},
    {"(texels|pixels) a side", "per side"},
    {"bits a (colour|sample)", "bits per colour"},
    {"(known|seen|possible|connected) are", "known: A, B"},
    {"as it was:", "previous version:"},
    {"stays as it was", "stays in use"},
    {"tried again until", "retrying until it is available"},
    {"looked for until", "waiting for it"},
    {"(is|are) opened again", "is reopened, reopening it"},
    {"light around the set", "environment light"},
    {"taken out of", "removed from, subtracted from"},
    {"contradicts? ", "conflicts with, disagree"},
    {"no \\w+ explains", "no pose fits"},
    {"(is|are) not there\\b", "not found"},
    {"cannot be made\\b", "cannot be created"},
    {"picture's middle", "the picture's centre"},
    {"is taken (for|as) ", "is used, is treated as"},
    {"trusted to ", "valid to"},
};

struct Text {
  int line;
  std::string text;
};

// The string literals of a C++ file, adjacent ones as one text. #include lines have none.
std::vector<Text> literals(const std::string& source) {
  std::vector<Text> texts;
  int line = 1;
  bool joins = false;  // nothing but space and comments since the last literal
  for (std::size_t i = 0; i < source.size(); ++i) {
    const std::string_view rest = std::string_view(source).substr(i);
    std::size_t end = i;  // the last character of what begins here
    if (rest.starts_with("//") || rest.starts_with("#include")) {
      end = std::min(source.find('\n', i), source.size()) - 1;
    } else if (rest.starts_with("R\"")) {
      const std::size_t open = source.find('(', i);
      const std::string close = ")" + source.substr(i + 2, open - i - 2) + "\"";
      end = source.find(close, open) + close.size() - 1;
      texts.push_back({line, source.substr(open + 1, end - open - close.size())});
      joins = false;
    } else if (rest[0] == '"') {
      while (++end < source.size() && source[end] != '"') end += source[end] == '\\';
      if (!joins) texts.push_back({line, {}});
      texts.back().text += source.substr(i + 1, end - i - 1);
      joins = true;
    } else if (rest[0] == '\'' && (i == 0 || std::isalnum(source[i - 1]) == 0)) {
      while (++end < source.size() && source[end] != '\'') end += source[end] == '\\';
      joins = false;
    } else if (std::isspace(static_cast<unsigned char>(rest[0])) == 0) {
      joins = false;
    }
    line += static_cast<int>(std::count(source.begin() + i, source.begin() + end + 1, '\n'));
    i = end;
  }
  return texts;
}

std::vector<Text> lines_of(const std::string& text) {
  std::vector<Text> lines;
  for (std::size_t begin = 0, number = 1; begin < text.size(); ++number) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back({static_cast<int>(number), text.substr(begin, end - begin)});
    begin = end + 1;
  }
  return lines;
}

std::string wrong_words_in(const std::string& file, const std::vector<Text>& texts) {
  std::string wrong;
  for (const Word& word : words) {
    const std::regex never(word.never);
    for (const Text& text : texts)
      if (std::smatch found; std::regex_search(text.text, found, never))
        wrong += file + ":" + std::to_string(text.line) + ": \"" + found.str() +
                 "\"; better: " + word.use + "\n";
  }
  return wrong;
}

TEST(Words, AreThoseOfTheList) {
  const fs::path root = PREVIZ_SOURCE_DIR;
  std::string wrong;
  int files = 0;
  for (const char* folder : {"daemon", "drivers", "config", "README.md"}) {
    std::vector<fs::path> paths{root / folder};
    if (fs::is_directory(paths[0]))
      paths.assign(fs::recursive_directory_iterator(root / folder), {});
    for (const fs::path& path : paths) {
      const std::string kind = path.extension();
      const bool is_code = kind == ".cpp" || kind == ".hpp";
      if (!is_code && kind != ".toml" && kind != ".conf" && kind != ".md") continue;
      if (path.filename() == "session.toml") continue;  // recorded
      std::ifstream stream(path);
      const std::string text{std::istreambuf_iterator<char>(stream), {}};
      wrong +=
          wrong_words_in(path.lexically_relative(root), is_code ? literals(text) : lines_of(text));
      ++files;
    }
  }
  EXPECT_GT(files, 500);
  EXPECT_EQ(wrong, "");
}

}  // namespace previz::words_test
