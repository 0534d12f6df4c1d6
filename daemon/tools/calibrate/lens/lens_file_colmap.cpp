// COLMAP's cameras.txt: "CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]" a line, with the models and the
// order of their parameters as in its documentation ("Camera Models") and colmap/sensor/models.h.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "daemon/tools/calibrate/lens/lens_file_formats.hpp"
#include "drivers/keys/value.hpp"

namespace previz::calibrate::lens_formats {
namespace {

struct Model {
  const char* name;
  bool is_fisheye;
  int focals;        // 1: f for both axes
  int coefficients;  // after f and the principal point
};

constexpr std::array models = std::to_array<Model>({
    {"SIMPLE_PINHOLE", false, 1, 0},
    {"PINHOLE", false, 2, 0},
    {"SIMPLE_RADIAL", false, 1, 1},
    {"RADIAL", false, 1, 2},
    {"OPENCV", false, 2, 4},
    {"FULL_OPENCV", false, 2, 8},
    {"OPENCV_FISHEYE", true, 2, 4},
    {"SIMPLE_RADIAL_FISHEYE", true, 1, 1},
    {"RADIAL_FISHEYE", true, 1, 2},
});
constexpr std::array refused_models = {"FOV",
                                       "THIN_PRISM_FISHEYE",
                                       "RAD_TAN_THIN_PRISM_FISHEYE",
                                       "SIMPLE_DIVISION",
                                       "DIVISION",
                                       "SIMPLE_FISHEYE",
                                       "FISHEYE",
                                       "EQUIRECTANGULAR"};

struct Line {
  int number = 0;
  std::vector<std::string> words;
};

std::vector<Line> data_lines(std::string_view text) {
  std::vector<Line> lines;
  std::istringstream stream{std::string(text)};
  int number = 0;
  for (std::string row; std::getline(stream, row);) {
    ++number;
    Line line{number, {}};
    std::istringstream words(row);
    for (std::string word; words >> word;) line.words.push_back(word);
    if (!line.words.empty() && !line.words.front().starts_with('#'))
      lines.push_back(std::move(line));
  }
  return lines;
}

const Model& model_of(const std::string& name, const FilePlace& at) {
  const auto found = std::ranges::find(models, name, &Model::name);
  if (found != models.end()) return *found;
  std::string known;
  for (const Model& model : models) known += (known.empty() ? "" : ", ") + std::string(model.name);
  fail_at(at, fmt::format("the camera model {} is not supported; allowed: {}; reconstruct again "
                          "with --ImageReader.camera_model OPENCV or OPENCV_FISHEYE",
                          printable(name), known));
}

// Puts the coefficients into OpenCV's order, which COLMAP's full models have.
std::vector<double> in_opencv_order(const Model& model, std::vector<double> k) {
  if (k.empty()) return k;
  k.resize(model.is_fisheye || k.size() <= 4 ? 4 : 8);
  return k;
}

FileLens colmap_lens(const Line& line, const FilePlace& at) {
  const Model& model = model_of(line.words[1], at);
  const std::size_t expected = std::size_t(4 + model.focals + 2 + model.coefficients);
  if (line.words.size() != expected)
    fail_at(at, fmt::format("{} has {} parameters; allowed: {}", model.name,
                            std::max<std::ptrdiff_t>(0, std::ssize(line.words) - 4), expected - 4));
  std::vector<double> values;
  for (std::size_t i = 4; i < line.words.size(); ++i) {
    values.push_back(number_of(line.words[i]));
    if (!std::isfinite(values.back()))
      fail_at(at, fmt::format("\"{}\" is not a finite number; correct the file, or reconstruct "
                              "again",
                              printable(line.words[i])));
  }
  Tree side;
  side.kind = Tree::Kind::word;
  Size size;
  side.word = line.words[2];
  size.width = picture_side(side, {at.file, at.line, at.key + " width"});
  side.word = line.words[3];
  size.height = picture_side(side, {at.file, at.line, at.key + " height"});
  const std::size_t c = std::size_t(model.focals);
  const Focal focal{values[0], values[c - 1], values[c] + corner_to_centre_px,
                    values[c + 1] + corner_to_centre_px};
  const auto first = values.begin() + std::ptrdiff_t(c) + 2;
  const std::vector<double> k = in_opencv_order(model, {first, values.end()});
  FileLens lens = model.is_fisheye ? fisheye_lens(focal, at, k, at, size)
                                   : pinhole_lens(focal, at, k, at, size);
  lens.model = model.name;
  lens.size_keys = "WIDTH, HEIGHT";
  lens.notes.push_back(
      "COLMAP's pixel (0,0) is the corner of the first pixel, previzd's its centre: 0.5 px is "
      "subtracted from cx and cy");
  return lens;
}

}  // namespace

bool is_colmap(std::string_view text) {
  const std::vector<Line> lines = data_lines(text.substr(0, 4096));
  if (lines.empty()) return text.find("# Camera list with one line of data") != text.npos;
  const std::vector<std::string>& words = lines.front().words;
  if (words.size() < 2 ||
      !std::ranges::all_of(words[0], [](char c) { return c >= '0' && c <= '9'; }))
    return false;
  return std::ranges::find(models, words[1], &Model::name) != models.end() ||
         std::ranges::find(refused_models, words[1]) != refused_models.end() ||
         text.find("# Camera list with one line of data") != text.npos;
}

std::vector<FileCamera> read_colmap(std::string_view text, const std::string& file) {
  std::vector<FileCamera> cameras;
  for (const Line& line : data_lines(text)) {
    const std::string id = printable(line.words.front());
    const FilePlace at{file, line.number, "camera " + id};
    if (line.words.size() < 4)
      fail_at(at, "is not a camera; a line has CAMERA_ID MODEL WIDTH HEIGHT PARAMS");
    cameras.push_back(camera_of(id, [&] { return colmap_lens(line, at); }));
  }
  if (cameras.empty()) fail_at({file, 0, ""}, "has no camera; export the model again");
  return cameras;
}

}  // namespace previz::calibrate::lens_formats
