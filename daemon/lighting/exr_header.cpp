#include "daemon/lighting/exr_header.hpp"

#include <ImathBox.h>

#include <cstdint>
#include <fstream>
#include <string>

#include "daemon/lighting/linear_picture.hpp"
#include "drivers/error.hpp"

namespace previz::lighting {

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
    if (size < 0 || size > bytes - begin)
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
