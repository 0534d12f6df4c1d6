// Kalibr's camchain: cam0, cam1, ..., as its wiki describes them ("YAML formats", "Supported
// models").
#include <fmt/format.h>

#include "daemon/tools/calibrate/lens/lens_file_formats.hpp"
#include "drivers/keys/value.hpp"

namespace previz::calibrate::lens_formats {
namespace {

constexpr const char* again = "; calibrate again with pinhole-equi or pinhole-radtan";

const Tree& kalibr_key(const Tree& camera, const char* key, const Scope& scope) {
  if (const Tree* found = camera.find(key)) return *found;
  fail_at(scope.place(camera, key), "is missing; Kalibr writes it into every camera");
}

void check_projection(const Tree& camera, const Scope& scope) {
  const Tree& model = kalibr_key(camera, "camera_model", scope);
  if (model.word == "pinhole") return;
  const FilePlace at = scope.place(model, "camera_model");
  for (const char* known : {"omni", "eucm", "ds"})
    if (model.word == known) fail_at(at, fmt::format("\"{}\" is not supported{}", known, again));
  fail_at(at, fmt::format("\"{}\" is unknown; allowed: pinhole{}", printable(model.word), again));
}

FileLens kalibr_lens(const Tree& camera, const Scope& scope) {
  check_projection(camera, scope);
  const Tree& distortion = kalibr_key(camera, "distortion_model", scope);
  const FilePlace model_at = scope.place(distortion, "distortion_model");
  const std::string& model = distortion.word;
  if (model != "radtan" && model != "equidistant" && model != "none")
    fail_at(model_at, fmt::format("\"{}\" is not supported; allowed: radtan, equidistant, none{}",
                                  printable(model), again));
  const Tree& intrinsics = kalibr_key(camera, "intrinsics", scope);
  const FilePlace at = scope.place(intrinsics, "intrinsics");
  const std::vector<double> four = numbers(intrinsics, at);
  if (four.size() != 4)
    fail_at(at, fmt::format("has {} numbers; allowed: 4, fu, fv, pu and pv", four.size()));
  Size size;
  if (const Tree* resolution = camera.find("resolution")) {
    const FilePlace size_at = scope.place(*resolution, "resolution");
    if (resolution->children.size() != 2)
      fail_at(size_at, "is not a size; allowed: [WIDTH, HEIGHT]");
    size = {picture_side(resolution->children[0], size_at),
            picture_side(resolution->children[1], size_at)};
  }
  const Focal focal{four[0], four[1], four[2], four[3]};
  const Tree* coefficients = camera.find("distortion_coeffs");
  if (!coefficients && model != "none")
    fail_at(scope.place(camera, "distortion_coeffs"), "is missing for distortion_model " + model);
  const FilePlace of = scope.place(coefficients ? *coefficients : camera, "distortion_coeffs");
  const std::vector<double> k = coefficients ? numbers(*coefficients, of) : std::vector<double>{};
  if (k.size() != (model == "none" ? 0 : 4))
    fail_at(of, fmt::format("has {} numbers; allowed for distortion_model {}: {}", k.size(), model,
                            model == "none" ? 0 : 4));
  FileLens lens = model == "equidistant" ? fisheye_lens(focal, at, k, of, size)
                                         : pinhole_lens(focal, at, k, of, size);
  lens.model = "pinhole-" + model;
  lens.size_keys = scope.prefix + "resolution";
  return lens;
}

}  // namespace

std::vector<FileCamera> read_kalibr(const Tree& root, const std::string& file) {
  std::vector<FileCamera> cameras;
  for (std::size_t i = 0; i < root.keys.size(); ++i) {
    const Tree& camera = root.children[i];
    if (!camera.find("camera_model") && !(camera.find("intrinsics") && camera.find("resolution")))
      continue;
    const std::string name = printable(root.keys[i]);
    cameras.push_back(camera_of(name, [&] {
      return kalibr_lens(camera, Scope{file, name + "."});
    }));
  }
  if (cameras.empty() && root.find("camera_model") && root.find("distortion_model") &&
      root.find("intrinsics"))  // one camera alone, as Kalibr takes it too
    cameras.push_back(camera_of("", [&] { return kalibr_lens(root, Scope{file, ""}); }));
  return cameras;
}

}  // namespace previz::calibrate::lens_formats
