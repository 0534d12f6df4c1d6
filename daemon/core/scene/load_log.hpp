// Keeps count while a scene is loaded: notes about what was left out, and how much has been loaded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include "daemon/core/scene/picture_bytes.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::scene {

// Collects notes about one file. A repeated note is counted, not repeated.
class Notes {
 public:
  explicit Notes(std::string file) : file_(std::move(file)) {}
  void add(const std::string& what);
  // Returns "file: what" or "file: what (3 times)", in the order of first mention.
  std::vector<std::string> lines() const;

 private:
  std::string file_;
  std::vector<std::pair<std::string, std::uint64_t>> notes_;
  std::unordered_map<std::string, std::size_t> place_;
};

// Returns what a message calls a part of a file: `material 3 "glass"`; "material 3" without a name.
std::string numbered(const std::string& kind, std::size_t index, const std::string& name);

// Counts against scene.hpp's limits; call before allocating. `where` begins the message of the
// previz::Error, which says which limit would be passed.
class Budget {
 public:
  // With `has_levels` a texture counts with all its levels
  // (daemon/core/render/world/mip_levels.hpp).
  explicit Budget(bool has_levels = false, std::uint64_t most_texels = max_texels)
      : has_levels_(has_levels), most_texels_(most_texels) {}
  void add_vertices(std::uint64_t count, const std::string& where);
  void add_triangles(std::uint64_t count, const std::string& where);
  void add_instance(const std::string& where);
  // Counts a texture and returns its number; how large it may be is known after the last.
  std::size_t add_texture(PictureSize size);
  // Returns the size that a texture may have so that all fit, its own where they do.
  PictureSize fitted_texture(std::size_t texture);
  std::uint64_t most_texels() const { return most_texels_; }
  bool has_levels() const { return has_levels_; }
  // Counts the vertices of one mesh once for each morph target and each set of joints.
  void add_deformed(std::uint64_t count, const std::string& where);
  // Counts the joints of a skin for each node that has it.
  void add_joints(std::uint64_t count, const std::string& where);

 private:
  bool has_levels_;
  std::uint64_t most_texels_;
  std::vector<PictureSize> sizes_, fitted_;  // of textures
  std::uint64_t vertices_ = 0, triangles_ = 0, instances_ = 0;
  std::uint64_t deformed_ = 0, joints_ = 0;
};

}  // namespace previz::scene
