// Brings into order what an earlier process left in the folders of takes.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace previz::output {

class Salvage {
 public:
  // `note` is called for what cannot be read.
  Salvage(std::vector<std::filesystem::path> folders, std::function<void(const std::string&)> note)
      : folders_(std::move(folders)), note_(std::move(note)), is_looked_at_(folders_.size()) {}

  // Looks at each folder once: at the first call at which it is there, because its disk may be
  // mounted later. What is wrong with one folder is no reason to leave out another. No take may be
  // in work. Appends to `salvaged`, in words, each take that was cut off and is in order again.
  // Returns whether there was a folder to look at.
  bool look(std::vector<std::string>& salvaged);

 private:
  void salvage(const std::filesystem::path& take, std::vector<std::string>& salvaged) const;

  const std::vector<std::filesystem::path> folders_;
  const std::function<void(const std::string&)> note_;
  std::vector<bool> is_looked_at_;
};

}  // namespace previz::output
