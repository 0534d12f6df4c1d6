#include "drivers/keys/value.hpp"

#include <charconv>
#include <cmath>
#include <glm/matrix.hpp>

namespace previz {

std::string printable(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '\n')
      out += "\\n";
    else if (c == '\t')
      out += "\\t";
    else if (byte < 0x20 || byte == 0x7f) {
      constexpr const char* hex = "0123456789abcdef";
      out += std::string("\\u00") + hex[byte >> 4] + hex[byte & 15];
    } else
      out += c;
  }
  return out;
}

std::string one_line(const std::string& text) {
  constexpr std::size_t longest = 100, at_end = 30;
  std::string line = printable(text);
  if (line.size() <= longest) return line;
  const auto is_within_letter = [&](std::size_t at) {
    return (static_cast<unsigned char>(line[at]) & 0xc0) == 0x80;
  };
  std::size_t cut = longest - at_end - 3, rest = line.size() - at_end;
  while (cut > 0 && is_within_letter(cut)) --cut;
  while (rest < line.size() && is_within_letter(rest)) ++rest;
  return line.substr(0, cut) + "..." + line.substr(rest);
}

namespace codec {
namespace {

std::string plain(double number) {
  std::array<char, 32> digits;
  const auto end =
      std::to_chars(digits.begin(), digits.end(), number, std::chars_format::general, 12).ptr;
  return {digits.begin(), end};
}

// Returns what the file says there, short enough for a message.
std::string seen(const Value& value) {
  constexpr std::size_t longest = 40;
  struct {
    std::string operator()(std::monostate) const { return "a table, date or time"; }
    std::string operator()(bool flag) const { return flag ? "true" : "false"; }
    std::string operator()(std::int64_t number) const { return std::to_string(number); }
    std::string operator()(double number) const { return plain(number); }
    std::string operator()(const std::string& text) const {
      if (text.size() <= longest) return quote(text);
      auto cut = longest;
      while (cut > 0 && (static_cast<unsigned char>(text[cut]) & 0xc0) == 0x80) --cut;
      return quote(text.substr(0, cut)) + "...";
    }
    std::string operator()(const std::vector<Value>& list) const {
      return list.size() == 1 ? "a list of 1 entry"
                              : "a list of " + std::to_string(list.size()) + " entries";
    }
  } in_words;
  return std::visit(in_words, value.data);
}

}  // namespace

void misread(const Value& value, const std::string& wanted) {
  throw Misread{value.at, seen(value) + " is not allowed; allowed: " + wanted};
}

double number(const Value& value, const Rule& rule) {
  double number = 0;
  if (const auto* real = std::get_if<double>(&value.data))
    number = *real;
  else if (const auto* whole = std::get_if<std::int64_t>(&value.data))
    number = static_cast<double>(*whole);
  else
    misread(value, Codec<double>::describe(rule));
  const bool low_enough = number <= rule.high;
  const bool high_enough = rule.low_excluded ? number > rule.low : number >= rule.low;
  if (!std::isfinite(number) || !low_enough || !high_enough)
    misread(value, "finite " + Codec<double>::describe(rule));
  return number * rule.si;
}

std::int64_t whole_number(const Value& value, const Rule& rule) {
  const auto* whole = std::get_if<std::int64_t>(&value.data);
  const std::string wanted = "whole number" + range(rule);
  if (!whole) misread(value, wanted);
  const auto number = static_cast<double>(*whole);
  if (number < rule.low || number > rule.high) misread(value, wanted);
  return *whole;
}

const std::string& text(const Value& value) {
  if (const auto* text = std::get_if<std::string>(&value.data)) return *text;
  misread(value, "text in quotes");
}

const std::vector<Value>& list(const Value& value, const std::string& wanted) {
  if (const auto* list = std::get_if<std::vector<Value>>(&value.data)) return *list;
  misread(value, wanted);
}

std::vector<double> numbers(const Value& value, std::size_t count, const Rule& rule) {
  const auto wanted = std::to_string(count) + " numbers in brackets" + range(rule);
  const auto& entries = list(value, wanted);
  if (entries.size() != count) misread(value, wanted);
  std::vector<double> out;
  for (const auto& entry : entries) out.push_back(number(entry, rule));
  return out;
}

std::string print_number(double file_value) {
  auto text = plain(file_value == 0 ? 0.0 : file_value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string print_numbers(const double* values, std::size_t count, const Rule& rule) {
  std::string text = "[";
  for (std::size_t i = 0; i < count; ++i)
    text += (i ? ", " : "") + print_number(values[i] / rule.si);
  return text + "]";
}

std::string quote(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '"' || c == '\\') escaped += '\\';
    escaped += c;
  }
  return '"' + printable(escaped) + '"';
}

std::string range(const Rule& rule) {
  const bool low = std::isfinite(rule.low), high = std::isfinite(rule.high);
  std::string text = *rule.unit ? std::string(" in ") + rule.unit : "";
  if (low && high && !rule.low_excluded)
    return text + ", " + plain(rule.low) + " to " + plain(rule.high);
  if (low) text += (rule.low_excluded ? ", above " : ", at least ") + plain(rule.low);
  if (high) text += ", at most " + plain(rule.high);
  return text;
}

}  // namespace codec

std::string Codec<std::string>::read(const Value& value, const Rule& rule) {
  const auto* text = std::get_if<std::string>(&value.data);
  const bool allowed = text && std::ranges::find(rule.words, *text) != rule.words.end();
  if (!rule.words.empty() && !allowed) codec::misread(value, describe(rule));
  return codec::text(value);
}

std::string Codec<std::string>::describe(const Rule& rule) {
  std::string words;
  for (const auto* word : rule.words) words += (words.empty() ? "" : " | ") + codec::quote(word);
  return words.empty() ? "text" : words;
}

std::filesystem::path Codec<std::filesystem::path>::read(const Value& value, const Rule& rule) {
  const auto& text = codec::text(value);
  if (text.empty() || text.find('\0') != std::string::npos) codec::misread(value, describe(rule));
  return text;
}

std::array<glm::dvec3, 4> Codec<std::array<glm::dvec3, 4>>::read(const Value& value,
                                                                 const Rule& rule) {
  const std::string allowed = describe(rule);
  const auto& points = codec::list(value, allowed);
  if (points.size() != 4) codec::misread(value, allowed);
  std::array<glm::dvec3, 4> out;
  for (std::size_t i = 0; i < 4; ++i) out[i] = Codec<glm::dvec3>::read(points[i], rule);
  return out;
}

glm::dmat4 Codec<glm::dmat4>::read(const Value& value, const Rule& rule) {
  const std::string allowed = describe(rule);
  const auto& entries = codec::list(value, allowed);
  std::vector<double> numbers;
  if (entries.size() == 4) {
    for (const auto& row : entries)
      for (const double number : codec::numbers(row, 4, rule)) numbers.push_back(number);
  } else if (entries.size() == 16) {
    numbers = codec::numbers(value, 16, rule);
  } else {
    codec::misread(value, allowed);
  }
  if (numbers[12] != 0 || numbers[13] != 0 || numbers[14] != 0 || numbers[15] != 1)
    throw Misread{value.at, "the last row is not 0 0 0 1; allowed: " + allowed};
  glm::dmat4 out;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      out[column][row] = numbers[static_cast<std::size_t>(4 * row + column)];
  return out;
}

std::string Codec<glm::dmat4>::print(const glm::dmat4& matrix, const Rule& rule) {
  const glm::dmat4 rows = glm::transpose(matrix);
  std::string out = "[";
  for (int row = 0; row < 4; ++row)
    out += (row ? ", " : "") + codec::print_numbers(&rows[row].x, 4, rule);
  return out + "]";
}

std::vector<double> Codec<std::vector<double>>::read(const Value& value, const Rule& rule) {
  const std::string allowed = describe(rule);
  std::vector<double> out;
  for (const auto& entry : codec::list(value, allowed)) out.push_back(codec::number(entry, rule));
  return out;
}

std::vector<std::string> Codec<std::vector<std::string>>::read(const Value& value,
                                                               const Rule& rule) {
  const std::string allowed = describe(rule);
  std::vector<std::string> out;
  for (const auto& entry : codec::list(value, allowed)) out.push_back(codec::text(entry));
  return out;
}

std::string Codec<std::vector<std::string>>::print(const std::vector<std::string>& texts,
                                                   const Rule&) {
  std::string out = "[";
  for (const auto& text : texts) out += (out.size() > 1 ? ", " : "") + codec::quote(text);
  return out + "]";
}

}  // namespace previz
