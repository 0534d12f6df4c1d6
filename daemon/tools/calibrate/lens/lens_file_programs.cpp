// The programs whose lens files are known by their content, in one table: how each is known, and
// what reads it or, where it is refused, how its numbers are converted.
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "daemon/tools/calibrate/lens/lens_file_formats.hpp"

namespace previz::calibrate::lens_formats {
namespace {

struct Program {
  const char* what;                  // it is; of one that is read, its format
  char begins;                       // '<' or '{'; 0: anything
  std::array<const char*, 2> marks;  // the text has both; one ending in " {" is a node's name
  std::vector<FileCamera> (*read)(std::string_view text, const std::string& file);
  const char* words;  // of the refusal
};

// Nuke's and 3DEqualizer's distortion is defined from the distorted picture to the undistorted one,
// in units of the film back, which OpenCV's models do not express.
constexpr const char* instead =
    "export an OpenCV-like model from there, or measure the lens with \"previz calibrate "
    "observer\" from pictures of a chessboard";
constexpr const char* of_a_lens =
    "it describes a kind of lens, relative to a film size, and not your camera's focal length and "
    "centre in px; measure the lens with \"previz calibrate observer\" from pictures of a "
    "chessboard";
constexpr const char* camchain =
    "give the camchain that Kalibr writes beside it, which has every digit: camchain.yaml beside "
    "results-cam.txt, NAME-camchain.yaml beside NAME-results-cam.txt, and camchain-imucam.yaml "
    "beside results-imucam.txt";
// RealityCapture's help ("XMP Camera Math", "Camera Geometry in RealityScan").
constexpr const char* reality_capture =
    "export the alignment as COLMAP's text format, and give its cameras.txt; who types the "
    "numbers: "
    "fx and fy are the focal length (FocalLength35mm, f) times the picture's longer side / 36, the "
    "principal point (PrincipalPointU and V, px and py) counts from the picture's centre in longer "
    "sides (multiply by that side, and add width/2 - 0.5 or height/2 - 0.5), and the coefficients "
    "are k1, k2, k3, k4, t1, t2: OpenCV's lens has no such k4, and t1 and t2 must be 0";
// AliceVision's sfmDataIO (CHANGES.md of its file versions, jsonIO.cpp, colmap.cpp).
constexpr const char* meshroom =
    "convert it with Meshroom's node ExportColmap, and give its cameras.txt; who types the "
    "numbers: "
    "the focal length in px is pxFocalLength, or focalLength times width / sensorWidth; "
    "principalPoint counts from the picture's centre since file version 1.2.1 (add width/2 - 0.5 "
    "or height/2 - 0.5), and from its corner before (subtract 0.5); the distortionParams of "
    "radialk3 are k1, k2, k3, those of brown k1, k2, k3, t1, t2, where OpenCV has k1, k2, p1, p2, "
    "k3";
// OpenSfM's documentation ("Geometric Models").
constexpr const char* opensfm =
    "write it as OpenCV's YAML: fx and fy are the focal length times the picture's longer side, "
    "c_x "
    "and c_y count from the picture's centre in longer sides (multiply by that side, and add "
    "(width - 1)/2 or (height - 1)/2), and k1, k2, p1, p2, k3 are OpenCV's, in this order";
// OpenMVG's documentation ("cameras") and Camera_Pinhole_Brown.hpp.
constexpr const char* openmvg =
    "write it as OpenCV's YAML: focal_length and principal_point are in px, disto_k3 is k1, k2, k3 "
    "and disto_t2 is k1, k2, k3, t1, t2, where OpenCV has k1, k2, p1, p2, k3";
// Pix4D's help ("How are the internal and external camera parameters defined").
constexpr const char* pix4d =
    "write it as OpenCV's YAML: fx is the focal length in mm times the picture's width / the "
    "sensor "
    "width in mm, and so are cx and cy of the principal point (subtract 0.5); R1, R2, R3, T1, T2 "
    "are k1, k2, k3, p1, p2, where OpenCV has k1, k2, p1, p2, k3";
constexpr const char* realsense_text =
    "write the stream's numbers as OpenCV's YAML if its model is Brown Conrady or its coefficients "
    "are 0 (PPX and PPY are cx and cy): those of Inverse Brown Conrady lead from the distorted "
    "picture to the undistorted one, and are not OpenCV's";

constexpr Program programs[] = {
    {"Metashape's camera XML", '<', {"<calibration", "<f>"}, read_metashape, nullptr},
    {"Metashape's camera XML", '<', {"<calibration", "<projection>"}, read_metashape, nullptr},
    {"Metashape's camera XML", '<', {"<document", "<sensor "}, read_metashape, nullptr},
    {"nerfstudio's transforms.json", '{', {"\"fl_x\"", ""}, read_transforms, nullptr},
    {"nerfstudio's transforms.json", '{', {"\"camera_angle_x\"", ""}, read_transforms, nullptr},
    {"RealSense's JSON", '{', {"\"ppx\"", "\"ppy\""}, read_realsense, nullptr},
    {"a lens of RealSense as text", 0, {"PPX:", "Intrinsic"}, nullptr, realsense_text},
    {"a lens of 3DEqualizer", 0, {"LD_3DE", ""}, nullptr, instead},
    {"a lens of 3DEqualizer", 0, {"3DE4 Radial", ""}, nullptr, instead},
    {"a lens of 3DEqualizer", 0, {"3DE4 Anamorphic", ""}, nullptr, instead},
    {"a lens of 3DEqualizer", 0, {"3DE Classic LD Model", ""}, nullptr, instead},
    {"a LensDistortion node of Nuke", 0, {"LensDistortion {", ""}, nullptr, instead},
    {"a LensDistortion2 node of Nuke", 0, {"LensDistortion2 {", ""}, nullptr, instead},
    {"a lens of PFTrack", 0, {"PFBarrel {", ""}, nullptr, instead},
    {"a lens of PFTrack", 0, {"PFTrack", "istortion"}, nullptr, instead},
    {"a lens of SynthEyes", 0, {"SynthEyes", "istortion"}, nullptr, instead},
    {"Kalibr's report", 0, {"Calibration results", "Camera-system parameters"}, nullptr, camchain},
    {"Kalibr's report", 0, {"Calibration results", "Normalized Residuals"}, nullptr, camchain},
    {"a camera of RealityCapture", 0, {"xcr:", "FocalLength35mm"}, nullptr, reality_capture},
    {"a table of cameras of RealityCapture", 0, {"#name,", ",f,"}, nullptr, reality_capture},
    {"a project of Meshroom", '{', {"\"intrinsics\"", "\"principalPoint\""}, nullptr, meshroom},
    {"a camera of OpenSfM", 0, {"\"projection_type\"", "\"focal"}, nullptr, opensfm},
    {"a project of OpenMVG", '{', {"\"sfm_data_version\"", ""}, nullptr, openmvg},
    {"a camera of Pix4D", 0, {"Pix4D", "assuming a sensor width"}, nullptr, pix4d},
    {"a database of Lensfun", '<', {"<lensdatabase", ""}, nullptr, of_a_lens},
    {"a lens profile of Adobe", '<', {"stCamera:", ""}, nullptr, of_a_lens},
};

// Returns whether the text has a node of this name: a word of its own, before "{".
bool has_node(std::string_view text, std::string_view name) {
  for (std::size_t at = text.find(name); at != text.npos; at = text.find(name, at + 1)) {
    const std::size_t next = text.find_first_not_of(" \t\r\n", at + name.size());
    if ((at == 0 || text[at - 1] == '\n' || text[at - 1] == ' ') && next != text.npos &&
        text[next] == '{')
      return true;
  }
  return false;
}

bool has(std::string_view text, std::string_view mark) {
  return mark.ends_with(" {") ? has_node(text, mark.substr(0, mark.size() - 2))
                              : text.find(mark) != text.npos;
}

bool is_of(const Program& program, std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (program.begins && (first == text.npos || text[first] != program.begins)) return false;
  return std::ranges::all_of(program.marks, [&](const char* mark) { return has(text, mark); });
}

}  // namespace

std::optional<LensFile> read_by_program(std::string_view text, const std::string& file) {
  for (const Program& program : programs)
    if (program.read && is_of(program, text))
      return LensFile{program.what, program.read(text, file), {}};
  return std::nullopt;
}

void refuse_by_program(std::string_view text, const std::string& file) {
  for (const Program& program : programs)
    if (!program.read && is_of(program, text))
      fail_at({file, 0, ""},
              fmt::format("is {}, which is not supported; {}", program.what, program.words));
}

}  // namespace previz::calibrate::lens_formats
