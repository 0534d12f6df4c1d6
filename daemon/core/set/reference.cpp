#include <sstream>

#include "daemon/core/set/reference.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/core/set/table.hpp"

namespace previz::set {
namespace {

constexpr auto preamble =
    R"(# Every key of a set file. Generated from the parser's own table by `ninja reference`.
#
# A line that starts with "#" and no space is a key without a default, or an optional table:
# remove the "#" to use it. All other lines give the default. Units are at the end of
# each key's name; the world is right-handed, Z up; colours are linear Rec. 709.
)";

// Writes sentences as comment lines of at most 100 columns.
void comment(std::ostream& out, const std::string& text) {
  constexpr std::size_t columns = 100;
  std::istringstream words(text);
  std::size_t column = 1;
  out << '#';
  for (std::string word; words >> word; column += 1 + word.size()) {
    if (column + 1 + word.size() > columns) {
      out << "\n#";
      column = 1;
    }
    out << ' ' << word;
  }
  out << '\n';
}

void print(std::ostream& out, const Key& key, bool commented) {
  using enum Need::Kind;
  comment(out, key.about);
  const char* need = key.need.kind == required   ? "; required"
                     : key.need.kind == optional ? "; optional"
                                                 : "";
  comment(out, "(" + key.allowed + need + ")");
  const bool has_default = key.need.kind == defaulted;
  out << (commented || !has_default ? "#" : "") << key.name << " = "
      << (has_default ? key.initial : key.need.example) << '\n';
}

}  // namespace

std::string reference_toml() {
  std::ostringstream out;
  out << preamble;
  Draft draft;
  for (const auto& section : sections(draft)) {
    const bool commented = section.kind != Section::Kind::always;
    const bool repeated = section.kind == Section::Kind::repeated;
    out << '\n';
    comment(out, section.about);
    out << (commented ? "#" : "") << (repeated ? "[[" : "[") << section.path
        << (repeated ? "]]" : "]") << '\n';
    for (const auto& key : section.open().keys) print(out, key, commented);
  }
  return out.str();
}

}  // namespace previz::set
