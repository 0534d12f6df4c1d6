// Lens files of photogrammetry and film programs: their numbers are converted as their
// documentation says, or the refusal names the program and how to convert them.
#include "daemon/tools/calibrate/lens/lens_file.hpp"
#include "daemon/tools/calibrate/lens/lens_file_check.hpp"
#include "drivers/calibration/fisheye.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "tests/support/test.hpp"

namespace previz::calibrate::programs_test {

FileLens lens_of(const std::string& content, const std::optional<std::string>& camera = {},
                 const std::optional<PictureSize>& size = {}) {
  FileLens lens = chosen_lens(read_lens_file(content, "lens.txt"), camera, "lens.txt");
  complete_lens(lens, size);
  return lens;
}

std::string refusal(const std::string& content, const std::optional<std::string>& camera = {}) {
  return test::error_of([&] { lens_of(content, camera); });
}

void expect_pinhole(const FileLens& file, const PinholeIntrinsics& truth) {
  ASSERT_TRUE(std::holds_alternative<PinholeIntrinsics>(file.lens));
  const auto& lens = std::get<PinholeIntrinsics>(file.lens);
  EXPECT_EQ(lens.width, truth.width);
  EXPECT_EQ(lens.height, truth.height);
  for (const auto number : {&PinholeIntrinsics::fx, &PinholeIntrinsics::fy, &PinholeIntrinsics::cx,
                            &PinholeIntrinsics::cy, &PinholeIntrinsics::k1, &PinholeIntrinsics::k2,
                            &PinholeIntrinsics::p1, &PinholeIntrinsics::p2, &PinholeIntrinsics::k3})
    EXPECT_NEAR(lens.*number, truth.*number, 1e-9);
}

const PinholeIntrinsics truth{1920,  1080,   1511.25, 1509.5, 971.125, 533.75, -0.11,
                              0.035, 0.0011, -0.0006, -0.004, 0,       0,      0};

// -- Metashape.

const std::string metashape_numbers =
    "<f>1509.5</f><cx>11.625</cx><cy>-5.75</cy><b1>1.75</b1><k1>-0.11</k1><k2>0.035</k2>"
    "<k3>-0.004</k3><p1>-0.0006</p1><p2>0.0011</p2>";

std::string metashape(const std::string& numbers, const std::string& projection = "frame") {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<calibration>\n<projection>" + projection +
         "</projection>\n<width>1920</width>\n<height>1080</height>\n" + numbers +
         "\n<date>2026-11-29T10:00:00Z</date>\n</calibration>\n";
}

TEST(MetashapeFiles, GiveTheLens) {
  expect_pinhole(lens_of(metashape(metashape_numbers)), truth);
  PinholeIntrinsics plain{1920, 1080, 1509.5, 1509.5, 959.5, 539.5};
  expect_pinhole(lens_of(metashape("<f>1509.5</f>")), plain);
}

// The equations of the user manual, appendix on camera models; (0,0) is a corner there.
TEST(MetashapeFiles, ProjectByTheManualsEquations) {
  const auto lens = std::get<PinholeIntrinsics>(lens_of(metashape(metashape_numbers)).lens);
  constexpr double f = 1509.5, b1 = 1.75, cx = 11.625, cy = -5.75;
  constexpr double k1 = -0.11, k2 = 0.035, k3 = -0.004, p1 = -0.0006, p2 = 0.0011;
  for (const double x : {-0.6, -0.1, 0.3, 0.55})
    for (const double y : {-0.3, 0.0, 0.25}) {
      const double r2 = x * x + y * y, radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
      const double xd = x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y;
      const double yd = y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y;
      const glm::dvec2 corner(960 + cx + xd * f + xd * b1, 540 + cy + yd * f);
      EXPECT_LT(glm::distance(distort(lens, {x, y}), corner - 0.5), 1e-9);
    }
}

// As "Export Cameras" writes it, with what else is there: properties, bands, covariances, cameras.
std::string project(const std::string& sensors) {
  std::string cameras;
  for (int i = 0; i < 1100; ++i)
    cameras += "<camera id=\"" + std::to_string(i) +
               "\" label=\"a b\"><transform>1 0 0 0 0 1 0 0 0 "
               "0 1 0 0 0 0 1</transform></camera>";
  return "<?xml version=\"1.0\"?>\n<document version=\"2.0.0\"><chunk label=\"Chunk 1\"><sensors "
         "next_id=\"2\">" +
         sensors + "</sensors><cameras>" + cameras + "</cameras></chunk></document>";
}

std::string sensor(const std::string& label, const std::string& calibration) {
  return "<sensor id=\"0\" label=\"" + label +
         "\" type=\"frame\"><resolution width=\"1920\" height=\"1080\"/><property name=\"fixed\" "
         "value=\"false\"/><property name=\"layer_index\" value=\"0\"/><bands><band "
         "label=\"Red\"/><band label=\"Green\"/></bands>" +
         calibration + "</sensor>";
}

std::string calibration(const std::string& name, const std::string& numbers) {
  return "<calibration type=\"frame\" class=\"" + name +
         "\"><resolution width=\"1920\" height=\"1080\"/>" + numbers + "</calibration>";
}

TEST(MetashapeFiles, AProjectsSensorsAreItsCameras) {
  const std::string one = sensor("ILCE-7M4, 35 mm", calibration("initial", "<f>1500</f>") +
                                                        calibration("adjusted", metashape_numbers));
  expect_pinhole(lens_of(project(one)), truth);
  const std::string two = project(one + sensor("second", ""));
  EXPECT_THAT(refusal(two), HasSubstr("has 2 cameras: ILCE-7M4, 35 mm, second"));
  expect_pinhole(lens_of(two, "0"), truth);
  EXPECT_THAT(refusal(two, "second"),
              HasSubstr("lens.txt:2: sensor: has no calibration; align the photos"));
}

// b2 y' is greatest at the upper edge, where y' is 540 / 1500.
TEST(MetashapeFiles, WhatOpencvsLensLacksIsRefusedByName) {
  for (const char* projection : {"fisheye", "equisolid_fisheye", "spherical", "cylindrical"})
    EXPECT_THAT(refusal(metashape("<f>500</f>", projection)),
                HasSubstr(std::string("lens.txt:3: projection: Metashape's \"") + projection +
                          "\" is not supported; allowed: frame"));
  EXPECT_THAT(refusal(metashape("<f>1500</f><k4>0.002</k4>")),
              HasSubstr("k4: is 0.002, and OpenCV's lenses have no term k4 r^8"));
  EXPECT_THAT(refusal(metashape("<f>1500</f><p3>0.002</p3>")), HasSubstr("p3: is 0.002"));
  EXPECT_THAT(refusal(metashape("<f>1500</f><b2>0.5</b2>")),
              HasSubstr("b2: a skew of 0.5 moves the picture's edge by 0.18 px"));
  EXPECT_THAT(lens_of(metashape("<f>1500</f><b2>-0.1</b2>")).notes,
              Contains(HasSubstr("b2 is ignored: it moves the picture's edge by 0.036")));
  EXPECT_THAT(refusal(metashape("<fx>1500</fx><fy>1500</fy><cx>960</cx><cy>540</cy>")),
              HasSubstr("PhotoScan's form before 1.2"));
  EXPECT_THAT(refusal(metashape("<f>1e308</f><b1>1e308</b1>")),
              HasSubstr("fx is inf; allowed: above 0"));
  EXPECT_THAT(refusal(metashape("<f>nan</f>")), HasSubstr("f: \"nan\" is not a finite number"));
  EXPECT_THAT(refusal("<calibration><projection>frame</projection><f>1500</f></calibration>"),
              HasSubstr("width: is missing"));
}

// -- nerfstudio and instant-ngp.

const std::string opencv_numbers =
    R"("fl_x": 1511.25, "fl_y": 1509.5, "cx": 971.625, "cy": 534.25, "k1": -0.11, "k2": 0.035,
       "k3": -0.004, "p1": 0.0011, "p2": -0.0006, "w": 1920, "h": 1080)";

TEST(TransformsFiles, GiveTheLens) {
  const std::string frames = R"(, "frames": [{"file_path": "a.png", "transform_matrix": [[1, 0, 0,
      0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}, {"file_path": "b.png"}]})";
  expect_pinhole(lens_of(R"({"camera_model": "OPENCV", )" + opencv_numbers + frames), truth);
  expect_pinhole(lens_of(R"({"camera_angle_x": 1.1, )" + opencv_numbers + frames), truth);
  // Every frame has the lens, the same one.
  const std::string each = "{\"frames\": [{" + opencv_numbers + "}, {" + opencv_numbers + "}]}";
  expect_pinhole(lens_of(each), truth);
  EXPECT_THAT(lens_of(each).notes, Contains(HasSubstr("0.5 px is subtracted")));
  PinholeIntrinsics plain{1920, 1080, 1500, 1500, 959.5, 539.5};
  expect_pinhole(lens_of(R"({"fl_x": 1500, "cx": 960, "cy": 540})", {}, PictureSize{1920, 1080}),
                 plain);
}

TEST(TransformsFiles, AFisheyeHasFourCoefficients) {
  const std::string numbers = R"("fl_x": 560.5, "fl_y": 561.5, "cx": 961, "cy": 541, "w": 1920,
      "h": 1080, "k1": -0.02, "k2": 0.004, "k3": -0.003, "k4": 0.0005})";
  for (const char* model : {R"({"camera_model": "OPENCV_FISHEYE", )", R"({"is_fisheye": true, )"}) {
    const auto lens = std::get<FisheyeIntrinsics>(lens_of(model + numbers).lens);
    EXPECT_EQ(lens.cx, 960.5);
    EXPECT_EQ(lens.fy, 561.5);
    EXPECT_EQ(lens.k, (std::array{-0.02, 0.004, -0.003, 0.0005}));
  }
  EXPECT_THAT(refusal(R"({"is_fisheye": true, "p1": 0.1, )" + numbers),
              HasSubstr("p1: is 0.1, and OpenCV's fisheye has no tangential terms"));
}

TEST(TransformsFiles, WhatIsNotOneLensIsRefused) {
  EXPECT_THAT(refusal(R"({"camera_angle_x": 0.7, "frames": []})"),
              HasSubstr("fl_x: is missing: camera_angle_x alone is a field of view"));
  EXPECT_THAT(refusal(R"({"frames": [{"fl_x": 1500, "cx": 960, "cy": 540}, {"fl_x": 1510}]})"),
              HasSubstr("frames[1].fl_x: is 1510, and 1500 elsewhere in the file"));
  EXPECT_THAT(refusal(R"({"camera_model": "EQUIRECTANGULAR", )" + opencv_numbers + "}"),
              HasSubstr("camera_model: \"EQUIRECTANGULAR\" is not supported"));
  EXPECT_THAT(refusal(R"({"k4": 0.01, )" + opencv_numbers + "}"),
              HasSubstr("k4: is 0.01, and OpenCV's lenses have no term k4 r^8"));
  EXPECT_THAT(refusal(R"({"fl_x": 1500, "w": 1920, "h": 1080})"), HasSubstr("cx: is missing"));
}

// -- RealSense.

std::string realsense(const std::string& model, const std::string& coefficients) {
  return R"({"width": 1920, "height": 1080, "ppx": 971.125, "ppy": 533.75, "fx": 1511.25, "fy":
      1509.5, "model": ")" +
         model + R"(", "coeffs": [)" + coefficients + "]}";
}

TEST(RealsenseFiles, ForwardModelsAreRead) {
  const std::string five = "-0.11, 0.035, 0.0011, -0.0006, -0.004";
  expect_pinhole(lens_of(realsense("distortion.brown_conrady", five)), truth);
  expect_pinhole(lens_of("{\"depth\": " + realsense("none", "0, 0, 0, 0, 0") +
                             ", \"color\": " + realsense("Brown Conrady", five) + "}",
                         "color"),
                 truth);
  PinholeIntrinsics plain = truth;
  plain.k1 = plain.k2 = plain.p1 = plain.p2 = plain.k3 = 0;
  expect_pinhole(lens_of(realsense("distortion.inverse_brown_conrady", "0, 0, 0, 0, 0")), plain);
  for (const char* model : {"distortion.inverse_brown_conrady", "Inverse Brown Conrady", "ftheta"})
    EXPECT_THAT(refusal(realsense(model, five)), HasSubstr(std::string("model: RealSense's \"") +
                                                           model + "\" with such coefficients"));
  EXPECT_THAT(refusal(realsense("F Theta", "0, 0, 0, 0, 0")), HasSubstr("RealSense's \"F Theta\""));
  const FileLens fisheye = lens_of(realsense("kannala_brandt4", "-0.02, 0.004, -0.003, 0.0005, 0"));
  EXPECT_EQ(std::get<FisheyeIntrinsics>(fisheye.lens).k[3], 0.0005);
}

// -- The others.

struct Named {
  std::string content;
  std::vector<std::string> words;
};

TEST(NamedFiles, AreRefusedWithTheWay) {
  const std::string reality_capture = "which is not supported; export the alignment as COLMAP's";
  const std::vector<Named> all = {
      {R"(<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="r"><rdf:Description
          xcr:DistortionModel="brown3" xcr:FocalLength35mm="28.3" xcr:PrincipalPointU="0.006"
          xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#"><xcr:DistortionCoeficients>-0.11
          0.035 -0.004 0 0 0</xcr:DistortionCoeficients></rdf:Description></rdf:RDF></x:xmpmeta>)",
       {"a camera of RealityCapture", reality_capture, "add width/2 - 0.5"}},
      {"#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\na.jpg,0,0,0,0,0,0,28.3,0,0,0,0,"
       "0,"
       "0,0,0\n",
       {"a table of cameras of RealityCapture", reality_capture}},
      {R"({"version": ["1", "2", "8"], "views": [{"metadata": {"a": "1", "a": "2"}}],
          "intrinsics": [{"width": "1920", "sensorWidth": "36", "type": "pinhole", "focalLength":
          "28.3", "principalPoint": ["11.6", "-5.7"], "distortionParams": ["0.1", "0", "0"]}]})",
       {"a project of Meshroom", "the picture's centre since file version 1.2.1", "ExportColmap"}},
      {R"({"v2 sony 1920 1080 brown 0.78": {"projection_type": "brown", "focal_x": 0.78}})",
       {"a camera of OpenSfM", "(width - 1)/2"}},
      {R"({"sfm_data_version": "0.3", "intrinsics": []})", {"a project of OpenMVG", "disto_k3"}},
      {"Pix4D camera calibration file 0\n#Focal Length mm assuming a sensor width of 36x24mm\n",
       {"a camera of Pix4D", "R1, R2, R3, T1, T2"}},
      {"Intrinsic of \"Color\" / 1920x1080\n  Width:\t1920\n  PPX:\t971\n  Distortion:\tInverse "
       "Brown Conrady\n",
       {"a lens of RealSense as text", "PPX and PPY are cx and cy"}},
      {"LensDistortion2 {\n inputs 0\n}\n",
       {"is a LensDistortion2 node of Nuke, which is not supported; export an OpenCV-like model"}},
      {"LD_3DE4_Radial_Standard_Degree_4 {\n inputs 0\n}\n", {"is a lens of 3DEqualizer"}},
      {"PFBarrel {\n inputs 0\n}\n", {"is a lens of PFTrack"}},
      {"# SynthEyes lens distortion\n1 2 3\n: [", {"is a lens of SynthEyes"}},
      {"Calibration results \n====================\nCamera-system parameters:\n\tcam0 "
       "(/cam0/image_raw):\n\t type: <class 'x'>\n\t distortion: [-0.11 0.035] +- [0.1 0.1]\n",
       {"is Kalibr's report", "camchain.yaml beside results-cam.txt"}},
      {"<lensdatabase version=\"1\"><lens><maker>Sony</maker></lens></lensdatabase>",
       {"a database of Lensfun", "measure the lens"}},
      {"<x:xmpmeta><rdf:RDF><rdf:li stCamera:Make=\"Sony\"/><rdf:li/></rdf:RDF></x:xmpmeta>",
       {"a lens profile of Adobe", "measure the lens"}},
  };
  for (const auto& [content, words] : all) {
    const std::string said = refusal(content);
    for (const std::string& word : words) EXPECT_THAT(said, HasSubstr(word));
    EXPECT_EQ(said.rfind("lens.txt: is ", 0), 0u) << said;
  }
}

// A name in a comment does not keep a file from being read.
TEST(NamedFiles, ANameInACommentIsNoRefusal) {
  const std::string numbers =
      "image_width: 1920\nimage_height: 1080\ncamera_matrix: [1500, 0, 960, 0, 1500, 540, 0, 0, "
      "1]\n"
      "distortion_coefficients: [0, 0, 0, 0, 0]\n";
  EXPECT_EQ(refusal("# the lens distortion of SynthEyes, PFTrack and LD_3DE\n" + numbers), "");
}

}  // namespace previz::calibrate::programs_test
