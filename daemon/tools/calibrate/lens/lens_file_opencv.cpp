// Files of OpenCV's FileStorage and of programs that name things as it does, and ROS's camera_info
// (sensor_msgs/CameraInfo; the YAML files of camera_calibration_parsers).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>

#include "daemon/tools/calibrate/lens/lens_file_formats.hpp"
#include "drivers/keys/value.hpp"

namespace previz::calibrate::lens_formats {
namespace {

// Spellings differ in capitals and in "_": camera_matrix, cameraMatrix, Camera_Matrix.
constexpr std::array matrix_names = {"cameramatrix", "intrinsicmatrix", "mtx", "k", "m"};
constexpr std::array coefficient_names = {"distortioncoefficients",
                                          "distortioncoeffs",
                                          "distcoeffs",
                                          "distcoeff",
                                          "distortion",
                                          "dist",
                                          "d"};
constexpr std::array width_names = {"imagewidth", "width", "imgwidth"};
constexpr std::array height_names = {"imageheight", "height", "imgheight"};
constexpr std::array size_names = {"imagesize", "size", "imgsize", "resolution"};
// Two cameras in one file: M1 and D1, cameraMatrix2 and distCoeffs2, K_left and D_left.
constexpr std::array suffixes = {"", "0", "1", "2", "3", "4", "left", "right", "l", "r"};

std::string plain_name(std::string_view key) {
  std::string name = lower(key);
  std::erase(name, '_');
  return name;
}

struct Found {
  std::string key;  // as it is spelled
  const Tree* tree = nullptr;
};

template <std::size_t N>
std::optional<Found> find_any(const Tree& map, const std::array<const char*, N>& names,
                              const std::string& suffix = "") {
  for (const char* name : names)
    for (std::size_t i = 0; i < map.keys.size(); ++i)
      if (plain_name(map.keys[i]) == name + suffix) return Found{map.keys[i], &map.children[i]};
  return std::nullopt;
}

// A short name may be anything's, such as the coefficient k1.
bool is_matrix(const Found& found) {
  if (found.key.size() > 3) return true;
  const Tree* data = found.tree->find("data");
  const std::size_t count = (data ? data : found.tree)->children.size();
  return count == 9 || count == 3;
}

std::optional<Found> find_matrix(const Tree& map, const std::string& suffix) {
  auto found = find_any(map, matrix_names, suffix);
  return found && is_matrix(*found) ? found : std::nullopt;
}

Focal focal_of(const std::vector<double>& k, const FilePlace& at) {
  if (k.size() != 9)
    fail_at(at, fmt::format("has {} numbers; allowed: 9, the rows of a 3x3 matrix", k.size()));
  if (k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1)
    fail_at(at, "is not a camera matrix; allowed: [fx, 0, cx, 0, fy, cy, 0, 0, 1]");
  if (k[1] != 0)
    fail_at(at, fmt::format("has a skew of {:g}, which previzd's lenses do not have; calibrate "
                            "again without skew (CALIB_FIX_SKEW)",
                            k[1]));
  return {k[0], k[4], k[2], k[5]};
}

Size size_of(const Tree& map, const Scope& scope, std::string& keys) {
  keys = scope.prefix + "image_width, " + scope.prefix + "image_height";
  const auto width = find_any(map, width_names), height = find_any(map, height_names);
  if (width && height) {
    keys = scope.prefix + width->key + ", " + scope.prefix + height->key;
    return {picture_side(*width->tree, scope.place(*width->tree, width->key)),
            picture_side(*height->tree, scope.place(*height->tree, height->key))};
  }
  const auto both = find_any(map, size_names);
  if (!both) return {};
  const FilePlace at = scope.place(*both->tree, both->key);
  keys = at.key;
  const Tree* data = both->tree->find("data");
  const Tree& sides = data ? *data : *both->tree;
  if (sides.children.size() != 2) fail_at(at, "is not a size; allowed: [WIDTH, HEIGHT]");
  return {picture_side(sides.children[0], at), picture_side(sides.children[1], at)};
}

struct Kind {
  bool is_fisheye = false;
  std::string name, note;
};

// ROS's names of models, REP 104 and sensor_msgs/distortion_models.
std::optional<Kind> named_kind(const Tree& map, const Scope& scope) {
  for (const char* key : {"distortion_model", "camera_model", "model", "model_type"}) {
    const Tree* model = map.find(key);
    if (!model || model->kind != Tree::Kind::word || model->word.empty()) continue;
    const std::string name = lower(model->word);
    for (const char* fisheye :
         {"equidistant", "fisheye", "kannala_brandt", "kannala_brandt4", "opencv_fisheye", "kb4"})
      if (name == fisheye) return Kind{true, name, ""};
    for (const char* pinhole : {"plumb_bob", "rational_polynomial", "radtan", "pinhole", "opencv",
                                "full_opencv", "brown_conrady", "none"})
      if (name == pinhole) return Kind{false, name, ""};
    fail_at(scope.place(*model, key),
            fmt::format("\"{}\" is not supported; allowed: plumb_bob, rational_polynomial, "
                        "equidistant, fisheye; calibrate again with one of these",
                        printable(model->word)));
  }
  return std::nullopt;
}

Kind kind_of(const Tree& map, std::string_view text, std::size_t coefficients, const Scope& scope) {
  if (const auto flag = find_any(map, std::array{"fisheyemodel", "usefisheye"}))
    return flag->tree->word == "1" || lower(flag->tree->word) == "true"
               ? Kind{true, "fisheye", ""}
               : Kind{false, "pinhole", ""};
  if (auto named = named_kind(map, scope)) return *named;
  if (coefficients != 4) return {false, "pinhole", ""};
  if (lower(text).find("fisheye") != std::string::npos)
    return {true, "fisheye",
            "assumed: the word fisheye is in the file, so that the 4 coefficients are k1 to k4 of "
            "OpenCV's fisheye (if they are k1, k2, p1, p2, add fisheye_model: 0 to the file)"};
  return {false, "pinhole",
          "assumed: nothing in the file says fisheye, so that the 4 coefficients are k1, k2, p1, "
          "p2 (if they are of OpenCV's fisheye, add fisheye_model: 1 to the file)"};
}

// The rectified lens of a camera_info whose K is not there: the left 3x3 part of P.
std::optional<FileLens> rectified_lens(const Tree& map, const Scope& scope) {
  const auto p = find_any(map, std::array{"projectionmatrix", "p"});
  if (!p) return std::nullopt;
  const FilePlace at = scope.place(*p->tree, p->key);
  const std::vector<double> all = numbers(*p->tree, at);
  if (all.size() != 12) fail_at(at, fmt::format("has {} numbers; allowed: 12", all.size()));
  const Focal focal =
      focal_of({all[0], all[1], all[2], all[4], all[5], all[6], all[8], all[9], all[10]}, at);
  std::string size_keys;
  const Size size = size_of(map, scope, size_keys);
  FileLens lens = pinhole_lens(focal, at, {}, at, size);
  lens.size_keys = size_keys;
  lens.model = "rectified";
  lens.notes.push_back(
      "the file has the lens of rectified pictures alone (projection_matrix): use it with "
      "rectified pictures (image_rect) only");
  return lens;
}

void note_region(const Tree& map, std::vector<std::string>& notes) {
  const Tree* roi = map.find("roi");
  const auto is_set = [](const Tree* tree) {
    return tree && tree->kind == Tree::Kind::word && number_of(tree->word) > 1;
  };
  if (is_set(map.find("binning_x")) || is_set(map.find("binning_y")) ||
      (roi && is_set(roi->find("width"))))
    notes.push_back(
        "warning: the file gives binning or a region of interest (roi), which are ignored: the "
        "lens is that of the camera's full picture");
}

FileLens opencv_lens(const Tree& map, std::string_view text, const std::string& suffix,
                     const Scope& scope) {
  const auto matrix = find_matrix(map, suffix);
  const auto given = find_any(map, coefficient_names, suffix);
  const FilePlace at = matrix ? scope.place(*matrix->tree, matrix->key) : FilePlace{};
  const std::vector<double> k = matrix ? numbers(*matrix->tree, at) : std::vector<double>{};
  const bool is_uncalibrated = std::ranges::all_of(k, [](double value) { return value == 0; });
  if (is_uncalibrated)
    if (auto rectified = rectified_lens(map, scope)) return *rectified;
  if (is_uncalibrated) fail_at(at, "is 0, as of a camera that is not calibrated; calibrate it");
  if (!given)
    fail_at(scope.place(map, "distortion_coefficients"),
            "is missing; write the lens's, or an empty list if its pictures are undistorted");
  const FilePlace of = scope.place(*given->tree, given->key);
  const std::vector<double> coefficients = numbers(*given->tree, of);
  const Kind kind = kind_of(map, text, coefficients.size(), scope);
  std::string size_keys;
  const Size size = size_of(map, scope, size_keys);
  const bool is_fisheye = kind.is_fisheye && !coefficients.empty();
  FileLens lens = is_fisheye ? fisheye_lens(focal_of(k, at), at, coefficients, of, size)
                             : pinhole_lens(focal_of(k, at), at, coefficients, of, size);
  lens.model =
      is_fisheye ? kind.name : fmt::format("{}, {} coefficients", kind.name, coefficients.size());
  lens.size_keys = size_keys;
  if (!kind.note.empty()) lens.notes.push_back(kind.note);
  if (coefficients.empty())
    lens.notes.push_back(of.key +
                         " is empty: the lens is without distortion, as of rectified pictures; use "
                         "it with those only");
  note_region(map, lens.notes);
  return lens;
}

void add_cameras(const Tree& map, std::string_view text, const Scope& scope,
                 std::vector<FileCamera>& cameras) {
  for (const char* suffix : suffixes) {
    const auto matrix = find_matrix(map, suffix);
    if (!matrix && (*suffix || !find_any(map, std::array{"projectionmatrix"}))) continue;
    std::string name = scope.prefix + (*suffix ? matrix->key : "");
    if (name.ends_with('.')) name.pop_back();
    cameras.push_back(camera_of(name, [&] { return opencv_lens(map, text, suffix, scope); }));
  }
}

}  // namespace

bool is_ros(const Tree& root) {
  return root.find("distortion_model") || root.find("projection_matrix") || root.find("P");
}

std::vector<FileCamera> read_opencv(const Tree& root, std::string_view text,
                                    const std::string& file) {
  std::vector<FileCamera> cameras;
  add_cameras(root, text, {file, ""}, cameras);
  if (!cameras.empty() || root.kind != Tree::Kind::map) return cameras;
  for (std::size_t i = 0; i < root.keys.size(); ++i)  // as {"left": {...}, "right": {...}}
    add_cameras(root.children[i], text, {file, printable(root.keys[i]) + "."}, cameras);
  return cameras;
}

}  // namespace previz::calibrate::lens_formats
