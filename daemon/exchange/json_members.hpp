// The members of a JSON object as typed values; every error names the file, the member's path and
// what is allowed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace previz::exchange {

using Json = nlohmann::json;

struct Bounds {
  double low, high;    // both allowed, unless `above`
  bool above = false;  // low itself is not allowed
  std::string text() const;
};

class Members {
 public:
  // Members whose names begin with "//" are comments. Throws previz::Error if `object` is no object
  // or has a member that is not among `allowed`, suggesting the nearest.
  Members(const std::filesystem::path& file, const Json& object, std::string path,
          std::vector<std::string> allowed);

  bool has(const std::string& key) const { return object_.contains(key); }
  std::string path(const std::string& key) const;
  [[noreturn]] void fail(const std::string& key, const std::string& what) const;

  // Required; the forms with a fallback are not.
  std::string text(const std::string& key) const;
  double number(const std::string& key, const Bounds& bounds) const;
  double number(const std::string& key, const Bounds& bounds, double fallback) const;
  std::int64_t integer(const std::string& key, std::int64_t low, std::int64_t high) const;
  bool flag(const std::string& key, bool fallback) const;
  // `count` numbers, or any number of them if 0.
  std::vector<double> numbers(const std::string& key, std::size_t count,
                              const Bounds& bounds) const;
  std::vector<std::int64_t> integers(const std::string& key, std::int64_t low,
                                     std::int64_t high) const;
  std::vector<std::string> texts(const std::string& key) const;
  // The object under `key`.
  Members object(const std::string& key, std::vector<std::string> allowed) const;
  // The objects of the list under `key`.
  std::vector<Members> objects(const std::string& key,
                               const std::vector<std::string>& allowed) const;
  // Any form; for members that may take several.
  const Json& value(const std::string& key) const;

 private:
  const Json& list(const std::string& key, const std::string& of_what) const;

  std::filesystem::path file_;
  const Json& object_;  // the document outlives its Members
  std::string path_;
};

// Throws previz::Error naming file, line and column. The document must be an object.
Json read_json(const std::filesystem::path& file);

}  // namespace previz::exchange
