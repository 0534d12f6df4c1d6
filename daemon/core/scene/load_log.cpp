#include "daemon/core/scene/load_log.hpp"

#include "daemon/core/scene/texture_sizes.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

void add(std::uint64_t& total, std::uint64_t count, std::uint64_t limit, const char* of_what,
         const std::string& where) {
  if (count > limit - total)
    throw Error(where + ": with its " + std::to_string(count) + " the scene would have " +
                "more than " + std::to_string(limit) + " " + of_what);
  total += count;
}

}  // namespace

void Notes::add(const std::string& what) {
  const auto [at, is_new] = place_.try_emplace(what, notes_.size());
  if (is_new)
    notes_.emplace_back(what, 1);
  else
    ++notes_[at->second].second;
}

std::vector<std::string> Notes::lines() const {
  std::vector<std::string> lines;
  for (const auto& [what, times] : notes_)
    lines.push_back(file_ + ": " + what +
                    (times > 1 ? " (" + std::to_string(times) + " times)" : ""));
  return lines;
}

std::string numbered(const std::string& kind, std::size_t index, const std::string& name) {
  std::string text = kind + ' ' + std::to_string(index);
  return name.empty() ? text : text + " \"" + set::one_line(name) + '"';
}

void Budget::add_vertices(std::uint64_t count, const std::string& where) {
  scene::add(vertices_, count, max_triangles, "vertices", where);
}

void Budget::add_triangles(std::uint64_t count, const std::string& where) {
  scene::add(triangles_, count, max_triangles, "triangles", where);
}

void Budget::add_instance(const std::string& where) {
  scene::add(instances_, 1, max_instances, "instances", where);
}

std::size_t Budget::add_texture(PictureSize size) {
  sizes_.push_back(size);
  return sizes_.size() - 1;
}

PictureSize Budget::fitted_texture(std::size_t texture) {
  if (fitted_.size() != sizes_.size()) fitted_ = fitted_sizes(sizes_, has_levels_, most_texels_);
  return fitted_[texture];
}

void Budget::add_deformed(std::uint64_t count, const std::string& where) {
  scene::add(deformed_, count, max_deformed, "vertices of morph targets and sets of joints", where);
}

void Budget::add_joints(std::uint64_t count, const std::string& where) {
  scene::add(joints_, count, max_joints, "joints", where);
}

}  // namespace previz::scene
