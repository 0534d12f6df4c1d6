#include "daemon/core/pipeline/room_model.hpp"

#include <cmath>
#include <glm/matrix.hpp>
#include <string>

#include "daemon/core/scene/load.hpp"
#include "daemon/core/scene/scene.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {
namespace {

lighting::Triangles file_triangles(const set::Room& room) {
  set::Set only_room;
  only_room.objects.push_back({.name = "room",
                               .file = room.file,
                               .file_as_written = room.file_as_written,
                               .presence = set::Presence::phantom,
                               .world_from_file = room.world_from_room,
                               .nodes = {},
                               .carrier = {},
                               .animation = {},
                               .variant = {}});
  const scene::Scene scene = scene::load_scene(only_room);
  lighting::Triangles triangles;
  for (const scene::Instance& instance : scene.instances) {
    const scene::Mesh& mesh = scene.meshes[instance.mesh];
    for (const glm::uvec3& triangle : mesh.triangles)
      for (int corner = 0; corner < 3; ++corner)
        triangles.emplace_back(instance.world_from_object *
                               glm::dvec4(mesh.positions[triangle[corner]], 1));
  }
  return triangles;
}

void check_inside(const set::Set& set, const set::Room& room, const char* what,
                  const glm::dvec3& place) {
  const glm::dvec3 in_room(glm::inverse(room.world_from_room) * glm::dvec4(place, 1));
  for (int axis = 0; axis < 3; ++axis)
    if (!(std::abs(in_room[axis]) < (*room.size_m)[axis] / 2 + lighting::on_surface_m))
      throw Error(set.file.string() + ": lighting.room: " + what + " is not inside the box");
}

}  // namespace

std::shared_ptr<const lighting::Room> open_room(const set::Set& set,
                                                const glm::dvec3& light_camera_position) {
  if (!set.lighting.room) return nullptr;
  const set::Room& room = *set.lighting.room;
  if (room.size_m) {
    check_inside(set, room, "the light camera", light_camera_position);
    check_inside(set, room, "seen_from_m", room.seen_from);
  }
  const lighting::Triangles triangles =
      room.size_m ? lighting::box_triangles(*room.size_m, room.world_from_room)
                  : file_triangles(room);
  if (triangles.empty())
    throw Error(set.file.string() + ": lighting.room: " + room.file.string() + " holds no surface");
  return std::make_shared<const lighting::Room>(
      triangles, lighting::off_surfaces(triangles, room.seen_from, light_camera_position));
}

}  // namespace previz::pipeline
