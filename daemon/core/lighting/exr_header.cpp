#include "daemon/core/lighting/exr_header.hpp"

#include <ImathBox.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>
#include <utility>

#include "daemon/core/lighting/linear_picture.hpp"
#include "drivers/error.hpp"

namespace previz::lighting {
namespace {

// Bytes of the types that have one size (OpenEXR, "Predefined Attribute Types").
constexpr std::array<std::pair<std::string_view, std::int32_t>, 23> sizes = {
    {{"box2i", 16},      {"box2f", 16},   {"chromaticities", 32},
     {"compression", 1}, {"double", 8},   {"envmap", 1},
     {"float", 4},       {"int", 4},      {"keycode", 28},
     {"lineOrder", 1},   {"m33f", 36},    {"m33d", 72},
     {"m44f", 64},       {"m44d", 128},   {"rational", 8},
     {"tiledesc", 9},    {"timecode", 8}, {"v2i", 8},
     {"v2f", 8},         {"v2d", 16},     {"v3i", 12},
     {"v3f", 12},        {"v3d", 24}}};

bool has_its_size(const std::string& type, std::int32_t size) {
  const auto found =
      std::ranges::find(sizes, type, &std::pair<std::string_view, std::int32_t>::first);
  return found == sizes.end() || found->second == size;
}

}  // namespace

void check_exr_header(const std::filesystem::path& path) {
  const auto bytes = static_cast<std::int64_t>(std::filesystem::file_size(path));
  std::ifstream file(path, std::ios::binary);
  file.seekg(8);  // the magic number and the version
  std::string name, type;
  while (std::getline(file, name, '\0') && !name.empty() && std::getline(file, type, '\0')) {
    std::int32_t size = 0;
    file.read(reinterpret_cast<char*>(&size), sizeof size);
    const std::int64_t begin = file.tellg();
    if (!file || begin < 0) return;
    if (size < 0 || size > bytes - begin || !has_its_size(type, size))
      throw Error(path.string() +
                  ": cannot be read as OpenEXR: its header is damaged, or its end is missing; copy "
                  "or export it again");
    if (name == "dataWindow" && size == sizeof(Imath::Box2i)) {
      Imath::Box2i window;
      file.read(reinterpret_cast<char*>(&window), sizeof window);
      check_size(path, std::int64_t{window.max.x} - window.min.x + 1,
                 std::int64_t{window.max.y} - window.min.y + 1);
    }
    file.seekg(begin + size);
  }
}

}  // namespace previz::lighting
