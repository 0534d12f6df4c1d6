// Lenses of other programs: what their files say is projected as their documentation says, and
// what previzd cannot do right is refused with the words that help.
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "daemon/core/set/load.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/lens/lens_file.hpp"
#include "daemon/tools/calibrate/lens/lens_file_check.hpp"
#include "daemon/tools/calibrate/lens/lens_refit.hpp"
#include "drivers/calibration/fisheye.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::calibrate::from_test {

using namespace std::string_literals;

// The table has 12 digits: of 2000 px that is 1e-9, and the formulas differ by rounding alone.
constexpr double exact_px = 1e-6;

struct Result {
  std::string words, table, error;
};

Result from(const std::string& content, FromOptions options = {}) {
  const test::TemporaryDirectory directory;
  options.file = directory / "lens.txt";
  options.table_file = directory / "table.toml";
  session::write_content(options.file, content);
  std::ostringstream out;
  const std::string error = test::error_of([&] { calibrate_from(options, out); });
  return {out.str(), session::content_of(*options.table_file), error};
}

FromOptions as(CameraRole role, bool force = false) {
  return {.file = {}, .as = role, .camera = {}, .size = {}, .force = force, .table_file = {}};
}
FromOptions of_camera(const std::string& camera) {
  return {.file = {}, .as = {}, .camera = camera, .size = {}, .table_file = {}};
}
FromOptions of_size(const std::string& size) {
  return {.file = {}, .as = {}, .camera = {}, .size = size, .table_file = {}};
}

struct Refusal {
  std::string content, words;
};

void expect_refused(const std::vector<Refusal>& refusals) {
  for (const auto& [content, words] : refusals)
    EXPECT_THAT(from(content).error, HasSubstr(words)) << content.substr(0, 200);
}

PinholeIntrinsics observer_in(const Result& result) {
  EXPECT_EQ(result.error, "");
  const set::Set set = set::parse_set(result.table, "set.toml");
  EXPECT_TRUE(set.observer.calibration.has_value());
  return set.observer.calibration.value_or(ObserverCalibration{}).intrinsics;
}

FisheyeIntrinsics light_in(const Result& result) {
  EXPECT_EQ(result.error, "");
  const std::string pose = "[light_camera.pose]\nposition_m = [0.0, 0.0, 0.0]\n";
  const set::Set set = set::parse_set(result.table + pose, "set.toml");
  EXPECT_TRUE(set.light_camera.calibration.has_value());
  return set.light_camera.calibration.value_or(LightCameraCalibration{}).intrinsics;
}

// Directions over the field of view, up to `most` in x/z and y/z.
std::vector<cv::Point3d> directions(double most) {
  std::vector<cv::Point3d> all;
  for (double y = -most; y <= most; y += most / 5)
    for (double x = -most; x <= most; x += most / 5) all.emplace_back(x, y, 1);
  return all;
}

struct Lens {
  double fx, fy, cx, cy;
  std::vector<double> k;
};

std::vector<cv::Point2d> by_opencv(const Lens& lens, const std::vector<cv::Point3d>& points,
                                   bool is_fisheye) {
  const cv::Matx33d k(lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1);
  std::vector<cv::Point2d> pixels;
  const cv::Vec3d none(0, 0, 0);
  if (is_fisheye)
    cv::fisheye::projectPoints(points, pixels, none, none, k, lens.k);
  else
    cv::projectPoints(points, none, none, k, lens.k, pixels);
  return pixels;
}

void expect_as_opencv(const PinholeIntrinsics& lens, const Lens& truth) {
  const auto points = directions(0.4);
  const auto pixels = by_opencv(truth, points, false);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const glm::dvec2 pixel = distort(lens, {points[i].x, points[i].y});
    EXPECT_LT(glm::distance(pixel, {pixels[i].x, pixels[i].y}), exact_px);
  }
}

void expect_as_opencv(const FisheyeIntrinsics& intrinsics, const Lens& truth) {
  const Fisheye lens(intrinsics);
  const auto points = directions(1.0);
  const auto pixels = by_opencv(truth, points, true);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto pixel = lens.project({points[i].x, points[i].y, 1});
    ASSERT_TRUE(pixel);
    EXPECT_LT(glm::distance(*pixel, {pixels[i].x, pixels[i].y}), exact_px);
  }
}

const std::vector<double> five = {-0.12, 0.05, 0.001, -0.0007, -0.01};
const std::vector<double> eight = {0.31, -0.12, 0.0004, -0.0003, 0.02, 0.45, -0.07, 0.01};
const std::vector<double> kb4 = {-0.02, 0.004, -0.003, 0.0005};

std::string opencv_file(const Lens& lens, const std::string& name, const std::string& more = "") {
  const cv::Mat1d k = (cv::Mat1d(3, 3) << lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1);
  cv::FileStorage file(name, cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  file << "calibration_time"
       << "Tue Nov 24 10:00:00 2026";
  file << "image_width" << 1920 << "image_height" << 1080;
  if (!more.empty()) file << more << 1;
  file << "camera_matrix" << k << "distortion_coefficients" << cv::Mat(lens.k, true);
  file << "per_view_reprojection_errors" << cv::Mat1d(1, 3, 0.2);
  return file.releaseAndGetString();
}

class OpencvFiles : public testing::TestWithParam<const char*> {};

// All of them are written by OpenCV itself.
TEST_P(OpencvFiles, ProjectAsOpencvDoes) {
  for (const auto& k : {std::vector<double>{-0.1, 0.02, 0.001, 0.002}, five, eight}) {
    const Lens truth{1510.25, 1508.5, 952.125, 547.75, k};
    const Result result = from(opencv_file(truth, GetParam()));
    EXPECT_THAT(result.words, HasSubstr("as observer, because the model is a pinhole"));
    expect_as_opencv(observer_in(result), truth);
  }
}

TEST_P(OpencvFiles, AFisheyeIsOneByItsFlag) {
  const Lens truth{560.5, 561.25, 955.5, 541.25, kb4};
  const Result result = from(opencv_file(truth, GetParam(), "fisheye_model"));
  EXPECT_THAT(result.words, HasSubstr("as light, because the model is a fisheye"));
  expect_as_opencv(light_in(result), truth);
}

TEST_P(OpencvFiles, ThinPrismsAndTiltsMustBeZero) {
  Lens lens{1510, 1510, 960, 540, eight};
  lens.k.resize(14);
  expect_as_opencv(observer_in(from(opencv_file(lens, GetParam()))), lens);
  lens.k[9] = 0.002;
  EXPECT_THAT(from(opencv_file(lens, GetParam())).error,
              HasSubstr("distortion_coefficients: s2 is 0.002, and previzd's lenses have no thin "
                        "prism; calibrate again with 8 coefficients"));
  lens.k[9] = 0;
  lens.k[12] = 0.01;
  EXPECT_THAT(from(opencv_file(lens, GetParam())).error,
              HasSubstr("tau_x is 0.01, and previzd's lenses have no tilted sensor"));
}

INSTANTIATE_TEST_SUITE_P(Syntaxes, OpencvFiles,
                         testing::Values("lens.yml", "lens.xml", "lens.json"),
                         [](const auto& of) { return std::string(of.param).substr(5); });

TEST(LensFiles, FourCoefficientsAreSaidToBeAssumed) {
  const Lens truth{900, 900, 960, 540, kb4};
  const std::string text = opencv_file(truth, "lens.yml");
  EXPECT_THAT(from(text).words, HasSubstr("assumed: nothing in the file says fisheye"));
  const Result fisheye = from(text + "# flags: fisheye::CALIB_FIX_SKEW\n");
  EXPECT_THAT(fisheye.words, HasSubstr("assumed: the word fisheye is in the file"));
  expect_as_opencv(light_in(fisheye), truth);
}

TEST(LensFiles, StereoFilesNameTheirMatrices) {
  const std::string text =
      R"({"M1": [[900, 0, 960], [0, 900, 540], [0, 0, 1]], "D1": [[-0.05, 0, 0, 0, 0]],
          "M2": [[800, 0, 960], [0, 800, 540], [0, 0, 1]], "D2": [[0, 0, 0, 0, 0]],
          "imageSize": [1920, 1080]})";
  EXPECT_THAT(from(text).error, HasSubstr("has 2 cameras: M1, M2; choose one with --camera"));
  EXPECT_EQ(observer_in(from(text, of_camera("M2"))).fx, 800);
  EXPECT_EQ(observer_in(from(text, of_camera("0"))).fx, 900);
  EXPECT_THAT(from(text, of_camera("M3")).error, HasSubstr("--camera: \"M3\" not found in "));
}

std::string camera_info(const std::string& model, const std::vector<double>& k) {
  std::ostringstream text;
  text.precision(17);
  text << "image_width: 1280\nimage_height: 960\ncamera_name: narrow\ncamera_matrix:\n  rows: 3\n  "
          "cols: 3\n  data: [640.5, 0, 637.25, 0, 641.5, 482.125, 0, 0, 1]\ndistortion_model: "
       << model << "\ndistortion_coefficients:\n  rows: 1\n  cols: " << k.size() << "\n  data: [";
  for (std::size_t i = 0; i < k.size(); ++i) text << (i ? ", " : "") << k[i];
  text << "]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
          "projection_matrix:\n  rows: 3\n  cols: 4\n  data: [600, 0, 640, 0, 0, 600, 480, 0, 0, "
          "0, 1, 0]\n";
  return text.str();
}

Lens ros_lens(const std::vector<double>& k) {
  return {640.5, 641.5, 637.25, 482.125, k};
}

TEST(LensFiles, RosCameraInfoHasItsThreeModels) {
  expect_as_opencv(observer_in(from(camera_info("plumb_bob", five))), ros_lens(five));
  expect_as_opencv(observer_in(from(camera_info("rational_polynomial", eight))), ros_lens(eight));
  expect_as_opencv(light_in(from(camera_info("equidistant", kb4))), ros_lens(kb4));
  expect_as_opencv(light_in(from(camera_info("fisheye", kb4))), ros_lens(kb4));
  EXPECT_THAT(from(camera_info("thin_prism_fisheye", kb4)).error,
              HasSubstr("lens.txt:8: distortion_model: \"thin_prism_fisheye\" is not supported"));
}

TEST(LensFiles, RosMessagesAreReadAsTheyArePrinted) {
  const Result result = from(
      "header:\n  frame_id: cam\nheight: 960\nwidth: 1280\ndistortion_model: plumb_bob\nd:\n- -0.12"
      "\n- 0.05\n- 0.001\n- -0.0007\n- -0.01\nk: [640.5, 0.0, 637.25, 0.0, 641.5, 482.125, 0.0, "
      "0.0, 1.0]\nr: [1, 0, 0, 0, 1, 0, 0, 0, 1]\np: [600, 0, 640, 0, 0, 600, 480, 0, 0, 0, 1, 0]\n"
      "binning_x: 2\nbinning_y: 2\nroi: {x_offset: 0, width: 0}\n---\nheight: 960\n---\n");
  expect_as_opencv(observer_in(result), ros_lens(five));
  EXPECT_THAT(result.words, HasSubstr("warning: the file gives binning"));
  EXPECT_THAT(result.words, HasSubstr("more than one YAML document; the first is used"));
}

TEST(LensFiles, RectifiedFilesAreSaid) {
  const Result empty = from(camera_info("plumb_bob", {}));
  expect_as_opencv(observer_in(empty), ros_lens({0, 0, 0, 0}));
  EXPECT_THAT(empty.words, HasSubstr("distortion_coefficients is empty: the lens is without "
                                     "distortion, as of rectified pictures"));
  const Result rectified = from(
      "image_width: 1280\nimage_height: 960\nprojection_matrix:\n  rows: 3\n  cols: 4\n  data: "
      "[600, 0, 640, 0, 0, 601, 480, 0, 0, 0, 1, 0]\n");
  expect_as_opencv(observer_in(rectified), {600, 601, 640, 480, {0, 0, 0, 0}});
  EXPECT_THAT(rectified.words, HasSubstr("with rectified pictures (image_rect) only"));
}

std::string camchain(const std::string& camera_model, const std::string& distortion_model,
                     const std::string& k) {
  return "cam0:\n  cam_overlaps: [1]\n  camera_model: " + camera_model +
         "\n  distortion_coeffs: " + k + "\n  distortion_model: " + distortion_model +
         "\n  intrinsics: [461.5, 460.25, 367.75, 248.5]\n  resolution: [752, 480]\n  rostopic: "
         "/cam0/image_raw\n";
}

TEST(LensFiles, KalibrsCamchainHasPinholes) {
  const Lens truth{461.5, 460.25, 367.75, 248.5, {-0.28, 0.07, 0.0002, 0.00002}};
  expect_as_opencv(
      observer_in(from(camchain("pinhole", "radtan", "[-0.28, 0.07, 0.0002, 0.00002]"))), truth);
  expect_as_opencv(observer_in(from(camchain("pinhole", "none", "[]"))),
                   {461.5, 460.25, 367.75, 248.5, {0, 0, 0, 0}});
  expect_as_opencv(
      light_in(from(camchain("pinhole", "equidistant", "[-0.02, 0.004, -0.003, 0.0005]"))),
      {461.5, 460.25, 367.75, 248.5, kb4});
}

TEST(LensFiles, KalibrsOtherModelsAreRefusedByName) {
  for (const std::string model : {"omni", "eucm", "ds"})
    expect_refused({{camchain(model, "radtan", "[0, 0, 0, 0]"),
                     "lens.txt:3: cam0.camera_model: \"" + model +
                         "\" is not supported; calibrate again with pinhole-equi or "
                         "pinhole-radtan"}});
  expect_refused({{camchain("pinhole", "fov", "[0.9]"),
                   "lens.txt:5: cam0.distortion_model: \"fov\" is not supported"}});
}

TEST(LensFiles, ACameraThatCannotBeReadLeavesTheOthers) {
  std::string second = camchain("omni", "radtan", "[0, 0, 0, 0]");
  second.replace(0, 4, "cam1");
  const std::string text = camchain("pinhole", "none", "[]") + second;
  EXPECT_EQ(observer_in(from(text, of_camera("cam0"))).width, 752);
  EXPECT_THAT(from(text, of_camera("1")).error, HasSubstr("cam1.camera_model: \"omni\""));
}

// COLMAP's models by the formulas of colmap/sensor/models.h: u, v are x/z, y/z, or of the fisheyes
// theta/r times that; the pixel is f (u, v) (1 + k1 r^2 + ...) + c, and its (0.5, 0.5) is ours
// (0, 0).
struct ColmapModel {
  std::string name, parameters;
  Lens lens;
};

class ColmapModels : public testing::TestWithParam<ColmapModel> {};

TEST_P(ColmapModels, ProjectByHalfAPixelLess) {
  auto [name, parameters, lens] = GetParam();
  const Result result = from(
      "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, "
      "PARAMS[]\n# Number of cameras: 1\n1 " +
      name + " 1920 1080 " + parameters + "\n");
  EXPECT_THAT(result.words, HasSubstr("0.5 px is subtracted from cx and cy"));
  lens.cx -= 0.5;
  lens.cy -= 0.5;
  if (name.ends_with("FISHEYE"))
    expect_as_opencv(light_in(result), lens);
  else
    expect_as_opencv(observer_in(result), lens);
}

const ColmapModel colmap_models[] = {
    {"SIMPLE_PINHOLE", "1500.5 960 540", {1500.5, 1500.5, 960, 540, {0, 0, 0, 0}}},
    {"PINHOLE", "1500.5 1501.5 961 541", {1500.5, 1501.5, 961, 541, {0, 0, 0, 0}}},
    {"SIMPLE_RADIAL", "1500.5 960 540 -0.05", {1500.5, 1500.5, 960, 540, {-0.05, 0, 0, 0}}},
    {"RADIAL", "1500.5 960 540 -0.05 0.02", {1500.5, 1500.5, 960, 540, {-0.05, 0.02, 0, 0}}},
    {"OPENCV",
     "1500.5 1501.5 961 541 -0.05 0.02 0.001 -0.002",
     {1500.5, 1501.5, 961, 541, {-0.05, 0.02, 0.001, -0.002}}},
    {"FULL_OPENCV",
     "1500.5 1501.5 961 541 0.31 -0.12 0.0004 -0.0003 0.02 0.45 -0.07 0.01",
     {1500.5, 1501.5, 961, 541, eight}},
    {"OPENCV_FISHEYE",
     "560.5 561.5 961 541 -0.02 0.004 -0.003 0.0005",
     {560.5, 561.5, 961, 541, kb4}},
    {"SIMPLE_RADIAL_FISHEYE", "560.5 960 540 -0.02", {560.5, 560.5, 960, 540, {-0.02, 0, 0, 0}}},
    {"RADIAL_FISHEYE", "560.5 960 540 -0.02 0.004", {560.5, 560.5, 960, 540, {-0.02, 0.004, 0, 0}}},
};
INSTANTIATE_TEST_SUITE_P(All, ColmapModels, testing::ValuesIn(colmap_models), [](const auto& of) {
  std::string name = of.param.name;
  std::erase(name, '_');
  return name;
});

TEST(LensFiles, ColmapsOthersAreRefusedByName) {
  std::string binary(8 + 24 + 24, '\0');
  binary[0] = binary[8] = 1;
  binary[16] = binary[24] = 127;
  expect_refused({
      {"1 FOV 1920 1080 900 900 960 540 0.9\n",
       "lens.txt:1: camera 1: the camera model FOV is not supported"},
      {"3 THIN_PRISM_FISHEYE 1920 1080 9 9 9 9 0 0 0 0 0 0 0 0\n",
       "camera 3: the camera model THIN_PRISM_FISHEYE is not supported"},
      {"1 OPENCV 1920 1080 900 900 960 540\n", "OPENCV has 4 parameters; allowed: 8"},
      {"1 PINHOLE 1920 1080 900 900 960 nan\n", "\"nan\" is not a finite number"},
      {binary, "is COLMAP's cameras.bin; convert it with \"colmap model_converter"},
  });
}

// The fit keeps what it promises: no pixel of either lens is farther off than the said worst.
TEST(LensRefits, AFisheyeOfModerateFieldBecomesAFilmCamerasLens) {
  const std::string text = camera_info("equidistant", kb4);
  const FisheyeIntrinsics truth = light_in(from(text));
  const Result result = from(text, as(CameraRole::observer));
  const PinholeIntrinsics lens = observer_in(result);
  const Refit<PinholeIntrinsics> refit = refit_as_pinhole(truth);
  std::printf("fisheye as pinhole: %.2g px\n", refit.worst_px);
  EXPECT_LT(refit.worst_px, 0.1);
  EXPECT_THAT(result.words, HasSubstr("px off over the whole picture"));
  const Fisheye fisheye(truth);
  for (int y = 0; y < 960; y += 7)
    for (int x = 0; x < 1280; x += 7) {
      const auto direction = fisheye.unproject({x, y});
      ASSERT_TRUE(direction);
      const glm::dvec2 pixel =
          distort(lens, {direction->x / direction->z, direction->y / direction->z});
      EXPECT_LE(glm::distance(pixel, {x, y}), 1.01 * refit.worst_px + exact_px);
    }
}

TEST(LensRefits, APinholeBecomesAFisheye) {
  const std::string text = "1 OPENCV 1280 960 1100 1101 640 480 -0.12 0.05 0 0\n";
  const PinholeIntrinsics truth = observer_in(from(text));
  const Result result = from(text, as(CameraRole::light));
  const Fisheye lens(light_in(result));
  const Refit<FisheyeIntrinsics> refit = refit_as_fisheye(truth);
  std::printf("pinhole as fisheye: %.2g px\n", refit.worst_px);
  EXPECT_LT(refit.worst_px, 0.1);
  for (int y = 0; y < 960; y += 7)
    for (int x = 0; x < 1280; x += 7) {
      const auto normalised = undistort(truth, {x, y});
      ASSERT_TRUE(normalised);
      const auto pixel = lens.project(glm::dvec3(*normalised, 1));
      ASSERT_TRUE(pixel);
      EXPECT_LE(glm::distance(*pixel, {x, y}), 1.01 * refit.worst_px + exact_px);
    }
}

// Tangential distortion of 0.01 bends by up to f p r^2, several pixels, as no round lens does.
TEST(LensRefits, WhatDoesNotFitIsForcedOnly) {
  const std::string text = camera_info("plumb_bob", {-0.12, 0.05, 0.01, 0, 0});
  EXPECT_THAT(from(text, as(CameraRole::light)).error, HasSubstr("allowed: 0.1 px"));
  const Result forced = from(text, as(CameraRole::light, true));
  EXPECT_EQ(forced.error, "");
  EXPECT_THAT(forced.table, HasSubstr("# UNRELIABLE: accepted with --force although"));
  light_in(forced);
}

TEST(LensRefits, AFisheyeBeyond90DegreesIsNoFilmCamerasLens) {
  EXPECT_THAT(
      from("1 OPENCV_FISHEYE 1920 1080 400 400 960 540 0 0 0 0\n", as(CameraRole::observer)).error,
      HasSubstr("as observer: pixel 0, 0 is 90 degrees or more off axis, which the film "
                "camera's lens cannot hold; use --as light"));
}

// theta - theta^3 / 12 ends at 533 px, and the corner is 1101 px off.
TEST(LensRefits, AFisheyesCircleIsNoFilmCamerasPicture) {
  EXPECT_THAT(from("1 OPENCV_FISHEYE 1920 1080 400 400 960 540 -0.083333333333333333 0 0 0\n",
                   as(CameraRole::observer))
                  .error,
              HasSubstr("as observer: pixel 0, 0 is outside of the fisheye's circle; use --as "
                        "light"));
}

// f (theta) with k = 0 goes on to pi; the corner is 400 theta = 1101.5 px off, 157.8 degrees.
TEST(LensFiles, AFisheyesAngleIsThatOfTheCornerOrOfTheFold) {
  const FisheyeIntrinsics corner =
      light_in(from("1 OPENCV_FISHEYE 1920 1080 400 400 960 540 0 0 0 0\n"));
  EXPECT_NEAR(corner.max_angle_rad, std::hypot(960, 540) / 400, 1e-9);
  // theta - theta^3 / 12 grows up to theta = 2, where it is 4/3: 400 of them are 533 px.
  const FisheyeIntrinsics fold =
      light_in(from("1 OPENCV_FISHEYE 1920 1080 400 400 960 540 -0.083333333333333333 0 0 0\n"));
  EXPECT_NEAR(fold.max_angle_rad, 2, 1e-8);
  // theta - theta^3 / 0.03 grows up to 0.1, where it is 0.0667: 26.7 px of 400.
  EXPECT_THAT(
      from("1 OPENCV_FISHEYE 1920 1080 400 400 960 540 -33.333333333333333 0 0 0\n").error,
      HasSubstr("lens.txt:1: camera 1: the fisheye folds back 26.7 px off its centre, at 5.7 "
                "degrees; check the order of the coefficients"));
}

std::string matrix_file(const std::string& matrix, const std::string& k = "[0, 0, 0, 0, 0]") {
  return "image_width: 1920\nimage_height: 1080\ncamera_matrix: " + matrix +
         "\ndistortion_coefficients: " + k + "\n";
}

TEST(LensFiles, WrongNumbersAreRefusedWithTheirPlace) {
  expect_refused({
      {matrix_file("[18.664, 0, 960, 0, 18.664, 540, 0, 0, 1]"),
       "lens.txt:3: camera_matrix: fx 18.664 is not a focal length in px for a picture 1920 px "
       "wide: it may be in mm"},
      {matrix_file("[1500, 0, 960, 0, .nan, 540, 0, 0, 1]"),
       "lens.txt:3: camera_matrix: \".nan\" is not a finite number"},
      {matrix_file("[1500, 0, 960, 0, -1500, 540, 0, 0, 1]"),
       "lens.txt:3: camera_matrix: fy is -1500; allowed: above 0"},
      {matrix_file("[1500, 0, 96000, 0, 1500, 540, 0, 0, 1]"),
       "camera_matrix: cx 96000 is far outside of a picture of 1920 px"},
      {matrix_file("[1500, 2, 960, 0, 1500, 540, 0, 0, 1]"), "camera_matrix: has a skew of 2"},
      {matrix_file("[1500, 0, 960, 0, 1500, 540, 0, 0]"),
       "camera_matrix: has 8 numbers; allowed: 9"},
      {matrix_file("[1500, 0, 960, 0, 1500, 540, 0, 0, 1]", "[1, 2, 3]"),
       "lens.txt:4: distortion_coefficients: has 3 coefficients; allowed: 4, 5"},
  });
}

TEST(LensFiles, WhatIsNotCalibratedOrHasNoCoefficientsIsRefused) {
  expect_refused({
      {matrix_file("[0, 0, 0, 0, 0, 0, 0, 0, 0]"),
       "lens.txt:3: camera_matrix: is 0, as of a camera that is not calibrated"},
      {"camera_matrix: [[900, 0, 9], [0, 900, 9], [0, 0, 1]]\n",
       "distortion_coefficients: is missing; write the lens's, or an empty list"},
  });
  FromOptions options;
  options.file = "/dev/zero";
  std::ostringstream out;
  EXPECT_THROW(calibrate_from(options, out), Error);
}

// r (1 - r^2) grows up to r = 0.577, the picture's corner is drawn from 0.734 or farther.
TEST(LensFiles, AFoldInThePictureIsNamed) {
  EXPECT_THAT(from(matrix_file("[1500, 0, 960, 0, 1500, 540, 0, 0, 1]", "[-1, 0, 0, 0, 0]")).error,
              HasSubstr("lens.txt:3: camera_matrix: the lens folds inside its picture, at pixel 0, "
                        "0; calibrate again"));
}

TEST(LensFiles, TheSizeIsInTheFileOrGiven) {
  const std::string text = "K: [1500, 0, 960, 0, 1500, 540, 0, 0, 1]\nD: [0, 0, 0, 0, 0]\n";
  EXPECT_THAT(from(text).error, HasSubstr("lens.txt: image_width, image_height: the picture's size "
                                          "is missing; give it with --size"));
  EXPECT_EQ(observer_in(from(text, of_size("1920x1080"))).height, 1080);
  EXPECT_THAT(from(text, of_size("1920")).error, HasSubstr("--size: \"1920\" is not valid"));
  EXPECT_THAT(from("image_width: 1280\nimage_height: 720\n" + text, of_size("1920x1080")).error,
              HasSubstr("image_width, image_height: 1280x720 conflicts with --size 1920x1080"));
  EXPECT_THAT(from("image_width: 0\nimage_height: 720\n" + text).error,
              HasSubstr("lens.txt:1: image_width: \"0\" is not a side of a picture"));
}

TEST(LensFiles, WhatIsNoCalibrationIsRefusedByWhatItIs) {
  expect_refused({
      {"", "has 0 bytes"},
      {" \n", "is empty"},
      {"\x7f"
       "ELF\0\1"s,
       "is binary"},
      {"\x1f\x8b\x08", "is compressed; unpack it"},
      {"name: foo\nlist: [1, 2]\n",
       "is not a calibration that previzd knows; it reads: OpenCV's YAML, XML and JSON, ROS's "
       "camera_info, Kalibr's camchain, COLMAP's cameras.txt"},
      {"set cut_paste_input [stack 0]\nLensDistortion {\n serialiseKnob \"22\"\n}\n",
       "is a LensDistortion node of Nuke, which is not supported; export"},
      {"lens one\n3DE4 Radial - Standard, Degree 4\n",
       "is a lens of 3DEqualizer, which is not supported"},
      {"a: [1, 2\nb: 3\n", "is not valid YAML"},
      {"{\"a\": }", "is not valid JSON"},
      {"<a><b></a>", "is not valid XML"},
  });
}

TEST(LensFiles, HostileFilesEndSoon) {
  EXPECT_NE(from("a: 1\n---\na: 1\n---\na: 1\n").error, "");  // has one document too many
  expect_refused({
      {"a: &a [1]\nb: *a\n", "lens.txt:1: anchors (&) and aliases (*) are not supported"},
      {"a: " + std::string(33, '[') + std::string(33, ']'), "nested in more than 32 levels"},
      {std::string((1 << 20) + 1, 'a'), "which has at most 1 MiB"},
      {"a: 1\na: 2\n", "lens.txt:2: a: is given twice"},
  });
}

}  // namespace previz::calibrate::from_test
