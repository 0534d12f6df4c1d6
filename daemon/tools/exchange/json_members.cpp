#include "daemon/tools/exchange/json_members.hpp"

#include <algorithm>
#include <limits>

#include "daemon/core/session/files.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) add_to_list(text, word);
  return text;
}

}  // namespace

Value value_of(const Json& json) {
  Value out;
  const bool is_whole =
      json.is_number_integer() &&
      !(json.is_number_unsigned() &&
        json.get<std::uint64_t>() > std::uint64_t{std::numeric_limits<std::int64_t>::max()});
  if (json.is_boolean())
    out.data = json.get<bool>();
  else if (is_whole)
    out.data = json.get<std::int64_t>();
  else if (json.is_number())
    out.data = json.get<double>();
  else if (json.is_string())
    out.data = json.get<std::string>();
  else if (json.is_array()) {
    std::vector<Value> entries;
    for (const Json& entry : json) entries.push_back(value_of(entry));
    out.data = std::move(entries);
  }
  return out;
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
    fail(key, "is unknown; " +
                  (meant.empty() ? "allowed: " + joined(allowed) : "did you mean " + meant + "?"));
  }
}

std::string Members::path(const std::string& key) const {
  return set::printable(path_.empty() ? key : path_ + "." + key);
}

void Members::fail(const std::string& key, const std::string& what) const {
  throw Error(file_.string() + ": " + path(key) + " " + what);
}

void Members::fault(const std::string& key, const std::string& what) const {
  throw Error(file_.string() + ": " + path(key) + ": " + what);
}

const Json& Members::value(const std::string& key) const {
  const auto found = object_.find(key);
  if (found == object_.end()) fail(key, "is missing");
  return *found;
}

const Json& Members::list(const std::string& key, const std::string& of_what) const {
  const Json& json = value(key);
  if (!json.is_array()) fail(key, "must be a list; each entry " + of_what);
  return json;
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

namespace {

// Returns whether a file begins as text does: videos and pictures have bytes that no text has.
bool is_text_at_its_start(const std::filesystem::path& file) {
  return std::ranges::none_of(session::read_beginning(file, 64), [](char c) {
    return static_cast<unsigned char>(c) < ' ' && c != '\n' && c != '\r' && c != '\t';
  });
}

}  // namespace

Json read_json(const std::filesystem::path& file) {
  const std::string hint = is_text_at_its_start(file)
                               ? ""
                               : ". A video or a picture is named in a JSON file; "
                                 "config/frames.example.json shows how";
  try {
    return Json::parse(session::read_file(file, {"a list of frames (JSON)", 1 << 27}));
  } catch (const Json::exception& error) {
    throw Error(file.string() + ": is not JSON: " + error.what() + hint);
  } catch (const Error& error) {
    throw Error(error.what() + hint);
  }
}

}  // namespace previz::exchange
