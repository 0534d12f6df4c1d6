#include "daemon/core/lighting/exr_header.hpp"

#include <ImathBox.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <istream>
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

// Returns where OpenEXR (3.1) takes the end of a value to be that begins here: it counts the
// channels of a list and the pixels of a preview, whatever size is stated before. What it would
// then take for the next attribute is no attribute.
std::int64_t end_of_value(std::istream& file, std::string_view type, std::int64_t size) {
  const std::int64_t begin = file.tellg();
  if (type == "chlist") {
    constexpr std::int64_t bytes_of_channel = 16;  // behind its name
    std::string name;
    while (std::getline(file, name, '\0') && !name.empty()) file.ignore(bytes_of_channel);
    return file.tellg();
  }
  if (type == "preview") {
    std::array<std::uint32_t, 2> side{};
    file.read(reinterpret_cast<char*>(side.data()), sizeof side);
    if (std::max(side[0], side[1]) > size) return -1;
    return begin + std::int64_t{sizeof side} + std::int64_t{4} * side[0] * side[1];
  }
  return begin + size;
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
    if (size < 0 || size > bytes - begin || !has_its_size(type, size) ||
        end_of_value(file, type, size) != begin + size)
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
