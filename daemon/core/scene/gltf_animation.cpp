#include "daemon/core/scene/gltf_animation.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iomanip>
#include <numeric>
#include <sstream>

#include "daemon/core/scene/gltf_accessor.hpp"
#include "daemon/core/scene/gltf_nodes.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

std::size_t place(int index) {
  return static_cast<std::size_t>(index);
}

// Returns "animation 3", or "animation 3 "walk"" where it has a name.
std::string label(const tinygltf::Model& model, std::size_t index) {
  return numbered("animation", index, model.animations[index].name);
}

// Returns the duration of an animation in words; files that are wrong have none.
std::string duration_of(const tinygltf::Model& model, const tinygltf::Animation& animation) {
  double end_s = 0;
  try {
    for (const tinygltf::AnimationSampler& sampler : animation.samplers)
      for (const float time : read_scalars(model, sampler.input, ""))
        end_s = std::max(end_s, static_cast<double>(time));
  } catch (const Error&) {
    return "unreadable";
  }
  std::ostringstream text;
  text << std::setprecision(4) << end_s << " s";
  return text.str();
}

std::vector<std::size_t> chosen_animations(const tinygltf::Model& model, const std::string& which,
                                           const std::string& file) {
  const std::vector<tinygltf::Animation>& all = model.animations;
  const auto named = std::ranges::find(all, which, &tinygltf::Animation::name);
  if (named != all.end()) return {static_cast<std::size_t>(named - all.begin())};
  if (which == "*" && !all.empty()) {
    std::vector<std::size_t> indices(all.size());
    std::iota(indices.begin(), indices.end(), std::size_t{0});
    return indices;
  }
  std::size_t index = 0;
  const char* const end = which.data() + which.size();
  const auto [read_to, error] = std::from_chars(which.data(), end, index);
  if (error == std::errc() && read_to == end && index < all.size()) return {index};

  std::vector<std::string> names;
  for (const tinygltf::Animation& animation : all) names.push_back(animation.name);
  const std::string near = set::nearest(which, names);
  throw Error(file + ": has no animation \"" + set::one_line(which) + "\"" +
              (near.empty() ? "" : "; did you mean \"" + set::one_line(near) + "\"?") + "; " +
              list_of_animations(model));
}

Interpolation interpolation_of(const tinygltf::AnimationSampler& sampler,
                               const std::string& where) {
  if (sampler.interpolation == "STEP") return Interpolation::step;
  if (sampler.interpolation == "CUBICSPLINE") return Interpolation::cubic_spline;
  if (sampler.interpolation == "LINEAR" || sampler.interpolation.empty())
    return Interpolation::linear;
  throw Error(where + ": interpolation \"" + set::one_line(sampler.interpolation) +
              "\" is not one of glTF's");
}

std::vector<double> times_of(const tinygltf::Model& model, int accessor, const std::string& where) {
  std::vector<double> times;
  for (const float time : read_scalars(model, accessor, where + ", input")) times.push_back(time);
  const bool sound = !times.empty() && times.front() >= 0 && std::isfinite(times.back()) &&
                     std::ranges::adjacent_find(times, std::greater_equal<>()) == times.end();
  if (!sound) throw Error(where + ": its times are not increasing from 0 s or later");
  return times;
}

WeightChannel weight_channel_of(const tinygltf::Model& model,
                                const tinygltf::AnimationSampler& sampler,
                                const std::string& where) {
  WeightChannel channel;
  channel.interpolation = interpolation_of(sampler, where);
  channel.times_s = times_of(model, sampler.input, where);
  for (const float value :
       read_scalars(model, sampler.output, where + ", output", Components::animated)) {
    if (!std::isfinite(value)) throw Error(where + ", output: a weight is not finite");
    channel.values.push_back(value);
  }
  return channel;
}

AnimationChannel channel_of(const tinygltf::Model& model, const tinygltf::AnimationSampler& sampler,
                            bool is_rotation, const std::string& where) {
  AnimationChannel channel;
  channel.interpolation = interpolation_of(sampler, where);
  channel.times_s = times_of(model, sampler.input, where);
  const std::string output = where + ", output";
  if (is_rotation)
    for (const glm::vec4& value : read_vec4s(model, sampler.output, output, Components::animated))
      channel.values.emplace_back(value);
  else
    for (const glm::vec3& value : read_vec3s(model, sampler.output, output))
      channel.values.emplace_back(value, 0);

  const bool is_cubic = channel.interpolation == Interpolation::cubic_spline;
  const std::size_t wanted = channel.times_s.size() * (is_cubic ? 3 : 1);
  if (channel.values.size() != wanted)
    throw Error(output + ": has " + std::to_string(channel.values.size()) +
                " values, but its key times need " + std::to_string(wanted));
  for (std::size_t i = 0; i < wanted; ++i) {
    const glm::dvec4& value = channel.values[i];
    const bool is_key = !is_cubic || i % 3 == 1;  // tangents may be anything
    if (!std::isfinite(value.x + value.y + value.z + value.w) ||
        (is_rotation && is_key && !(glm::dot(value, value) > 1e-12)))
      throw Error(output + ": value " + std::to_string(i) + " is not finite, or no rotation");
  }
  return channel;
}

}  // namespace

std::string list_of_animations(const tinygltf::Model& model) {
  constexpr std::size_t most_listed = 20;
  const std::size_t count = model.animations.size();
  if (count == 0) return "it has none";
  std::string list = "it has ";
  for (std::size_t i = 0; i < std::min(count, most_listed); ++i) {
    const tinygltf::Animation& animation = model.animations[i];
    list += (i > 0 ? ", " : "") + std::to_string(i) +
            (animation.name.empty() ? " without a name"
                                    : " \"" + set::one_line(animation.name) + "\"") +
            " (" + duration_of(model, animation) + ")";
  }
  if (count > most_listed) list += " and " + std::to_string(count - most_listed) + " more";
  return list + "; give the name, the index or \"*\" for all";
}

GltfAnimation::GltfAnimation(const tinygltf::Model& model, const std::string& which,
                             const std::string& file, Notes& notes)
    : model_(model),
      file_(file),
      notes_(notes),
      parents_(parents_of(model, file)),
      moved_(model.nodes.size()),
      weights_(model.nodes.size()),
      is_moved_(model.nodes.size()),
      taken_up_(model.nodes.size(), no_node) {
  const std::vector<std::size_t> chosen = chosen_animations(model, which, file);
  for (const std::size_t index : chosen) {
    const std::vector<tinygltf::AnimationChannel>& channels = model.animations[index].channels;
    for (std::size_t i = 0; i < channels.size(); ++i)
      read_channel(index, channels[i],
                   file + ": " + label(model, index) + ", channel " + std::to_string(i));
  }
  if (!(duration_s_ > 0))
    throw Error(file + ": " +
                (chosen.size() > 1 ? "its " + std::to_string(chosen.size()) + " animations move"
                                   : label(model, chosen[0]) + " moves") +
                " nothing, or for no time");
  find_moved();
}

void GltfAnimation::note_replaced(std::size_t index, const tinygltf::AnimationChannel& given) {
  const auto [before, is_new] = player_.try_emplace({given.target_node, given.target_path}, index);
  if (is_new) return;
  if (before->second == index)
    notes_.add(label(model_, index) +
               ": has two channels for the same property of a node; the later one is played");
  else
    notes_.add(label(model_, before->second) + " and " + label(model_, index) +
               " animate the same property of a node; there the later one is played");
  before->second = index;
}

void GltfAnimation::read_channel(std::size_t index, const tinygltf::AnimationChannel& given,
                                 const std::string& where) {
  if (given.target_node < 0) return;  // such a channel is ignored (glTF 2.0, 3.11)
  if (place(given.target_node) >= moved_.size())
    throw Error(where + ": no node " + std::to_string(given.target_node));
  const tinygltf::Animation& animation = model_.animations[index];
  const tinygltf::Node& node = model_.nodes[place(given.target_node)];
  AnimatedNode& moved = moved_[place(given.target_node)];
  AnimationChannel* const channel = given.target_path == "translation" ? &moved.translations
                                    : given.target_path == "rotation"  ? &moved.rotations
                                    : given.target_path == "scale"     ? &moved.scales
                                                                       : nullptr;
  const bool is_weights = given.target_path == "weights";
  if (!channel && !is_weights)
    return notes_.add(label(model_, index) + ": its channels of \"" +
                      set::one_line(given.target_path) + "\" are not played");
  if (given.sampler < 0 || place(given.sampler) >= animation.samplers.size())
    throw Error(where + ": no sampler " + std::to_string(given.sampler));
  const tinygltf::AnimationSampler& sampler = animation.samplers[place(given.sampler)];
  note_replaced(index, given);
  if (is_weights) {
    weights_[place(given.target_node)] = weight_channel_of(model_, sampler, where);
    const double end_s = weights_[place(given.target_node)].times_s.back();
    duration_s_ = std::max(duration_s_, end_s);
    return;
  }
  if (!node.matrix.empty())
    throw Error(where + ": " + node_name(model_, given.target_node) +
                " has a matrix; only translation, rotation and scale can be animated");
  *channel = channel_of(model_, sampler, channel == &moved.rotations, where);
  moved.moves = true;
  duration_s_ = std::max(duration_s_, channel->times_s.back());
}

WeightChannel GltfAnimation::weights_of(int node, std::size_t targets) const {
  const WeightChannel& channel = weights_[place(node)];
  const bool is_cubic = channel.interpolation == Interpolation::cubic_spline;
  if (channel.values.size() != channel.times_s.size() * targets * (is_cubic ? 3 : 1))
    throw Error(file_ + ": " + node_name(model_, node) + ": its animated weights are " +
                std::to_string(channel.values.size()) + " numbers for " +
                std::to_string(channel.times_s.size()) + " times and " + std::to_string(targets) +
                " morph targets");
  return channel;
}

// Visits each node once: climbs to an ancestor whose state is known, and goes back down.
void GltfAnimation::find_moved() {
  std::vector<bool> is_known(parents_.size());
  std::vector<int> path;
  for (std::size_t i = 0; i < parents_.size(); ++i) {
    int above = static_cast<int>(i);
    for (path.clear(); above >= 0 && !is_known[place(above)]; above = parents_[place(above)]) {
      if (path.size() == parents_.size())
        throw Error(file_ + ": " + node_name(model_, above) + " is its own ancestor");
      path.push_back(above);
    }
    for (auto node = path.rbegin(); node != path.rend(); above = *node++) {
      is_moved_[place(*node)] =
          moved_[place(*node)].moves || (above >= 0 && is_moved_[place(above)]);
      is_known[place(*node)] = true;
    }
  }
}

std::uint32_t GltfAnimation::use(int node, std::vector<AnimatedNode>& nodes) {
  return is_moved_[place(node)] ? take_up(node, nodes) : no_node;
}

std::uint32_t GltfAnimation::take_up(int node, std::vector<AnimatedNode>& nodes) {
  std::vector<int> path;  // the node and its ancestors that are not in the list yet
  for (int at = node; at >= 0 && taken_up_[place(at)] == no_node; at = parents_[place(at)])
    path.push_back(at);
  for (auto at = path.rbegin(); at != path.rend(); ++at) {
    AnimatedNode taken = moved_[place(*at)];
    const int parent = parents_[place(*at)];
    if (parent >= 0) taken.parent = taken_up_[place(parent)];
    const NodeTransform rest =
        transform_of(model_.nodes[place(*at)], file_ + ": " + node_name(model_, *at));
    taken.parent_from_node = rest.parent_from_node;
    taken.translation = rest.translation;
    taken.rotation = rest.rotation;
    taken.scale = rest.scale;
    taken_up_[place(*at)] = static_cast<std::uint32_t>(nodes.size());
    nodes.push_back(std::move(taken));
  }
  return taken_up_[place(node)];
}

}  // namespace previz::scene
