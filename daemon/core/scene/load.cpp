#include "daemon/core/scene/load.hpp"

#include <map>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "daemon/core/scene/gltf.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

// Only real objects take the colours that the set states: a virtual object of the same file keeps
// the material it was made with.
void apply(const set::Surface& surface, const std::string& set_file, Scene& scene) {
  std::map<std::uint32_t, std::uint32_t> recoloured;  // index as loaded to index as recoloured
  std::string known;
  for (Instance& instance : scene.instances) {
    if ((instance.presence & world_real) == 0) continue;
    const std::string name = scene.materials[instance.material].name;
    const std::string quoted = '"' + set::one_line(name) + '"';
    if (!name.empty() && known.find(quoted) == std::string::npos)
      known += (known.empty() ? "" : ", ") + quoted;
    if (name != surface.material) continue;
    const auto entry = recoloured.try_emplace(instance.material, scene.materials.size()).first;
    if (entry->second == scene.materials.size()) {
      scene.materials.push_back(scene.materials[instance.material]);
      scene.materials.back().base_color = surface.albedo;
    }
    instance.material = entry->second;
  }
  if (recoloured.empty())
    throw Error(set_file + ": surface.material: no real object has a material \"" +
                surface.material + "\"; there are " + (known.empty() ? "none with a name" : known));
}

// A session stores its files by their checksums; notes begin with the file's name.
std::string as_crews_know(const set::Object& object, std::string note) {
  const std::string stored = object.file.string();
  const std::filesystem::path known = object.file_as_written;
  if (!known.empty() && object.file.filename() != known.filename() && note.starts_with(stored))
    note.replace(0, stored.size(), known.string());
  return note;
}

}  // namespace

Scene load_scene(const set::Set& set, std::uint64_t most_texels) {
  Scene scene;
  Budget budget(set.estimation.filter_textures, most_texels);
  std::map<std::filesystem::path, std::unique_ptr<GltfFile>> files;
  struct Named {
    GltfFile* file;
    const set::Object& object;  // the first that uses it
  };
  std::vector<Named> in_order;
  for (std::size_t i = 0; i < set.objects.size(); ++i) {
    const set::Object& object = set.objects[i];
    std::error_code not_there;
    const auto canonical = std::filesystem::weakly_canonical(object.file, not_there);
    auto& file = files[not_there ? object.file : canonical];
    if (!file) {
      file = std::make_unique<GltfFile>(object.file, scene, budget);
      in_order.push_back({file.get(), object});
    }
    file->add(object, static_cast<std::uint32_t>(i));
    scene.light_objects.resize(scene.lights.size(), static_cast<std::uint32_t>(i));
  }
  for (const auto& [file, object] : in_order) file->finish();
  for (const set::Surface& surface : set.surfaces) apply(surface, set.file.string(), scene);
  hide_tags(scene.instances, set.hides_tags);  // a tag's colour is real, hidden or not
  scene.lights.insert(scene.lights.end(), set.lights.begin(), set.lights.end());
  scene.light_objects.resize(scene.lights.size(), no_object);
  for (const auto& [file, object] : in_order)
    for (std::string& note : file->notes())
      scene.notes.push_back(as_crews_know(object, std::move(note)));
  return scene;
}

}  // namespace previz::scene
