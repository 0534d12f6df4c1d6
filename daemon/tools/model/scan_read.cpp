#include "daemon/tools/model/scan_read.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "daemon/core/scene/other_format.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/tools/model/scan_fbx.hpp"
#include "daemon/tools/model/scan_gltf.hpp"
#include "daemon/tools/model/scan_obj.hpp"
#include "daemon/tools/model/scan_ply.hpp"
#include "daemon/tools/model/scan_stl.hpp"
#include "daemon/tools/model/scan_surface.hpp"
#include "daemon/tools/model/scan_text.hpp"
#include "drivers/error.hpp"
#include "drivers/letters.hpp"

namespace previz::model {
namespace {

// Returns the ending of a file's name, or that of the format that its first bytes are of.
std::string ending_by_content(const std::filesystem::path& path) {
  const std::string head = session::read_beginning(path, 18);
  if (head.starts_with("ply\n") || head.starts_with("ply\r")) return ".ply";
  if (head == "Kaydara FBX Binary") return ".fbx";
  if (head.starts_with("glTF")) return ".glb";
  return lower_case(path.extension().string());
}

FoundSurface found_in(const std::filesystem::path& path, ScanTextures* textures, ScanFile& file) {
  const std::string extension = ending_by_content(path);
  if (extension == ".obj") return read_obj(path, scan_bytes(path), textures);
  if (extension == ".ply") return read_ply(path, scan_bytes(path), textures);
  if (extension == ".stl") return read_stl(path, scan_bytes(path));
  if (extension == ".fbx") return read_fbx(path, textures, file);
  return read_gltf_scan(path, textures, file);
}

// Phones give scans as USDZ, laser scanners as clouds of points.
[[noreturn]] void refuse_ending(const std::filesystem::path& path, const std::string& ending) {
  constexpr std::array clouds{".e57", ".las", ".laz", ".pcd", ".ptx", ".pts", ".xyz"};
  const std::string allowed = "; allowed: .obj, .ply, .stl, .fbx, .gltf, .glb";
  if (std::ranges::find(clouds, ending) != clouds.end())
    throw Error(path.string() +
                ": is a cloud of points; make a mesh of it, in CloudCompare for "
                "example" +
                allowed);
  const std::string format = scene::format_by_ending(path.string());
  throw Error(path.string() + ": is " +
              (format.empty() ? "not a scan"
                              : format + "; export the scan in another format, or convert it, in "
                                         "Blender for example") +
              allowed);
}

}  // namespace

ScanFile read_scan(const std::filesystem::path& path, Colouring colouring) {
  constexpr std::array formats{".obj", ".ply", ".stl", ".fbx", ".gltf", ".glb"};
  const std::string ending = lower_case(path.extension().string());
  if (std::ranges::find(formats, ending) == formats.end()) refuse_ending(path, ending);
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
