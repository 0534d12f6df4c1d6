// Pictures of another renderer, Mitsuba 3, read from outside the repository: the files of
// mitsuba-renderer/mitsuba-data on GitHub, in the folder "mitsuba-data" of the shared data. Its
// scenes are written down here by hand; its pictures come with the variance of a sample.
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

#include "daemon/lighting/exr_picture.hpp"
#include "tests/support/render_fixture.hpp"
#include "tests/support/shared_data.hpp"

namespace previz::test::third_party_test {

using std::numbers::pi;

constexpr int side = 48;
constexpr int seeds = 16, samples = 64;
// Its scene files say so; nobody says with how many the references were rendered.
constexpr double reference_samples = 128;

struct Reference {
  lighting::LinearPicture mean, variance;
};

Reference reference(const std::filesystem::path& folder, const std::string& name) {
  std::vector<std::string> notes;
  const std::filesystem::path stem = folder / "tests/scenes" / name;
  return {lighting::read_exr_picture(stem.string() + "_ref_rgb.exr", notes),
          lighting::read_exr_picture(stem.string() + "_ref_rgb_var.exr", notes)};
}

// The means over some pixels, ours and theirs, and the standard error of their difference.
struct Compared {
  glm::dvec3 ours{0}, theirs{0}, error{0};
  int pixels = 0;
};

// A part of a picture: pixels whose centre is at most `radius` from (x, y), in pixels.
struct Disc {
  double x, y, radius;
  bool has(int i, int j) const { return std::hypot(i - x, j - y) <= radius; }
};

class Pictures {
 public:
  Pictures(const View& view, Reference reference) : reference_(std::move(reference)) {
    // Its scenes end a path at the second surface; so light comes straight from what emits.
    SetRenderer renderer(view, up_to_depth(1));
    for (std::uint32_t seed = 1; seed <= seeds; ++seed) {
      renderer.begin({{}, 1.0, view.world_from_camera, seed});
      renderer.render(samples);
      ours_.push_back(renderer.layers().mixed);
    }
    expect_clean(renderer.counters());
  }

  Compared compare(const Disc& disc) const {
    Compared result;
    std::vector<glm::dvec3> means(seeds);
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i) {
        if (!disc.has(i, j)) continue;
        const auto p = static_cast<std::size_t>(j * side + i);
        ++result.pixels;
        for (std::size_t s = 0; s < seeds; ++s) means[s] += glm::dvec3(ours_[s][p]);
        result.theirs += glm::dvec3(reference_.mean.radiance[p]);
        result.error +=
            glm::max(glm::dvec3(reference_.variance.radiance[p]), 0.0) / reference_samples;
      }
    const double n = result.pixels;
    glm::dvec3 squares(0);
    for (const glm::dvec3& mean : means) {
      result.ours += mean / (n * seeds);
      squares += mean * mean / (n * n * seeds);
    }
    result.theirs /= n;
    result.error = glm::sqrt(result.error / (n * n) +
                             (glm::max(squares - result.ours * result.ours, 0.0)) / (seeds - 1.0));
    return result;
  }

 private:
  Reference reference_;
  std::vector<std::vector<glm::vec3>> ours_;
};

// `share` is what may differ beyond the noise, because of what the models have apart.
void expect_equal(const Pictures& pictures, const Disc& disc, double share, const char* what) {
  const Compared c = pictures.compare(disc);
  ASSERT_GT(c.pixels, 0);
  for (int k = 0; k < 3; ++k) {
    SCOPED_TRACE(std::string(what) + ", channel " + std::to_string(k));
    EXPECT_NEAR(c.ours[k], c.theirs[k], 4 * c.error[k] + share * c.theirs[k]);
  }
}

// Mitsuba's camera without a field of view has a film of 36 mm x 24 mm behind 50 mm, whose diagonal
// is the picture's.
ObserverCalibration camera() {
  const double half_diagonal = std::hypot(36, 24) / 2 / 50;
  return pinhole(side, side, 2 * std::atan(half_diagonal / std::sqrt(2)));
}

// Two rows of five unit spheres, three apart; they stand in each other's light. Only those that the
// pictures are compared at have their materials.
View sphere_grid() {
  View view;
  const auto sphere = add_mesh(view.scene, icosphere_mesh(1, 5));
  const auto add = [&](double y, double z, const scene::Material& material) {
    add_instance(view.scene, sphere, add_material(view.scene, material),
                 glm::translate(glm::dmat4(1), {0, y, z}));
  };
  scene::Material frosted = glass(1.5046f);
  frosted.roughness = static_cast<float>(std::sqrt(0.1));
  constexpr float eta = 0.789f, k = 6.15f;
  const float f0 = ((eta - 1) * (eta - 1) + k * k) / ((eta + 1) * (eta + 1) + k * k);
  add(-6, 0, diffuse({0.2f, 0.5f, 0.3f}));
  for (const double y : {-3.0, 0.0, 3.0, 6.0}) add(y, 0, diffuse(glm::vec3(0.5f)));
  for (const double y : {-6.0, 0.0, 3.0}) add(y, 3, diffuse(glm::vec3(0.5f)));
  add(-3, 3, metal(glm::vec3(f0), 0));
  add(6, 3, frosted);
  // Two leaves are cut out of squares, but what passes beside them counts as a surface there, so
  // that to the light of one they are whole.
  const scene::Material leaf = diffuse({0.1f, 0.8f, 0.1f});
  const auto square = add_mesh(view.scene, rectangle_mesh({2, 2}));
  for (const double y : {-6.0, -3.0})
    add_instance(view.scene, square, add_material(view.scene, leaf),
                 glm::rotate(glm::translate(glm::dmat4(1), {0, y, -3}), -pi / 2, {0, 1, 0}));
  view.environment = uniform_environment(glm::vec3(0));
  view.calibration = camera();
  view.world_from_camera = look_at({-24, 0, 0}, {0, 0, 0});
  return view;
}

// The part of the picture that shows the middle of the sphere at (0, y, z).
Disc middle_of(double y, double z) {
  const PinholeIntrinsics lens = camera().intrinsics;
  // The camera looks along +X with Z up, so that +Y is to the left.
  return {lens.cx - lens.fx * y / 24, lens.cy - lens.fy * z / 24, 0.8 * lens.fx / 24};
}

class Mitsuba : public testing::Test {
 protected:
  void SetUp() override { PREVIZ_NEEDS(folder_); }
  const std::filesystem::path folder_ = shared_data("mitsuba-data");
};

TEST_F(Mitsuba, ADistantLightOnAPlaneAndASphere) {
  View view;
  add_instance(view.scene, add_mesh(view.scene, rectangle_mesh({2, 2})),
               add_material(view.scene, diffuse(glm::vec3(1))));
  add_instance(view.scene, add_mesh(view.scene, icosphere_mesh(0.1, 5)),
               add_material(view.scene, diffuse(glm::vec3(1))),
               glm::translate(glm::dmat4(1), {0, 0, 1}));
  view.environment = uniform_environment(glm::vec3(0));
  view.scene.lights.push_back(lamp(set::LightType::directional));
  view.scene.lights.back().direction = {0, 0, -1};
  view.calibration = camera();
  view.world_from_camera = look_at({0, -5, 1}, {0, 0, 0.5});
  const Pictures pictures(view, reference(folder_, "floating_sphere/refs/test_directional"));
  expect_equal(pictures, {23.5, 23.5, 100}, 0.002, "all");
}

TEST_F(Mitsuba, SpheresUnderAPointLight) {
  View view = sphere_grid();
  view.scene.lights.push_back(lamp(set::LightType::point, glm::dvec3(300)));
  view.scene.lights.back().position = {-4, 0, 6};
  const Pictures pictures(view, reference(folder_, "bsdf_spheres/refs/test_pointlight"));
  expect_equal(pictures, middle_of(-6, 0), 0.002, "diffuse");
  expect_equal(pictures, middle_of(6, 3), 0.02, "frosted glass");
}

TEST_F(Mitsuba, SpheresUnderAnEvenSky) {
  View view = sphere_grid();
  view.environment = uniform_environment(glm::vec3(1));
  const Pictures pictures(view, reference(folder_, "bsdf_spheres/refs/test_constant"));
  expect_equal(pictures, middle_of(-6, 0), 0.002, "diffuse");
  expect_equal(pictures, middle_of(-3, 3), 0.01, "metal");
  expect_equal(pictures, middle_of(6, 3), 0.02, "frosted glass");
}

// Its map has Y up, and its middle towards -Z.
glm::vec3 looked_up(const lighting::LinearPicture& map, const glm::dvec3& d) {
  double u = std::atan2(d.x, -d.z) / (2 * pi);
  u -= std::floor(u);
  const double x = u * map.width - 0.5,
               y = std::acos(std::clamp(d.y, -1.0, 1.0)) / pi * map.height - 0.5;
  const auto at = [&](double i, double j) {
    const int column = (static_cast<int>(i) + map.width) % map.width;
    const int row = std::clamp(static_cast<int>(j), 0, map.height - 1);
    return map.radiance[static_cast<std::size_t>(row) * static_cast<std::size_t>(map.width) +
                        static_cast<std::size_t>(column)];
  };
  const double i = std::floor(x), j = std::floor(y);
  const auto fx = static_cast<float>(x - i), fy = static_cast<float>(y - j);
  return glm::mix(glm::mix(at(i, j), at(i + 1, j), fx),
                  glm::mix(at(i, j + 1), at(i + 1, j + 1), fx), fy);
}

TEST_F(Mitsuba, SpheresInAMuseum) {
  std::vector<std::string> notes;
  const lighting::LinearPicture map =
      lighting::read_exr_picture(folder_ / "common/textures/museum.exr", notes);
  View view = sphere_grid();
  constexpr int size = 512, parts = 4;
  view.environment = {size, std::vector<glm::vec3>(std::size_t{size} * size)};
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i)
      for (int b = 0; b < parts; ++b)
        for (int a = 0; a < parts; ++a)
          view.environment.radiance[static_cast<std::size_t>(j * size + i)] +=
              looked_up(map, glm::dvec3(lighting::texel_direction(size * parts, i * parts + a,
                                                                  j * parts + b))) /
              float(parts * parts);
  const Pictures pictures(view, reference(folder_, "bsdf_spheres/refs/test_envmap"));
  expect_equal(pictures, middle_of(-6, 0), 0.005, "diffuse");
  expect_equal(pictures, middle_of(-3, 3), 0.01, "metal");
  expect_equal(pictures, middle_of(6, 3), 0.02, "frosted glass");
  expect_equal(pictures, {23.5, 42, 4}, 0.005, "what is behind");
}

}  // namespace previz::test::third_party_test
