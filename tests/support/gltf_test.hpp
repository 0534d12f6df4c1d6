// A glTF file that a test writes and loads as the only object of a set.
#pragma once

#include "daemon/scene/load.hpp"
#include "daemon/scene/scene.hpp"
#include "daemon/set/set.hpp"
#include "tests/support/gltf_writer.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

class GltfTest : public ::testing::Test {
 protected:
  scene::Scene load(const char* name = "test.gltf") {
    gltf.save(directory / name);
    set::Set set = a_set;
    object.file = directory / name;
    set.objects.insert(set.objects.begin(), object);
    return scene::load_scene(set);
  }

  // The message of the previz::Error that loading throws; "" where it loads.
  std::string error(const char* name = "test.gltf") {
    return test::error_of([&] { load(name); });
  }

  test::TemporaryDirectory directory;
  GltfWriter gltf;
  set::Object object;  // loaded with the file that load() writes
  set::Set a_set;      // its further objects and lights come after
};

}  // namespace previz::test
