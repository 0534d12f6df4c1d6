// A glTF file that a test writes and loads as the only object of a set.
#pragma once

#include "daemon/core/scene/load.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/session/records.hpp"
#include "daemon/core/set/set.hpp"
#include "tests/support/gltf_writer.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

// A set of one object, which is all of this file.
inline set::Set set_of(const std::filesystem::path& file) {
  set::Set set;
  set.objects.resize(1);
  set.objects[0].file = file;
  return set;
}

class GltfTest : public ::testing::Test {
 protected:
  using Json = GltfWriter::Json;

  scene::Scene load(const char* name = "test.gltf") {
    gltf.save(directory / name);
    set::Set set = a_set;
    object.file = directory / name;
    set.objects.insert(set.objects.begin(), object);
    return scene::load_scene(set);
  }

  // A root node with a mesh of one primitive.
  void add_mesh(Json attributes, Json primitive = Json::object()) {
    primitive["attributes"] = std::move(attributes);
    gltf.root("a", gltf.mesh(std::move(primitive)));
  }

  Json& first_primitive() { return gltf.json["meshes"][0]["primitives"][0]; }

  // An entry of "images" that holds a PNG.
  static Json image_of(const std::vector<unsigned char>& png) {
    return {{"uri", "data:image/png;base64," + base64(png)}};
  }

  // The message of the previz::Error that loading throws; "" where it loads.
  std::string error(const char* name = "test.gltf") {
    return test::error_of([&] { load(name); });
  }

  // The same with one value of the JSON, given by its JSON pointer, set to another for this time.
  std::string error_with(const std::string& pointer, const Json& value) {
    const Json sound = gltf.json;
    gltf.json[Json::json_pointer(pointer)] = value;
    std::string message = error();
    gltf.json = sound;
    return message;
  }

  struct Refusal {
    std::string pointer;
    Json value;
    std::string words;  // of the message
  };
  void expect_refused(const std::vector<Refusal>& refusals) {
    for (const auto& [pointer, value, words] : refusals)
      EXPECT_THAT(error_with(pointer, value), HasSubstr(words)) << pointer << ": " << value;
  }

  // Makes "go", an animation of one property of a node, the only one of the file and the object's.
  void animate(int node, const char* path, const std::vector<float>& times_s, int output) {
    Json animation = gltf.animation(node, path, times_s, output);
    animation["name"] = object.animation = "go";
    gltf.json["animations"] = Json::array({animation});
  }

  // The state of the set at a time of the animation.
  static session::SceneState state_at(double animation_s) {
    session::SceneState state;
    state.animation_s = animation_s;
    return state;
  }

  test::TemporaryDirectory directory;
  GltfWriter gltf;
  set::Object object;  // loaded with the file that load() writes
  set::Set a_set;      // its further objects and lights come after
};

}  // namespace previz::test
