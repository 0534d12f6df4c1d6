// What a set and its assets consist of.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/output/png.hpp"
#include "daemon/core/scene/deformation.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/scene/placement.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/tools/calibrate/lens/lens_file.hpp"
#include "daemon/tools/calibrate/lens/lens_file_check.hpp"
#include "daemon/tools/model/scan_obj.hpp"
#include "daemon/tools/model/scan_ply.hpp"
#include "daemon/tools/model/scan_stl.hpp"
#include "drivers/error.hpp"
#include "drivers/faults.hpp"
#include "drivers/plate.hpp"
#include "tests/fuzz/mutators.hpp"
#include "tests/fuzz/targets.hpp"

namespace previz::fuzz {
namespace scene_targets_cpp {

// The files that the kept sets name are there, so that their sets are accepted.
void set_file(Bytes bytes) {
  std::filesystem::create_directories(work_folder() / "stage");
  for (const char* name : {"phantom.glb", "virtual.glb", "pane.gltf", "sprout.glb", "stage/set.glb",
                           "stage/creature.glb", "stage/lamp.glb"})
    std::ofstream(work_folder() / name, std::ios::app);
  const set::Set set = set::parse_set(text_of(bytes), work_folder() / "stage.toml");
  for (const std::vector<std::string>& faults : {set.observer.faults, set.light_camera.faults})
    for (const std::string& fault : faults) parse_fault(fault);
}

set::Set set_of(const std::filesystem::path& file) {
  set::Set set;
  set.objects.resize(1);
  set.objects[0].name = "object";
  set.objects[0].file = file;
  return set;
}

void expect_whole(const scene::Scene& scene, const std::vector<scene::Instance>& instances) {
  for (const scene::Instance& instance : instances)
    expect(instance.mesh < scene.meshes.size() && instance.material < scene.materials.size(),
           "an instance has a mesh and a material");
}

// Whatever time it is, all that is shown has as many numbers as when it stands still.
void play(const scene::Scene& scene, const set::Set& set) {
  for (const double time_s : {0.0, 0.3, 1e9}) {
    session::SceneState state;
    state.animation_s = time_s;
    for (const scene::Variants& variants : scene.variants)
      state.variants["object"] = variants.names.back();
    const scene::Placement placement = scene::place(scene, set, state);
    expect_whole(scene, placement.instances);
    expect(placement.shapes.size() == scene.deformations.size(), "each deformation has a shape");
    for (std::size_t i = 0; i < placement.shapes.size(); ++i) {
      const scene::Mesh& mesh = scene.meshes.at(scene.deformations[i].mesh);
      if (!scene::can_be_shown(placement.shapes[i], scene.deformations[i].extent)) continue;
      expect(scene::deformed(mesh.undeformed, placement.shapes[i]).positions.size() ==
                 mesh.positions.size(),
             "a mesh keeps its vertices");
    }
  }
}

// Reads a file as it stands, and then with all that moves in it.
void gltf(Bytes bytes) {
  set::Set set = set_of(file_of(bytes, "object.glb"));
  const scene::Scene still = scene::load_scene(set);
  expect_whole(still, still.instances);
  if (text_of(bytes).find("\"animations\"") == std::string::npos) return;
  set.objects[0].animation = "*";
  play(scene::load_scene(set), set);
}

std::string little_endian(std::size_t number) {
  std::string bytes;
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(number >> shift);
  return bytes;
}

// A binary glTF file of one triangle, whose texture's image are the bytes.
std::string with_image(Bytes image) {
  const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::string buffer(reinterpret_cast<const char*>(corners), sizeof corners);
  buffer += text_of(image);
  buffer.resize((buffer.size() + 3) / 4 * 4);
  const nlohmann::json json = {
      {"asset", {{"version", "2.0"}}},
      {"buffers", {{{"byteLength", buffer.size()}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteLength", sizeof corners}},
        {{"buffer", 0}, {"byteOffset", sizeof corners}, {"byteLength", image.size()}}}},
      {"accessors", {{{"bufferView", 0}, {"componentType", 5126}, {"type", "VEC3"}, {"count", 3}}}},
      {"images", {{{"bufferView", 1}, {"mimeType", "image/png"}}}},
      {"textures", {{{"source", 0}}}},
      {"materials", {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}}},
      {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"material", 0}}}}}}},
      {"nodes", {{{"mesh", 0}}}},
      {"scenes", {{{"nodes", {0}}}}},
      {"scene", 0}};
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  return "glTF" + little_endian(2) + little_endian(28 + text.size() + buffer.size()) +
         little_endian(text.size()) + "JSON" + text + little_endian(buffer.size()) +
         std::string("BIN\0", 4) + buffer;
}

void texture(Bytes bytes) {
  if (bytes.empty()) return;
  const std::string file = with_image(bytes);
  const scene::Scene scene = scene::load_scene(set_of(
      file_of({reinterpret_cast<const std::uint8_t*>(file.data()), file.size()}, "textured.glb")));
  for (const scene::Texture& texture : scene.textures)
    expect(texture.texels.size() ==
               static_cast<std::size_t>(texture.width) * static_cast<std::size_t>(texture.height),
           "a texture is as large as it says");
}

void environment(Bytes bytes) {
  set::Lighting settings;
  settings.environment = file_of(bytes, "environment.exr");
  settings.resolution = 8;
  const lighting::Lighting light = lighting::load_environment(settings);
  expect(light.environment.radiance.size() == 64, "a map is as large as it was chosen");
  for (const glm::vec3& radiance : light.environment.radiance)
    for (int c = 0; c < 3; ++c)
      expect(radiance[c] >= 0 && radiance[c] <= 1e12f, "light can be summed");
}

// What follows a zero byte in an OBJ is its MTL.
model::FoundSurface found_in(const std::string& text, const std::filesystem::path& file,
                             model::ScanTextures& textures) {
  if (text.starts_with("ply") || text.starts_with("\xef\xbb\xbfply"))
    return model::read_ply(file, std::string(text), &textures);
  if (text.starts_with("solid") || (text.size() >= 84 && text.find('\0') < 80))
    return model::read_stl(file, text);
  const std::size_t end = std::min(text.find('\0'), text.size());
  file_of(bytes_of(std::string_view(text).substr(std::min(end + 1, text.size()))), "a.mtl");
  return model::read_obj(file, text.substr(0, end), &textures);
}

void scan(Bytes bytes) {
  const std::filesystem::path file = work_folder() / "scan";
  output::write_png(work_folder() / "a.png", Plate{1, 1, 8, {1, 2, 3}});
  model::ScanTextures textures(file);
  model::ScanFile read;
  model::take_surface(file, found_in(text_of(bytes), file, textures), model::Colouring::read, read);
  read.colours.pictures = textures.take();
  const std::size_t vertices = read.mesh.positions.size();
  for (const unsigned index : read.mesh.indices) expect(index < vertices, "a corner is a vertex");
  for (const glm::vec3& p : read.mesh.positions)
    for (int axis = 0; axis < 3; ++axis) expect(std::isfinite(p[axis]), "coordinates are finite");
  const model::ScanColours& colours = read.colours;
  expect(colours.uvs.size() == vertices && colours.luma.size() == vertices &&
             colours.sources.size() == read.mesh.triangles(),
         "every vertex and triangle has its colours");
  for (const int source : colours.sources)
    expect(source >= model::colourless && source < int(colours.pictures.size()),
           "a source is a picture");
}

void png(Bytes bytes) {
  const Plate plate = output::read_png(file_of(bytes, "plate.png"));
  expect(plate.samples.size() == std::size_t{3} * static_cast<std::size_t>(plate.width) *
                                     static_cast<std::size_t>(plate.height),
         "a plate is as large as it says");
}

// The size is given where the file has none. Of one camera at least, the lens must be accepted.
void lens_file(Bytes bytes) {
  const std::string text = text_of(bytes);
  calibrate::LensFile read = calibrate::read_lens_file(text, "lens");
  expect(!read.cameras.empty(), "a lens file has a camera");
  std::string refusal;
  bool some = false;
  for (calibrate::FileCamera& camera : read.cameras) {
    expect(camera.lens.has_value() == camera.refusal.empty(), "a camera has a lens or a refusal");
    if (!camera.lens) {
      refusal = camera.refusal;
      continue;
    }
    std::optional<calibrate::PictureSize> size;
    if (calibrate::picture_size(camera.lens->lens) == calibrate::PictureSize{}) size = {640, 480};
    calibrate::complete_lens(*camera.lens, size);
    std::visit(
        [](const auto& lens) {
          expect(lens.fx > 0 && lens.fy > 0 && std::isfinite(lens.fx + lens.fy + lens.cx + lens.cy),
                 "a lens's numbers are finite, and its focal lengths above 0");
          expect(lens.width > 0 && lens.height > 0, "a complete lens has a size");
          if constexpr (requires { lens.max_angle_rad; })
            expect(lens.max_angle_rad > 0 && lens.max_angle_rad <= std::numbers::pi,
                   "a fisheye has an angle");
        },
        camera.lens->lens);
    some = true;
  }
  if (!some) throw Error(refusal);
}

constexpr Target own[] = {
    {"set", "a set file", set_file, mutate_toml},
    {"gltf", "a glTF file", gltf, mutate_gltf},
    {"texture", "an image of a glTF file", texture},
    {"environment", "an environment: OpenEXR or Radiance .hdr", environment},
    {"scan", "a scan: PLY, STL, or OBJ and behind a zero its MTL", scan},
    {"png", "a plate as PNG", png},
    {"lens_file", "a lens of another program", lens_file},
};

}  // namespace scene_targets_cpp

std::span<const Target> scene_targets() {
  return scene_targets_cpp::own;
}

}  // namespace previz::fuzz
