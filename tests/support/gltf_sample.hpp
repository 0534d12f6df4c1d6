// A glTF file with a bit of everything that the loader reads, for tests that damage it.
#pragma once

#include "tests/support/gltf_writer.hpp"

namespace previz::test {

GltfWriter gltf_sample();

}  // namespace previz::test
