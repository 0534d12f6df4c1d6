#include "daemon/core/scene/other_format.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

#include "drivers/error.hpp"
#include "drivers/letters.hpp"

namespace previz::scene {
namespace {

using namespace std::string_view_literals;

// What can be done with a file.
enum class Way {
  blender,     // opens it
  own_program  // can export it, and Blender does not open it
};

// A format by bytes that its files have at an offset, or anywhere near their beginning; and by the
// endings of their names, where the bytes say nothing.
struct Format {
  std::string_view name;
  Way way;
  std::string_view bytes;
  std::string_view endings;  // each with a point before and after it
  std::size_t offset = 0;
};
constexpr std::size_t anywhere = ~std::size_t{0};  // in the first kilobyte

constexpr std::array formats = {
    Format{"an FBX file", Way::blender, "Kaydara FBX Binary", ".fbx."},
    Format{"an FBX file", Way::blender, "; FBX", ""},
    Format{"a USD file", Way::blender, "#usda", ".usda.usd.usdc."},
    Format{"a USD file", Way::blender, "PXR-USDC", ""},
    Format{"a COLLADA file", Way::blender, "<COLLADA", ".dae.", anywhere},
    Format{"an X3D file", Way::blender, "<X3D", ".x3d.", anywhere},
    Format{"an X3D file", Way::blender, "#X3D", ".x3dv."},
    Format{"a VRML file", Way::blender, "#VRML", ".wrl.vrml."},
    Format{"an Alembic file", Way::blender, "Ogawa", ".abc."},
    Format{"a PLY file", Way::blender, "ply\n", ".ply."},
    Format{"a PLY file", Way::blender, "ply\r", ""},
    Format{"a Blender file", Way::blender, "BLENDER", ".blend."},
    Format{"a Maya file", Way::own_program, "//Maya", ".ma.mb."},
    Format{"a Cinema 4D file", Way::own_program, "QC4DC4D6", ".c4d."},
    Format{"a LightWave object", Way::own_program, "LWO", ".lwo.lws.", 8},
    Format{"a STEP file", Way::own_program, "ISO-10303-21", ".step.stp."},
    Format{"an IGES file", Way::own_program, "", ".iges.igs."},
    Format{"a Rhino file", Way::own_program, "3D Geometry File Format", ".3dm."},
    Format{"a 3ds Max file", Way::own_program, "", ".max."},
    Format{"a 3DS file", Way::own_program, "", ".3ds."},
    Format{"a SketchUp file", Way::own_program, "\xff\xfe\xff\x0eS\0k\0e\0t\0c\0h"sv, ".skp."},
    Format{"a Houdini file", Way::own_program, "", ".hip.hipnc.hiplc.bgeo."},
    Format{"a ZBrush file", Way::own_program, "", ".ztl.zpr."},
    Format{"a Modo file", Way::own_program, "LXO", ".lxo.", 8},
    Format{"a DXF file", Way::own_program, "", ".dxf."},
    Format{"a DWG file", Way::own_program, "AC10", ".dwg."},
    Format{"a 3MF file", Way::own_program, "", ".3mf."},
    Format{"a bare Draco mesh", Way::own_program, "DRACO", ".drc."},
    Format{"a USDZ file", Way::blender, "", ".usdz."},
    Format{"an OBJ file", Way::blender, "\nmtllib ", ".obj.", anywhere},
    Format{"an OBJ file", Way::blender, "\nv ", "", anywhere},
    Format{"an OBJ file", Way::blender, "mtllib ", ""},
    Format{"an OBJ file", Way::blender, "v ", ""},
    Format{"an STL file", Way::blender, "solid", ".stl."},
};

// A file that is named in the place of a scene by mistake, with what to do about it.
struct Mistake {
  std::string_view bytes, what;
  std::size_t offset = 0;
};
constexpr std::array mistakes = {
    Mistake{"<!doctype html", "a web page: download the file itself"},
    Mistake{"<html", "a web page: download the file itself"},
    Mistake{"version https://git-lfs", "a pointer of Git LFS: fetch the file by \"git lfs pull\""},
    Mistake{"\xff\xfe{", "text in UTF-16; save or export it as UTF-8"},
    Mistake{"\xfe\xff\0{"sv, "text in UTF-16; save or export it as UTF-8"},
    Mistake{"\x89PNG", "a picture (PNG); an object is glTF 2.0 (.glb or .gltf)"},
    Mistake{"\xff\xd8\xff", "a picture (JPEG); an object is glTF 2.0 (.glb or .gltf)"},
};
constexpr std::array packed = {
    Mistake{"PK\3\4", "a ZIP archive: unpack it, and name the .glb or .gltf file in it"},
    Mistake{"Rar!", "a RAR archive: unpack it, and name the .glb or .gltf file in it"},
    Mistake{"7z\xbc\xaf", "a 7z archive: unpack it, and name the .glb or .gltf file in it"},
    Mistake{"\x1f\x8b", "compressed by gzip: unpack it by \"gunzip\""},
    Mistake{"\x28\xb5\x2f\xfd", "compressed by Zstandard: unpack it by \"unzstd\""},
};

bool has_bytes(std::string_view head, std::string_view bytes, std::size_t offset) {
  if (bytes.empty()) return false;
  if (offset == anywhere) return head.find(bytes) != std::string_view::npos;
  return head.size() >= offset && head.substr(offset).starts_with(bytes);
}

const Format* find_by_ending(const std::string& file) {
  const std::string ending = lower_case(std::filesystem::path(file).extension().string());
  if (ending.empty()) return nullptr;
  const auto* const found = std::ranges::find_if(formats, [&](const Format& format) {
    return format.endings.find(ending + ".") != std::string_view::npos;
  });
  return found == formats.end() ? nullptr : found;
}

[[noreturn]] void refuse(const Format& format, const std::string& file) {
  std::string message = file + ": is ";
  message.append(format.name).append("; an object is glTF 2.0 (.glb or .gltf): export it as that");
  throw Error(message + (format.way == Way::blender ? ", or open it in Blender and export it"
                                                    : " from the program that it was made in"));
}

template <std::size_t count>
void refuse_mistake(const std::array<Mistake, count>& mistakes_of_a_kind, std::string_view head,
                    const std::string& file) {
  for (const Mistake& mistake : mistakes_of_a_kind)
    if (has_bytes(head, mistake.bytes, mistake.offset))
      throw Error(file + ": is " + std::string(mistake.what));
}

}  // namespace

void refuse_other_format(std::span<const unsigned char> bytes, const std::string& file) {
  constexpr std::size_t looked_at = 1024;
  std::string_view head(reinterpret_cast<const char*>(bytes.data()),
                        std::min(bytes.size(), looked_at));
  if (head.starts_with("\xef\xbb\xbf")) head.remove_prefix(3);
  head.remove_prefix(std::min(head.find_first_not_of(" \t\r\n"), head.size()));
  refuse_mistake(mistakes, head, file);
  refuse_mistake(mistakes, lower_case(head), file);
  for (const Format& format : formats)
    if (has_bytes(head, format.bytes, format.offset)) refuse(format, file);
  if (const Format* format = find_by_ending(file)) refuse(*format, file);
  refuse_mistake(packed, head, file);
}

std::string format_by_ending(const std::string& file) {
  const Format* const format = find_by_ending(file);
  return format ? std::string(format->name) : std::string();
}

}  // namespace previz::scene
