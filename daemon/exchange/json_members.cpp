#include "daemon/exchange/json_members.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>

#include "daemon/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

std::string text_of(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.12g", value);
  return text;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

bool within(double value, const Bounds& bounds) {
  return std::isfinite(value) && value <= bounds.high &&
         (bounds.above ? value > bounds.low : value >= bounds.low);
}

bool is_integer(const Json& json, std::int64_t low, std::int64_t high) {
  if (json.is_number_unsigned() &&
      json.get<std::uint64_t>() > std::uint64_t{std::numeric_limits<std::int64_t>::max()})
    return false;
  return json.is_number_integer() && json.get<std::int64_t>() >= low &&
         json.get<std::int64_t>() <= high;
}

std::string whole_number(std::int64_t low, std::int64_t high) {
  return "a whole number from " + std::to_string(low) + " to " + std::to_string(high);
}

}  // namespace

std::string Bounds::text() const {
  if (std::isinf(low) && std::isinf(high)) return "a number";
  std::string text =
      above ? "a number above " + text_of(low) : "a number, at least " + text_of(low);
  return std::isinf(high) ? text : text + " and at most " + text_of(high);
}

Members::Members(const std::filesystem::path& file, const Json& object, std::string path,
                 std::vector<std::string> allowed)
    : file_(file), object_(object), path_(std::move(path)) {
  if (!object.is_object())
    throw Error(file_.string() + ": " + (path_.empty() ? "the document" : path_) +
                " must be an object with members " + joined(allowed));
  for (const auto& item : object.items()) {
    const std::string& key = item.key();
    if (key.starts_with("//") || std::ranges::find(allowed, key) != allowed.end()) continue;
    const std::string meant = set::nearest(key, allowed);
    fail(key, "is not known; " +
                  (meant.empty() ? "allowed: " + joined(allowed) : "did you mean " + meant + "?"));
  }
}

std::string Members::path(const std::string& key) const {
  return set::printable(path_.empty() ? key : path_ + "." + key);
}

void Members::fail(const std::string& key, const std::string& what) const {
  throw Error(file_.string() + ": " + path(key) + " " + what);
}

const Json& Members::value(const std::string& key) const {
  const auto found = object_.find(key);
  if (found == object_.end()) fail(key, "is missing");
  return *found;
}

std::string Members::text(const std::string& key) const {
  const Json& json = value(key);
  if (!json.is_string()) fail(key, "must be text");
  return json.get<std::string>();
}

double Members::number(const std::string& key, const Bounds& bounds) const {
  const Json& json = value(key);
  if (!json.is_number() || !within(json.get<double>(), bounds))
    fail(key, "must be " + bounds.text());
  return json.get<double>();
}

double Members::number(const std::string& key, const Bounds& bounds, double fallback) const {
  return has(key) ? number(key, bounds) : fallback;
}

std::int64_t Members::integer(const std::string& key, std::int64_t low, std::int64_t high) const {
  const Json& json = value(key);
  if (!is_integer(json, low, high)) fail(key, "must be " + whole_number(low, high));
  return json.get<std::int64_t>();
}

bool Members::flag(const std::string& key, bool fallback) const {
  if (!has(key)) return fallback;
  if (!value(key).is_boolean()) fail(key, "must be true or false");
  return value(key).get<bool>();
}

const Json& Members::list(const std::string& key, const std::string& of_what) const {
  const Json& json = value(key);
  if (!json.is_array()) fail(key, "must be a list; each entry " + of_what);
  return json;
}

std::vector<double> Members::numbers(const std::string& key, std::size_t count,
                                     const Bounds& bounds) const {
  std::vector<double> values;
  for (const Json& item : list(key, bounds.text())) {
    if (!item.is_number() || !within(item.get<double>(), bounds))
      fail(key + "[" + std::to_string(values.size()) + "]", "must be " + bounds.text());
    values.push_back(item.get<double>());
  }
  if (count > 0 && values.size() != count)
    fail(key, "has " + std::to_string(values.size()) + " entries; it must have " +
                  std::to_string(count));
  return values;
}

std::vector<std::int64_t> Members::integers(const std::string& key, std::int64_t low,
                                            std::int64_t high) const {
  std::vector<std::int64_t> values;
  for (const Json& item : list(key, whole_number(low, high))) {
    if (!is_integer(item, low, high))
      fail(key + "[" + std::to_string(values.size()) + "]", "must be " + whole_number(low, high));
    values.push_back(item.get<std::int64_t>());
  }
  return values;
}

std::vector<std::string> Members::texts(const std::string& key) const {
  std::vector<std::string> values;
  for (const Json& item : list(key, "text")) {
    if (!item.is_string()) fail(key + "[" + std::to_string(values.size()) + "]", "must be text");
    values.push_back(item.get<std::string>());
  }
  return values;
}

Members Members::object(const std::string& key, std::vector<std::string> allowed) const {
  return {file_, value(key), path(key), std::move(allowed)};
}

std::vector<Members> Members::objects(const std::string& key,
                                      const std::vector<std::string>& allowed) const {
  std::vector<Members> values;
  for (const Json& item : list(key, "an object"))
    values.push_back({file_, item, path(key) + "[" + std::to_string(values.size()) + "]", allowed});
  return values;
}

Json read_json(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw Error(file.string() + ": cannot be opened");
  try {
    return Json::parse(stream);
  } catch (const Json::exception& error) {
    throw Error(file.string() + ": is not JSON: " + error.what());
  }
}

}  // namespace previz::exchange
