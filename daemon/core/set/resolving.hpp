// What a set's tables are resolved with: the draft, the set that it becomes, and its problems.
// Internal to resolve.cpp and the files beside it, which have a table or a few each.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <map>
#include <string>

#include "daemon/core/set/origin.hpp"
#include "daemon/core/set/problems.hpp"
#include "daemon/core/set/table.hpp"

namespace previz::set {

struct Resolving {
  Draft& draft;
  Set& set;
  const std::filesystem::path folder;  // of the set file
  const Assets& assets;
  const Origin origin;
  Problems& problems;

  const Given& given(const std::string& table);
  void problem(const Given& table, const std::string& key, const std::string& what);
  // Adds a problem for every key of `keys` that is given although `reason` excludes it.
  void exclude(const Given& table, std::initializer_list<const char*> keys,
               const std::string& reason);
  // Adds a problem if an earlier table has the same `name`, which `words` say; `allowed` says how
  // often it may be there.
  template <class Name>
  void once(std::map<Name, Position>& first, const Name& name, const Given& table, const char* key,
            const std::string& words, const char* allowed) {
    const auto [other, is_new] = first.emplace(name, table.where(key));
    if (!is_new)
      problem(table, key,
              words + " is already on line " + std::to_string(other->second.line) +
                  "; allowed: " + allowed);
  }
  // Adds a problem if no tag is on the carrier that a table names.
  void carried(const Given& table, const std::string& by);

  std::filesystem::path located(const std::filesystem::path& as_written) const;
  // Returns the path of a folder, without the slash that it may end in. No disk is asked.
  std::filesystem::path folder_at(const char* table, const char* key,
                                  const std::filesystem::path& as_written);
  // Returns the path of a file that must exist. An asset replaces the file that the set names.
  std::filesystem::path existing(const Given& table, const std::string& key,
                                 const std::filesystem::path& as_written);
};

// Each resolves its tables; resolve() calls them in this order.
void resolve_cameras(Resolving& work);
void resolve_tags(Resolving& work);
void resolve_objects(Resolving& work);
void resolve_lights(Resolving& work);
void resolve_controls(Resolving& work);

}  // namespace previz::set
