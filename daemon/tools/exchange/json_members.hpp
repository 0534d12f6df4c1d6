// Reads the members of a JSON object as typed values; every error names the file, the member's path
// and what is allowed.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/keys/value.hpp"

namespace previz::exchange {

using Json = nlohmann::json;

// Converts JSON to a Value. A list becomes a list of Values; null and objects, which no key takes,
// become a monostate.
Value value_of(const Json& json);

class Members {
 public:
  // Members whose names begin with "//" are comments. Throws previz::Error if `object` is no object
  // or has a member that is not among `allowed`, suggesting the nearest.
  Members(const std::filesystem::path& file, const Json& object, std::string path,
          std::vector<std::string> allowed);

  bool has(const std::string& key) const { return object_.contains(key); }
  std::string path(const std::string& key) const;
  [[noreturn]] void fail(const std::string& key, const std::string& what) const;

  // Fails because a value breaks the key's own rule, in the words of the set file.
  [[noreturn]] void fault(const std::string& key, const std::string& what) const;

  // Returns the value of a member that must be there.
  template <typename T>
  T read(const std::string& key, const Rule& rule = {}) const {
    return read_value<T>(key, value(key), rule);
  }
  // Returns the entries of a list that must be there; an error names the entry.
  template <typename T>
  std::vector<T> read_list(const std::string& key, const Rule& rule = {}) const {
    std::vector<T> values;
    for (const Json& entry : list(key, Codec<T>::describe(rule)))
      values.push_back(read_value<T>(key + "[" + std::to_string(values.size()) + "]", entry, rule));
    return values;
  }
  // Returns the object under `key`.
  Members object(const std::string& key, std::vector<std::string> allowed) const;
  // Returns the objects of the list under `key`.
  std::vector<Members> objects(const std::string& key,
                               const std::vector<std::string>& allowed) const;
  // Returns the JSON under `key`, for members that may take several forms.
  const Json& value(const std::string& key) const;

 private:
  template <typename T>
  T read_value(const std::string& key, const Json& json, const Rule& rule) const {
    try {
      return Codec<T>::read(value_of(json), rule);
    } catch (const Misread& misread) {
      fault(key, misread.what);
    }
  }
  const Json& list(const std::string& key, const std::string& of_what) const;

  std::filesystem::path file_;
  const Json& object_;  // the document outlives its Members
  std::string path_;
};

// Reads a document, which must be an object. Throws previz::Error naming file, line and column.
Json read_json(const std::filesystem::path& file);

}  // namespace previz::exchange
