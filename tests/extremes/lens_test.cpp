// Apertures from nothing to the widest, focus from a centimetre to infinity: continuous with the
// pinhole, sharp where the focus is; what no lens can be is refused by the key's name.
#include "daemon/core/session/session_toml.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/set.hpp"
#include "tests/extremes/every_way.hpp"

namespace previz::test::lens_test {

// A glowing chequerboard of 8 x 8 fields, `distance` before the camera and as wide as the picture.
View chequers(double distance) {
  constexpr double fov = 0.8;
  View view;
  scene::Texture texture = texture_of(8, 8);
  texture.nearest = true;
  for (int i = 0; i < 64; ++i)
    texture.texels.emplace_back(glm::vec4(glm::vec3((i / 8 + i) % 2 == 0 ? 0.1f : 0.9f), 1));
  scene::Material board = emitter(glm::vec3(1));
  board.emission_texture = add_texture(view.scene, texture);
  const double side = 4 * distance * std::tan(fov / 2);
  glm::dmat4 pose(1);  // faces -Z
  pose[1] = {0, -1, 0, 0};
  pose[2] = {0, 0, -1, 0};
  pose[3] = {0, 0, distance, 1};
  add(view.scene, rectangle_mesh({side, side}), board, pose);
  view.environment = uniform_environment(glm::vec3(0));
  view.calibration = pinhole(48, 36, fov);
  return view;  // the camera at the origin, looking along +Z
}

render::Layers show(const View& view) {
  return render_clean(view, 16, up_to_depth(1)).layers;
}

// A sample's points on the lens are joined to one point of the focal plane, so there the picture is
// the pinhole's, sample by sample. Rounding moves that point by 1e-6 of the picture's width at
// most: over an edge in 36 * 2 * 48 pixel widths by chance 1e-6 * 48 a sample, so in less than one
// of 100 pixels.
void expect_sharp(View view, const ThinLens& lens) {
  const render::Layers plain = show(view);
  view.calibration.lens = lens;
  const render::Layers lensed = show(view);
  std::size_t apart = 0;
  for (std::size_t i = 0; i < plain.mixed.size(); ++i)
    apart += std::abs(plain.mixed[i].g - lensed.mixed[i].g) > 1e-5f;
  EXPECT_LE(apart, plain.mixed.size() / 100)
      << "f/" << lens.f_number << " at " << lens.focus_distance_m << " m";
}

TEST(ExtremeLens, IsSharpAtItsFocusFromACentimetreToInfinity) {
  expect_sharp(chequers(0.01), {0.005, 0.5, 0.01});
  expect_sharp(chequers(0.01), {0.005, 2, 0.01});
  expect_sharp(chequers(1), {0.05, 0.5, 1});
  expect_sharp(chequers(1e6), {0.05, 0.5, 1e6});
}

TEST(ExtremeLens, ClosedDownIsThePinhole) {
  for (const double f_number : {1e6, 1e9, 1e30}) expect_sharp(chequers(1), {0.05, f_number, 0.3});
}

// Half a metre behind the focus of the widest lens, the circle of confusion covers several fields:
// the board is grey, no darker and no brighter.
TEST(ExtremeLens, WideOpenBlursAndKeepsTheLight) {
  View view = chequers(1);
  view.calibration.lens = ThinLens{0.5, 0.5, 0.6};
  const render::Layers layers = show(view);
  // The middle, where the circle does not reach over the board's border.
  double sum = 0;
  int count = 0;
  for (int y = 12; y < 24; ++y)
    for (int x = 16; x < 32; ++x, ++count)
      sum += static_cast<double>(layers.mixed[static_cast<std::size_t>(y) * 48 + x].g);
  // 192 pixels of 16 samples, each 0.1 or 0.9: a standard error of 0.4 / sqrt(3072).
  EXPECT_NEAR(sum / count, 0.5, 4 * 0.4 / std::sqrt(3072.0));
}

// A virtual ball before a lit table, far out of focus: where the lens may show the ball, no way
// takes the pixel for one that only the table is in.
class LensByEveryWay : public EveryWay {};
INSTANTIATE_TEST_SUITE_P(Ways, LensByEveryWay, testing::Values(difference, by_camera), name_of_way);

TEST_P(LensByEveryWay, CoversWhatThePairedEstimatorCovers) {
  View view = empty_view({0, -1.2, 1}, {0, 0, 0.3}, pinhole(48, 36, 0.8), glm::vec3(1));
  add(view.scene, rectangle_mesh({8, 8}), diffuse(glm::vec3(0.5f)));
  add(view.scene, icosphere_mesh(0.1, 3), plastic(glm::vec3(0.8f, 0.2f, 0.1f), 0.3f),
      at({0, 0, 0.4}), scene::world_mixed);
  for (const ThinLens& lens : {ThinLens{0.05, 0.5, 0.3}, ThinLens{0.05, 0.5, 1e6},
                               ThinLens{0.005, 0.5, 0.01}, ThinLens{0.05, 1e30, 0.3}}) {
    SCOPED_TRACE("f/" + std::to_string(lens.f_number) + " at " +
                 std::to_string(lens.focus_distance_m) + " m");
    view.calibration.lens = lens;
    const Seen seen = seen_by_camera(view, 0.5, 8, up_to_depth(3));
    const render::Layers all = render_by(paired, view, seen, 8, up_to_depth(3)).layers;
    EXPECT_EQ(render_by(GetParam(), view, seen, 8, up_to_depth(3)).layers.mask, all.mask);
    EXPECT_GT(std::count_if(all.mask.begin(), all.mask.end(), [](float m) { return m > 0; }), 20);
  }
}

// The message of a set file with this lens, "" where it is taken.
std::string refusal_of_set(const std::string& lens) {
  const std::string text =
      "[observer.intrinsics]\nwidth=64\nheight=48\nfx=60.0\nfy=60.0\ncx=31.5\ncy=23.5\n"
      "[observer.lens]\n" +
      lens;
  return error_of([&] { set::parse_set(text, "stage.toml"); });
}

TEST(ExtremeLens, ImpossibleValuesAreRefusedByTheKeysName) {
  const std::string good = "focal_length_mm=35\nf_number=2.8\nfocus_distance_m=1\n";
  EXPECT_EQ(refusal_of_set(good), "");
  EXPECT_EQ(refusal_of_set("focal_length_mm=5\nf_number=0.5\nfocus_distance_m=0.01\n"), "");
  EXPECT_EQ(refusal_of_set("focal_length_mm=35\nf_number=1e6\nfocus_distance_m=1e6\n"), "");
  const struct {
    std::string key, others;
    std::vector<std::string> impossible;
  } rows[] = {
      {"f_number", "focal_length_mm=35\nfocus_distance_m=1\n", {"0", "-2.8", "0.49", "inf", "nan"}},
      {"focus_distance_m",
       "focal_length_mm=35\nf_number=2.8\n",
       {"0", "-1", "0.034", "0.035", "inf", "nan"}},
      {"focal_length_mm", "f_number=2.8\nfocus_distance_m=1\n", {"0", "-35", "inf", "nan"}},
  };
  for (const auto& [key, others, impossible] : rows)
    for (const std::string& value : impossible)
      EXPECT_THAT(refusal_of_set(others + key + "=" + value), HasSubstr("observer.lens." + key))
          << value;
}

std::string refusal_of_session(const ThinLens& lens) {
  session::SessionFile file;
  file.streams["observer"] = {PixelFormat::rgb8, 64, 48, {}};
  file.info.observer = ObserverCalibration{};
  file.info.observer->intrinsics = pinhole(64, 48, 0.9).intrinsics;
  file.info.observer->lens = lens;
  return error_of([&] { session::parse_session_toml(session::to_toml(file), "session.toml"); });
}

TEST(ExtremeLens, ASessionsImpossibleLensIsRefusedToo) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(refusal_of_session({0.035, 2.8, 1}), "");
  EXPECT_EQ(refusal_of_session({0.005, 0.5, 0.01}), "");
  for (const double value : {0.0, -2.8, 0.49, inf, std::nan("")})
    EXPECT_THAT(refusal_of_session({0.035, value, 1}), HasSubstr("calibration.lens.f_number"))
        << value;
  for (const double value : {0.0, -1.0, 0.035, inf, std::nan("")})
    EXPECT_THAT(refusal_of_session({0.035, 2.8, value}),
                HasSubstr("calibration.lens.focus_distance_m"))
        << value;
  for (const double value : {0.0, -1.0, inf, std::nan("")})
    EXPECT_THAT(refusal_of_session({value, 2.8, 1}), HasSubstr("calibration.lens.focal_length_m"))
        << value;
}

}  // namespace previz::test::lens_test
