#include "daemon/core/fit/real_model.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <map>
#include <string>
#include <utility>

namespace previz::fit {
namespace {

// Surfaces touch that are as near as this.
constexpr double touch_m = 2e-3;

bool has_edges(const scene::Material& material) {
  return material.alpha_mode == scene::AlphaMode::opaque && !scene::transmits(material);
}

glm::dvec3 middle_of(const lighting::Triangles& triangles) {
  glm::dvec3 low = triangles[0], high = low;
  for (const glm::dvec3& p : triangles) low = glm::min(low, p), high = glm::max(high, p);
  return 0.5 * (low + high);
}

// Looks beside the face that leads `into` the body, past its edge, whether a surface is there. The
// look begins on the side that is away from the other face, which leads `other`.
bool meets_surface(const lighting::Room& surface, const glm::dvec3& edge, const glm::dvec3& into,
                   const glm::dvec3& other) {
  const glm::dvec3 beside = edge + 0.5 * touch_m * (into - other);
  const auto distance = surface.distance(beside, -into);
  return distance && *distance < 1.5 * touch_m;
}

bool is_touched(const lighting::Room& surface, const FeatureEdge& edge) {
  if (edge.into.size() > 2) return true;
  for (const double share : {0.1, 0.5, 0.9}) {
    const glm::dvec3 at = edge.a + share * (edge.b - edge.a);
    const glm::dvec3& into = edge.into[0];
    if (edge.into.size() == 2) {
      if (meets_surface(surface, at, into, edge.into[1]) ||
          meets_surface(surface, at, edge.into[1], into))
        return true;
      continue;
    }
    const glm::dvec3 normal = glm::normalize(glm::cross(edge.b - edge.a, into));
    if (meets_surface(surface, at, into, normal) || meets_surface(surface, at, into, -normal))
      return true;
  }
  return false;
}

// Puts something before or behind names that are not the only ones of their kind.
template <typename Rename>
void rename_alike(std::vector<std::string>& names, Rename rename) {
  std::map<std::string, std::vector<std::size_t>> alike;
  for (std::size_t number = 0; number < names.size(); ++number)
    alike[names[number]].push_back(number);
  for (const auto& [name, numbers] : alike)
    for (std::size_t i = 0; i < numbers.size() && numbers.size() > 1; ++i)
      rename(numbers[i], i + 1, numbers.size());
}

// Gives the parts of a scene numbers.
class Naming {
 public:
  std::size_t number_of(const scene::Instance& instance) {
    if (instance.tag != scene::TagPart::none) return no_part;
    const auto [at, is_new] =
        numbers_.try_emplace({instance.object, instance.placed}, parts_.size());
    if (is_new) parts_.push_back({instance.object, instance.node}), ++of_object_[instance.object];
    return at->second;
  }

  std::vector<std::string> names(const set::Set& set) const {
    std::vector<std::string> names;
    for (const Part& part : parts_)
      names.push_back(is_object(part) ? set.objects[part.object].name : part.node);
    rename_alike(names, [&](std::size_t number, std::size_t, std::size_t) {
      const Part& part = parts_[number];
      if (!is_object(part)) names[number] = set.objects[part.object].name + ": " + part.node;
    });
    rename_alike(names, [&](std::size_t number, std::size_t which, std::size_t of) {
      names[number] += " (" + std::to_string(which) + " of " + std::to_string(of) + ')';
    });
    return names;
  }

 private:
  struct Part {
    std::uint32_t object = 0;
    std::string node;
  };

  // Returns whether a part has the name of its object.
  bool is_object(const Part& part) const {
    return part.node.empty() || of_object_.at(part.object) == 1;
  }

  std::vector<Part> parts_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> numbers_;  // by object, placed
  std::map<std::uint32_t, std::size_t> of_object_;                          // parts
};

}  // namespace

bool stands_still(const scene::Instance& instance, const set::Set& set) {
  const set::Object& object = set.objects[instance.object];
  return object.carrier.empty() && object.animation.empty();
}

void append(const scene::Scene& scene, const scene::Instance& instance,
            lighting::Triangles& triangles) {
  const scene::Mesh& mesh = scene.meshes[instance.mesh];
  for (const glm::uvec3& triangle : mesh.triangles)
    for (int k = 0; k < 3; ++k)
      triangles.push_back(instance.world_from_object * glm::dvec4(mesh.positions[triangle[k]], 1));
}

RealModel::RealModel(const scene::Scene& scene, const set::Set& set) {
  lighting::Triangles all, opaque;
  std::vector<std::size_t> parts;  // of the triangles of `opaque`
  Naming naming;
  for (const scene::Instance& instance : scene.instances) {
    if (!(instance.presence & scene::world_real) || !stands_still(instance, set)) continue;
    append(scene, instance, all);
    if (!has_edges(scene.materials[instance.material])) continue;
    append(scene, instance, opaque);
    parts.resize(opaque.size() / 3, naming.number_of(instance));
  }
  if (all.empty()) return;
  surface_.emplace(all, middle_of(all));
  for (const FeatureEdge& edge : feature_edges(opaque, parts))
    edges_.push_back({edge.a, edge.b, is_touched(*surface_, edge), edge.part});
  parts_ = naming.names(set);
}

bool RealModel::is_seen(const glm::dvec3& eye, const glm::dvec3& point) const {
  return !surface_ || surface_->sees(eye, point);
}

}  // namespace previz::fit
