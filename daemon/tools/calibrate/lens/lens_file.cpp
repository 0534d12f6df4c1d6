#include "daemon/tools/calibrate/lens/lens_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "daemon/tools/calibrate/lens/lens_file_formats.hpp"
#include "drivers/calibration/keys.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"

namespace previz::calibrate {
namespace lens_formats {
namespace {

constexpr std::size_t most_numbers = 64;
constexpr double most_focal_px = 1e9;

void add_numbers(const Tree& tree, const FilePlace& place, std::vector<double>& all) {
  if (all.size() >= most_numbers) fail_at(place, "has more than 64 numbers");
  if (tree.kind == Tree::Kind::list) {
    for (const Tree& child : tree.children) add_numbers(child, place, all);
  } else if (tree.kind == Tree::Kind::map) {
    const Tree* data = tree.find("data");
    if (!data) fail_at(place, "is not a matrix; allowed: a list of numbers, or a map with data");
    if (data->kind != Tree::Kind::nothing) add_numbers(*data, place, all);
  } else if (tree.kind == Tree::Kind::word) {
    all.push_back(number_of(tree.word));
    if (!std::isfinite(all.back()))
      fail_at(place, fmt::format("\"{}\" is not a finite number; correct the file, or calibrate "
                                 "again",
                                 printable(tree.word)));
  }
}

void check_focal(const Focal& focal, const FilePlace& at) {
  for (const auto& [name, value] : {std::pair{"fx", focal.fx}, std::pair{"fy", focal.fy}})
    if (!(value > 0 && value <= most_focal_px))
      fail_at(at,
              fmt::format(
                  "{} is {:g}; allowed: above 0, to 1e9 px; calibrate again, or correct the file",
                  name, value));
}

}  // namespace

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result)
    if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
  return result;
}

double number_of(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc{} && end == word.data() + word.size()
             ? value
             : std::numeric_limits<double>::quiet_NaN();
}

std::vector<double> numbers(const Tree& tree, const FilePlace& place) {
  std::vector<double> all;
  add_numbers(tree, place, all);
  return all;
}

int picture_side(const Tree& tree, const FilePlace& place) {
  const double side = number_of(tree.kind == Tree::Kind::word ? tree.word : "");
  if (!(side >= 1 && side <= calibration::max_picture_side_px && side == std::floor(side)))
    fail_at(place, fmt::format("\"{}\" is not a side of a picture; allowed: 1 to {} px",
                               printable(tree.word), calibration::max_picture_side_px));
  return int(side);
}

FileLens pinhole_lens(const Focal& focal, const FilePlace& at, std::span<const double> coefficients,
                      const FilePlace& of_coefficients, const Size& size) {
  check_focal(focal, at);
  constexpr std::array allowed = {0, 4, 5, 8, 12, 14};
  if (std::ranges::find(allowed, int(coefficients.size())) == allowed.end())
    fail_at(of_coefficients, fmt::format("has {} coefficients; allowed: 4, 5, 8, 12 or 14, in "
                                         "OpenCV's order",
                                         coefficients.size()));
  constexpr std::array beyond = {"s1", "s2", "s3", "s4", "tau_x", "tau_y"};
  for (std::size_t i = 8; i < coefficients.size(); ++i)
    if (coefficients[i] != 0)
      fail_at(of_coefficients,
              fmt::format("{} is {:g}, and previzd's lenses have no {}; calibrate again with 8 "
                          "coefficients (CALIB_RATIONAL_MODEL alone)",
                          beyond[i - 8], coefficients[i], i < 12 ? "thin prism" : "tilted sensor"));
  std::array<double, 8> k{};
  std::copy_n(coefficients.begin(), std::min<std::size_t>(8, coefficients.size()), k.begin());
  PinholeIntrinsics lens{size.width, size.height, focal.fx, focal.fy, focal.cx, focal.cy, k[0],
                         k[1],       k[2],        k[3],     k[4],     k[5],     k[6],     k[7]};
  return {lens, "", at, "", {}};
}

FileLens fisheye_lens(const Focal& focal, const FilePlace& at, std::span<const double> coefficients,
                      const FilePlace& of_coefficients, const Size& size) {
  check_focal(focal, at);
  if (coefficients.size() != 4)
    fail_at(of_coefficients, fmt::format("has {} coefficients; allowed for a fisheye: 4, k1 to k4",
                                         coefficients.size()));
  FisheyeIntrinsics lens{size.width, size.height, focal.fx, focal.fy, focal.cx, focal.cy};
  std::copy_n(coefficients.begin(), 4, lens.k.begin());
  return {lens, "", at, "", {}};
}

FileCamera camera_of(const std::string& name, const std::function<FileLens()>& read) {
  try {
    return {name, read(), ""};
  } catch (const Error& error) {
    return {name, std::nullopt, error.what()};
  }
}

}  // namespace lens_formats

namespace {

constexpr const char* readable_formats =
    "OpenCV's YAML, XML and JSON, ROS's camera_info, Kalibr's camchain, COLMAP's cameras.txt, "
    "Metashape's camera XML, nerfstudio's transforms.json, RealSense's JSON";

template <typename Number>
Number little_endian_at(std::string_view bytes, std::size_t at) {
  Number value{};
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

// A count (64 bits), then for each camera its id and its model (32 bits), the sides of the picture
// (64 bits) and 3 parameters or more (64 bits).
bool is_colmap_binary(std::string_view bytes) {
  constexpr std::size_t head = 8, camera = 4 + 4 + 8 + 8 + 3 * 8;
  if (bytes.size() < head + camera) return false;
  const auto count = little_endian_at<std::uint64_t>(bytes, 0);
  return count >= 1 && count <= (bytes.size() - head) / camera &&
         little_endian_at<std::uint32_t>(bytes, head + 4) <= 32 &&
         little_endian_at<std::uint64_t>(bytes, head + 8) <= 1'000'000;
}

void refuse_binary(std::string_view bytes, const FilePlace& at) {
  if (bytes.starts_with("\x1f\x8b") || bytes.starts_with("PK\x03\x04"))
    fail_at(at, "is compressed; unpack it, and give the file with the lens");
  if (bytes.starts_with("\xff\xfe") || bytes.starts_with("\xfe\xff"))
    fail_at(at, "is UTF-16; save it as UTF-8");
  if (bytes.find('\0') == bytes.npos) return;
  if (is_colmap_binary(bytes))
    fail_at(at,
            "is COLMAP's cameras.bin; convert it with \"colmap model_converter --input_path MODEL "
            "--output_path TEXT --output_type TXT\", and give its cameras.txt");
  fail_at(at, std::string("is binary, and not a calibration that previzd knows; it reads: ") +
                  readable_formats);
}

LensFile read_tree(const Tree& tree, std::string_view text, const char* syntax,
                   const std::string& file) {
  LensFile read;
  read.cameras = lens_formats::read_kalibr(tree, file);
  read.format = "Kalibr's camchain";
  if (!read.cameras.empty()) return read;
  read.cameras = lens_formats::read_opencv(tree, text, file);
  read.format =
      lens_formats::is_ros(tree) ? "ROS's camera_info" : std::string("OpenCV's ") + syntax;
  if (read.cameras.empty())
    fail_at({file, 0, ""},
            std::string("is not a calibration that previzd knows; it reads: ") + readable_formats);
  return read;
}

LensFile read_syntax(std::string_view text, const std::string& file) {
  const char first = text[text.find_first_not_of(" \t\r\n")];
  if (first == '<') return read_tree(parse_xml(text, file), text, "XML", file);
  if (first == '{') return read_tree(parse_json(text, file), text, "JSON", file);
  const YamlTree yaml = parse_yaml(text, file);
  LensFile read = read_tree(yaml.tree, text, "YAML", file);
  if (yaml.has_more)
    read.notes.push_back("the file has more than one YAML document; the first is used");
  return read;
}

LensFile read_text(std::string_view text, const std::string& file) {
  if (text.find_first_not_of(" \t\r\n") == text.npos)
    fail_at({file, 0, ""}, "is empty; export the calibration again");
  if (lens_formats::is_colmap(text))
    return {"COLMAP's cameras.txt", lens_formats::read_colmap(text, file), {}};
  if (auto read = lens_formats::read_by_program(text, file)) return *std::move(read);
  try {
    return read_syntax(text, file);
  } catch (const Error&) {
    lens_formats::refuse_by_program(text, file);
    throw;
  }
}

std::string camera_list(const LensFile& read) {
  std::string list;
  for (std::size_t i = 0; i < read.cameras.size(); ++i)
    add_to_list(list, read.cameras[i].name.empty() ? std::to_string(i) : read.cameras[i].name);
  return list;
}

// Returns the index of a name, or else of a number; nothing if neither is in the file.
std::optional<std::size_t> index_of(const LensFile& read, const std::string& camera) {
  const auto named = std::ranges::find(read.cameras, camera, &FileCamera::name);
  if (named != read.cameras.end()) return std::size_t(named - read.cameras.begin());
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(camera.data(), camera.data() + camera.size(), index);
  if (error == std::errc{} && end == camera.data() + camera.size() && index < read.cameras.size())
    return index;
  return std::nullopt;
}

}  // namespace

LensFile read_lens_file(std::string_view bytes, const std::string& file) {
  if (bytes.empty()) fail_at({file, 0, ""}, "has 0 bytes; export the calibration again");
  if (bytes.size() > lens_file_kind.most_bytes)
    fail_at({file, 0, ""}, "is larger than 1 MiB; give a file with the lens alone");
  refuse_binary(bytes, {file, 0, ""});
  if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);
  return read_text(bytes, file);
}

const FileLens& chosen_lens(const LensFile& read, const std::optional<std::string>& camera,
                            const std::string& file) {
  if (!camera && read.cameras.size() > 1)
    throw Error(fmt::format("{}: has {} cameras: {}; choose one with --camera", file,
                            read.cameras.size(), camera_list(read)));
  const auto index = camera ? index_of(read, *camera) : std::optional<std::size_t>(0);
  if (!index)
    throw Error(fmt::format("--camera: \"{}\" not found in {}; its cameras: {}", printable(*camera),
                            file, camera_list(read)));
  const FileCamera& chosen = read.cameras[*index];
  if (!chosen.lens) throw Error(chosen.refusal);
  return *chosen.lens;
}

}  // namespace previz::calibrate
