// Lenses that name each number: Agisoft Metashape's camera XML, nerfstudio's and instant-ngp's
// transforms.json, and RealSense's intrinsics as JSON.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "daemon/tools/calibrate/lens/lens_file_formats.hpp"
#include "drivers/keys/value.hpp"

namespace previz::calibrate::lens_formats {
namespace {

constexpr const char* from_a_board =
    "calibrate again without it, or measure the lens with \"previz calibrate observer\" from "
    "pictures of a chessboard";

// The numbers of one map, by their keys.
struct Numbers {
  const Tree& map;
  Scope scope;

  FilePlace place(const char* key) const {
    const Tree* found = map.find(key);
    return scope.place(found ? *found : map, key);
  }
  bool has(const char* key) const { return map.find(key) != nullptr; }
  double at(const char* key) const {
    const Tree* found = map.find(key);
    if (!found) fail_at(place(key), "is missing; export the calibration again");
    const double value = number_of(found->kind == Tree::Kind::word ? found->word : "");
    if (!std::isfinite(value))
      fail_at(place(key), fmt::format("\"{}\" is not a finite number; correct the file, or "
                                      "calibrate again",
                                      printable(found->word)));
    return value;
  }
  double or_else(const char* key, double other) const { return has(key) ? at(key) : other; }
  std::string word(const char* key) const {
    const Tree* found = map.find(key);
    return found ? found->word : "";
  }
  // Returns 0 x 0 if there is no size.
  Size size(const char* width, const char* height) const {
    if (!has(width) || !has(height)) return {};
    return {picture_side(*map.find(width), place(width)),
            picture_side(*map.find(height), place(height))};
  }
  void must_be_zero(const char* key, const char* why) const {
    if (const double value = or_else(key, 0); value != 0)
      fail_at(place(key), fmt::format("is {:g}, {}; {}", value, why, from_a_board));
  }
};

// -- Metashape ("Metashape User Manual", appendix on camera models, frame cameras):
//   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + p1 (r^2 + 2 x^2) + 2 p2 x y
//   y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + p2 (r^2 + 2 y^2) + 2 p1 x y
//   u = width / 2 + cx + x' f + x' b1 + y' b2,   v = height / 2 + cy + y' f
// where (0,0) is the corner of the first pixel.

constexpr double most_skew_px = 0.1;

// Refuses a skew that moves the upper or lower edge of the picture by more than most_skew_px.
void check_skew(const Numbers& numbers, const Size& size, double f,
                std::vector<std::string>& notes) {
  const double b2 = numbers.or_else("b2", 0);
  const double moved = std::abs(b2) * size.height / (2 * f);
  if (!(moved <= most_skew_px))
    fail_at(
        numbers.place("b2"),
        fmt::format("a skew of {:g} moves the picture's edge by {:.3g} px, and previzd's lenses "
                    "have none; allowed: {:g} px; calibrate again without b2",
                    b2, moved, most_skew_px));
  if (b2 != 0)
    notes.push_back(fmt::format(
        "the skew b2 is ignored: it moves the picture's edge by {:.2g} px only", moved));
}

FileLens metashape_lens(const Tree& calibration, const Tree& sensor, const Scope& scope) {
  const Numbers numbers{calibration, scope};
  const char* kind = numbers.has("projection") ? "projection" : "type";
  const std::string projection = numbers.word(kind);
  if (!projection.empty() && projection != "frame")
    fail_at(
        numbers.place(kind),
        fmt::format("Metashape's \"{}\" is not supported; allowed: frame; measure the lens with "
                    "\"previz calibrate light\" from pictures of a board",
                    printable(projection)));
  if (numbers.has("fx"))
    fail_at(numbers.place("fx"),
            "is PhotoScan's form before 1.2, whose tangential terms are not documented; open the "
            "project in Metashape, and save the calibration from there");
  const Tree* resolution = calibration.find("resolution");
  if (!resolution) resolution = sensor.find("resolution");
  const Size size = Numbers{resolution ? *resolution : calibration, scope}.size("width", "height");
  if (size.width == 0)
    fail_at(numbers.place("width"), "is missing; Metashape writes it into every calibration");
  numbers.must_be_zero("k4", "and OpenCV's lenses have no term k4 r^8");
  for (const char* key : {"p3", "p4"})
    numbers.must_be_zero(key, "and OpenCV's lenses have two tangential terms");
  const double f = numbers.at("f");
  const Focal focal{f + numbers.or_else("b1", 0), f,
                    size.width / 2.0 + numbers.or_else("cx", 0) + corner_to_centre_px,
                    size.height / 2.0 + numbers.or_else("cy", 0) + corner_to_centre_px};
  const std::array k = {numbers.or_else("k1", 0), numbers.or_else("k2", 0),
                        numbers.or_else("p2", 0), numbers.or_else("p1", 0),
                        numbers.or_else("k3", 0)};
  FileLens lens = pinhole_lens(focal, numbers.place("f"), k, numbers.place("k1"), size);
  check_skew(numbers, size, f, lens.notes);
  lens.model = "frame";
  lens.size_keys = "width, height";
  lens.notes.push_back(
      "Metashape's numbers are converted: fx is f + b1, cx and cy count from the picture's centre "
      "(half its size less 0.5 px is added), and p1 and p2 are exchanged");
  return lens;
}

// Adds the cameras of a calibration or of a project (document, chunk, sensors, sensor).
void add_metashape(const Tree& tree, const std::string& file, std::vector<FileCamera>& cameras) {
  for (std::size_t i = 0; i < tree.keys.size(); ++i) {
    const Tree& child = tree.children[i];
    const std::string& key = tree.keys[i];
    if (key == "calibration") {
      cameras.push_back(camera_of("", [&] { return metashape_lens(child, child, {file, ""}); }));
    } else if (key == "sensor") {
      const Tree* label = child.find("label");
      const Tree* calibration = nullptr;  // the last is the adjusted one
      for (std::size_t j = 0; j < child.keys.size(); ++j)
        if (child.keys[j] == "calibration") calibration = &child.children[j];
      cameras.push_back(camera_of(label ? printable(label->word) : "", [&] {
        if (!calibration)
          fail_at({file, child.line, "sensor"},
                  "has no calibration; align the photos, and export the cameras again");
        return metashape_lens(*calibration, child, {file, ""});
      }));
    } else {
      add_metashape(child, file, cameras);
    }
  }
}

// -- nerfstudio ("Data conventions") and instant-ngp (colmap2nerf.py).

constexpr std::array pinhole_models = {"",       "SIMPLE_PINHOLE", "PINHOLE",    "SIMPLE_RADIAL",
                                       "RADIAL", "OPENCV",         "PERSPECTIVE"};
constexpr std::array lens_keys = {"camera_model", "is_fisheye", "fl_x", "fl_y", "cx",
                                  "cy",           "w",          "h",    "k1",   "k2",
                                  "k3",           "k4",         "p1",   "p2"};

bool are_same(const Tree& a, const Tree& b) {
  const double x = number_of(a.word), y = number_of(b.word);
  return std::isfinite(x) && std::isfinite(y) ? x == y : a.word == b.word;
}

// Returns the keys of the one lens that all frames have.
Tree lens_of_frames(const Tree& root, const std::string& file) {
  Tree lens;
  lens.kind = Tree::Kind::map;
  const auto add = [&](const Tree& map, const std::string& where) {
    for (const char* key : lens_keys) {
      const Tree* value = map.find(key);
      if (!value) continue;
      const Tree* known = lens.find(key);
      if (known && !are_same(*known, *value))
        fail_at({file, 0, where + key},
                fmt::format("is {}, and {} elsewhere in the file: its frames have different "
                            "lenses; give a file of the frames of one lens",
                            printable(value->word), printable(known->word)));
      if (known) continue;
      lens.keys.emplace_back(key);
      lens.children.push_back(*value);
    }
  };
  add(root, "");
  if (const Tree* frames = root.find("frames"))
    for (std::size_t i = 0; i < frames->children.size(); ++i)
      add(frames->children[i], fmt::format("frames[{}].", i));
  return lens;
}

FileLens transforms_lens(const Tree& root, const std::string& file) {
  const Tree lens_map = lens_of_frames(root, file);
  const Numbers numbers{lens_map, {file, ""}};
  if (!numbers.has("fl_x"))
    fail_at({file, 0, "fl_x"},
            "is missing: camera_angle_x alone is a field of view, without a centre or distortion; "
            "add fl_x = w / (2 tan(camera_angle_x / 2)), cx, cy, w and h, or calibrate the lens");
  std::string model = numbers.word("camera_model");
  const std::string flag = lower(numbers.word("is_fisheye"));
  if (flag == "true" || flag == "1") model = "OPENCV_FISHEYE";
  const bool is_fisheye = model == "OPENCV_FISHEYE";
  if (!is_fisheye && std::ranges::find(pinhole_models, model) == pinhole_models.end())
    fail_at(numbers.place("camera_model"),
            fmt::format("\"{}\" is not supported; allowed: OPENCV, OPENCV_FISHEYE and what they "
                        "contain; reconstruct again with one of these",
                        printable(model)));
  const FilePlace at = numbers.place("fl_x");
  const Size size = numbers.size("w", "h");
  const double fx = numbers.at("fl_x");
  const Focal focal{fx, numbers.or_else("fl_y", fx), numbers.at("cx") + corner_to_centre_px,
                    numbers.at("cy") + corner_to_centre_px};
  const auto k = [&](const char* key) { return numbers.or_else(key, 0); };
  for (const char* key : {"p1", "p2"})
    if (is_fisheye) numbers.must_be_zero(key, "and OpenCV's fisheye has no tangential terms");
  if (!is_fisheye) numbers.must_be_zero("k4", "and OpenCV's lenses have no term k4 r^8");
  FileLens lens =
      is_fisheye ? fisheye_lens(focal, at, std::array{k("k1"), k("k2"), k("k3"), k("k4")}, at, size)
                 : pinhole_lens(focal, at, std::array{k("k1"), k("k2"), k("p1"), k("p2"), k("k3")},
                                at, size);
  lens.model = model.empty() ? "OPENCV" : model;
  lens.size_keys = "w, h";
  lens.notes.push_back(
      "transforms.json has COLMAP's pixels, whose (0,0) is the corner of the first one: 0.5 px is "
      "subtracted from cx and cy");
  return lens;
}

// -- RealSense (librealsense: rs2_intrinsics and rs2_distortion in rs_types.h, and
// rs2_project_point_to_pixel in rsutil.h).

FileLens realsense_lens(const Tree& map, const Scope& scope) {
  const Numbers numbers{map, scope};
  const FilePlace at = numbers.place("ppx");
  const Focal focal{numbers.at("fx"), numbers.at("fy"), numbers.at("ppx"), numbers.at("ppy")};
  const Tree* coefficients = map.find("coeffs");
  const FilePlace of = numbers.place("coeffs");
  if (!coefficients) fail_at(of, "is missing; write the stream's five coefficients");
  const std::vector<double> k = lens_formats::numbers(*coefficients, of);
  if (k.size() != 5)
    fail_at(of, fmt::format("has {} numbers; allowed: 5, as RealSense has", k.size()));
  std::string model = lower(numbers.word("model"));
  std::ranges::replace(model, ' ', '_');
  for (const char* prefix : {"distortion.", "rs2_distortion_"})
    if (model.starts_with(prefix)) model.erase(0, std::string_view(prefix).size());
  const Size size = numbers.size("width", "height");
  // Those of F-theta are not a pinhole's even if they are 0.
  const bool is_plain = model.find("theta") == model.npos &&
                        std::ranges::all_of(k, [](double value) { return value == 0; });
  const bool is_fisheye = model == "kannala_brandt4";
  if (!is_fisheye && !is_plain && model != "brown_conrady")
    fail_at(numbers.place("model"),
            fmt::format("RealSense's \"{}\" with such coefficients is not supported (the "
                        "inverse one leads from the distorted picture to the undistorted one, and "
                        "its numbers are not OpenCV's); allowed: brown_conrady, kannala_brandt4; "
                        "measure the lens with \"previz calibrate observer\" from pictures of a "
                        "chessboard",
                        printable(numbers.word("model"))));
  FileLens lens = is_fisheye ? fisheye_lens(focal, at, std::span(k).first(4), of, size)
                             : pinhole_lens(focal, at, k, of, size);
  lens.model = model.empty() ? "no distortion" : model;
  lens.size_keys = scope.prefix + "width, " + scope.prefix + "height";
  return lens;
}

void add_realsense(const Tree& tree, const Scope& scope, std::vector<FileCamera>& cameras) {
  if (tree.find("ppx") && tree.find("ppy")) {
    std::string name = scope.prefix;
    if (name.ends_with('.')) name.pop_back();
    cameras.push_back(camera_of(name, [&] { return realsense_lens(tree, scope); }));
    return;
  }
  for (std::size_t i = 0; i < tree.children.size(); ++i) {
    const std::string key = i < tree.keys.size() ? printable(tree.keys[i]) : fmt::format("{}", i);
    add_realsense(tree.children[i], {scope.file, scope.prefix + key + "."}, cameras);
  }
}

}  // namespace

std::vector<FileCamera> read_metashape(std::string_view text, const std::string& file) {
  std::vector<FileCamera> cameras;
  add_metashape(parse_whole_xml(text, file), file, cameras);
  if (cameras.empty())
    fail_at({file, 0, ""}, "has no camera of Metashape; save the calibration again");
  return cameras;
}

std::vector<FileCamera> read_transforms(std::string_view text, const std::string& file) {
  const Tree root = parse_json(text, file);
  return {camera_of("", [&] { return transforms_lens(root, file); })};
}

std::vector<FileCamera> read_realsense(std::string_view text, const std::string& file) {
  std::vector<FileCamera> cameras;
  add_realsense(parse_json(text, file), {file, ""}, cameras);
  if (cameras.empty()) fail_at({file, 0, ""}, "has no camera of RealSense; export it again");
  return cameras;
}

}  // namespace previz::calibrate::lens_formats
