#include "daemon/model/scan_read.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "daemon/model/scan_fbx.hpp"
#include "daemon/model/scan_gltf.hpp"
#include "daemon/model/scan_obj.hpp"
#include "daemon/model/scan_ply.hpp"
#include "daemon/model/scan_stl.hpp"
#include "daemon/model/scan_surface.hpp"
#include "daemon/model/scan_text.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

FoundSurface found_in(const std::filesystem::path& path, ScanTextures* textures, ScanFile& file) {
  const std::string extension = in_lower_case(path.extension().string());
  if (extension == ".obj") return read_obj(path, scan_bytes(path), textures);
  if (extension == ".ply") return read_ply(path, scan_bytes(path), textures);
  if (extension == ".stl") return read_stl(path, scan_bytes(path));
  if (extension == ".fbx") return read_fbx(path, textures, file);
  return read_gltf_scan(path, textures, file);
}

}  // namespace

ScanFile read_scan(const std::filesystem::path& path, Colouring colouring) {
  constexpr std::array formats{".obj", ".ply", ".stl", ".fbx", ".gltf", ".glb"};
  if (std::ranges::find(formats, in_lower_case(path.extension().string())) == formats.end())
    throw Error(path.string() + ": is not a scan; allowed: .obj, .ply, .stl, .fbx, .gltf, .glb");
  if (!std::filesystem::is_regular_file(path)) throw Error(path.string() + ": file not found");
  ScanTextures textures(path);
  ScanFile file;
  take_surface(path, found_in(path, colouring == Colouring::read ? &textures : nullptr, file),
               colouring, file);
  file.colours.pictures = textures.take();
  file.notes.insert(file.notes.end(), textures.notes().begin(), textures.notes().end());
  return file;
}

}  // namespace previz::model
