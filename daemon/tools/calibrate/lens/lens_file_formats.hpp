// The formats of lens files, one function each, and what they share; lens_file.cpp alone uses it.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/tools/calibrate/lens/file_lens.hpp"

namespace previz::calibrate::lens_formats {

// Where a value is: the file, and the keys that lead to it.
struct Scope {
  std::string file;
  std::string prefix;  // "cam0."

  FilePlace place(const Tree& tree, const std::string& key) const {
    return {file, tree.line, prefix + key};
  }
};

// Reads finite numbers: a list, lists in a list, OpenCV's matrix (its "data") or a single number.
// Throws previz::Error at the place, also for more than 64.
std::vector<double> numbers(const Tree& tree, const FilePlace& place);
// Returns the sides of a picture, px: both within 1 and the largest that previzd reads.
int picture_side(const Tree& tree, const FilePlace& place);
// Parses a number as a whole; not finite if it is not a finite number.
double number_of(std::string_view word);
std::string lower(std::string_view text);

struct Focal {
  double fx, fy, cx, cy;
};

struct Size {
  int width = 0, height = 0;
};

// Make a lens of checked numbers. `coefficients` are in OpenCV's order: 0, 4, 5, 8, 12 or 14, of
// which those after the 8th (thin prism, tilt) must be 0. Throw previz::Error at `at` for focal
// lengths that are not above 0, or at `of_coefficients`.
FileLens pinhole_lens(const Focal& focal, const FilePlace& at, std::span<const double> coefficients,
                      const FilePlace& of_coefficients, const Size& size);
FileLens fisheye_lens(const Focal& focal, const FilePlace& at, std::span<const double> coefficients,
                      const FilePlace& of_coefficients, const Size& size);

// Added to a principal point whose (0,0) is the corner of the first pixel, as COLMAP's.
inline constexpr double corner_to_centre_px = -0.5;

// Calls `read`; an Error becomes the camera's refusal.
FileCamera camera_of(const std::string& name, const std::function<FileLens()>& read);

// Each returns no camera if the content is not of its format.
std::vector<FileCamera> read_kalibr(const Tree& root, const std::string& file);
// OpenCV's files and ROS's camera_info. `text` is searched for the word fisheye.
std::vector<FileCamera> read_opencv(const Tree& root, std::string_view text,
                                    const std::string& file);
bool is_ros(const Tree& root);
bool is_colmap(std::string_view text);
std::vector<FileCamera> read_colmap(std::string_view text, const std::string& file);

// The readers of lens_file_programs.cpp's table. Each throws previz::Error if the file has no
// camera.
std::vector<FileCamera> read_metashape(std::string_view text, const std::string& file);
std::vector<FileCamera> read_transforms(std::string_view text, const std::string& file);
std::vector<FileCamera> read_realsense(std::string_view text, const std::string& file);
// Reads the file of a program that the table knows by its content; of another, nothing.
std::optional<LensFile> read_by_program(std::string_view text, const std::string& file);
// Throws previz::Error with the way to convert if the table has words for this file's program.
void refuse_by_program(std::string_view text, const std::string& file);

}  // namespace previz::calibrate::lens_formats
