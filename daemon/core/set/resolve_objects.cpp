// The tables of objects and surfaces.
#include <glm/gtc/matrix_transform.hpp>
#include <map>

#include "daemon/core/set/pose.hpp"
#include "daemon/core/set/resolving.hpp"

namespace previz::set {
namespace {

glm::dmat4 placed(Resolving& work, const ObjectDraft& draft) {
  const auto& table = draft.given;
  if (!table.has("world_from_file"))
    return glm::scale(rigid_transform(draft.pose), glm::dvec3{draft.scale});
  work.exclude(table, {"position_m", "rotation_deg", "scale"},
               "conflicts with world_from_file; allowed: one of the two");
  if (!table.good("world_from_file")) return glm::dmat4{1};
  constexpr double flat = 1e-6;
  if (regularity(*draft.pose.matrix) < flat)
    work.problem(table, "world_from_file",
                 "flattens the object; allowed: any invertible transform");
  return *draft.pose.matrix;
}

void objects(Resolving& work) {
  std::map<std::string, Position> first;
  for (auto& draft : work.draft.objects) {
    const auto& table = draft.given;
    auto& object = draft.object;
    if (table.good("name")) {
      if (object.name.empty()) work.problem(table, "name", "is empty; allowed: text");
      work.once(first, object.name, table, "name", codec::quote(object.name), "each name once");
    }
    object.file_as_written = draft.file.string();
    object.file = work.existing(table, "file", draft.file);
    object.world_from_file = placed(work, draft);
    work.carried(table, object.carrier);
    work.set.objects.push_back(object);
  }
}

void surfaces(Resolving& work) {
  std::map<std::string, Position> first;
  for (const auto& draft : work.draft.surfaces) {
    const auto& material = draft.surface.material;
    if (draft.given.good("material")) {
      work.once(first, material, draft.given, "material", codec::quote(material),
                "each material once");
    }
    work.set.surfaces.push_back(draft.surface);
  }
}

}  // namespace

void resolve_objects(Resolving& work) {
  objects(work);
  surfaces(work);
}

}  // namespace previz::set
