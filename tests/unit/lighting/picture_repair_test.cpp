// Pixels of an environment that hold no radiance: the sun of a file that overflowed, and damage.
#include "daemon/core/lighting/lighting.hpp"
#include "tests/support/lighting.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::picture_repair_test {

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float not_a_number = std::numeric_limits<float>::quiet_NaN();

class PictureRepair : public testing::Test {
 protected:
  Lighting load(const LinearPicture& picture, double gain = 1, bool is_half = false) {
    write_exr_picture(directory_ / "sky.exr", picture, is_half);
    set::Lighting settings;
    settings.environment = directory_ / "sky.exr";
    settings.environment_gain = gain;
    return load_environment(settings);
  }
  std::string refusal(const LinearPicture& picture, double gain = 1) {
    return test::error_of([&] { load(picture, gain); });
  }
  // Expects the two pictures to give the same light, and returns the first one's notes.
  std::vector<std::string> expect_like(const LinearPicture& picture,
                                       const LinearPicture& expected) {
    const Lighting lighting = load(picture);
    EXPECT_EQ(lighting.environment.radiance, load(expected).environment.radiance);
    return lighting.report.notes;
  }

 private:
  previz::test::TemporaryDirectory directory_;
};

LinearPicture grey_sky() {
  return {64, 32, std::vector<glm::vec3>(64 * 32, glm::vec3(1))};
}
glm::vec3& pixel(LinearPicture& picture, int x, int y) {
  return picture.radiance[static_cast<std::size_t>(y * picture.width + x)];
}

// A sun that overflowed is the brightest that a half can say, (2 - 2^-10) 2^15 = 65504.
TEST_F(PictureRepair, ASunThatOverflowedIsTheLargestHalf) {
  LinearPicture sky = grey_sky(), expected = grey_sky();
  pixel(sky, 20, 9) = glm::vec3(infinity);
  pixel(sky, 21, 9) = glm::vec3(infinity, 5, 4);  // each channel for itself
  pixel(expected, 20, 9) = glm::vec3(65504);
  pixel(expected, 21, 9) = glm::vec3(65504, 5, 4);
  const Lighting halves = load(sky, 1, true);
  EXPECT_EQ(halves.environment.radiance, load(expected, 1, true).environment.radiance);
  EXPECT_EQ(total_flux(halves.environment), total_flux(load(expected, 1, true).environment));
  EXPECT_THAT(
      halves.report.notes,
      ElementsAre(AllOf(HasSubstr("2 of 2048 pixels are brighter than the file could store"),
                        HasSubstr("set to 65504"), HasSubstr("x = 20, y = 9"))));
  EXPECT_EQ(expect_like(sky, expected).size(), 1u);  // halves that were converted to floats
}

// A file of floats that goes beyond halves has not overflowed as one.
TEST_F(PictureRepair, ASunAmongFloatsIsAsBrightAsTheBrightest) {
  LinearPicture sky = grey_sky(), expected = grey_sky();
  for (LinearPicture* picture : {&sky, &expected}) pixel(*picture, 40, 9) = glm::vec3(2, 3e6f, 2);
  pixel(sky, 20, 9) = glm::vec3(infinity);
  pixel(expected, 20, 9) = glm::vec3(3e6f);
  expect_like(sky, expected);
}

// 3e38 can be stored, but its square and the sum of two such texels cannot.
TEST_F(PictureRepair, NoFiniteValueBlindsTheRest) {
  LinearPicture sky = grey_sky(), expected = grey_sky();
  pixel(sky, 20, 9) = glm::vec3(3e38f, 1, 1);
  pixel(sky, 30, 9) = glm::vec3(1, std::numeric_limits<float>::max(), 1);
  pixel(expected, 20, 9) = glm::vec3(65504, 1, 1);
  pixel(expected, 30, 9) = glm::vec3(1, 65504, 1);
  EXPECT_THAT(expect_like(sky, expected),
              ElementsAre(AllOf(HasSubstr("2 of 2048 pixels"), HasSubstr("above 1e12"))));
}

// 1e10 is light by itself, the sun's disc in cd/m^2, but not 1e10 times as much.
TEST_F(PictureRepair, AGainThatCannotBeSummedIsRefused) {
  LinearPicture sky = grey_sky();
  for (glm::vec3& radiance : sky.radiance) radiance = glm::vec3(1e10f);
  EXPECT_TRUE(load(sky).report.notes.empty());
  EXPECT_THAT(refusal(sky, 1e10), HasSubstr("lighting.environment_gain: with 1e+10"));
  EXPECT_THAT(refusal(sky, 1e300), HasSubstr("make the gain smaller"));
}

// The median of the eight neighbours, or of those that are good; the left edge joins the right.
TEST_F(PictureRepair, WhatHoldsNoBrightnessComesFromItsNeighbours) {
  LinearPicture sky = grey_sky();
  for (const int y : {4, 5, 6}) pixel(sky, 63, y).r = 9;
  for (const int y : {4, 6}) pixel(sky, 0, y).r = 9;
  pixel(sky, 11, 9) = glm::vec3(1, 1, 17);
  LinearPicture expected = sky;
  pixel(sky, 0, 5) = glm::vec3(not_a_number, 1, 1);
  pixel(expected, 0, 5) = glm::vec3(9, 1, 1);  // five of eight, three of them over the edge
  pixel(sky, 10, 9) = glm::vec3(1, 1, -infinity);
  pixel(expected, 10, 9) = glm::vec3(1, 1, 1);  // seven of eight: a lamp beside it is not doubled
  EXPECT_THAT(expect_like(sky, expected),
              ElementsAre(AllOf(HasSubstr("2 of 2048 pixels hold no brightness"),
                                HasSubstr("x = 0, y = 5"))));
}

// A filter that overshoots beside a lamp leaves negative pixels. Those of Blender's studio lights
// would add 4 % to all light if they took their neighbours' mean.
TEST_F(PictureRepair, NegativeLightIsThatOfTheDarkestNeighbour) {
  LinearPicture sky = grey_sky(), expected = grey_sky();
  for (LinearPicture* picture : {&sky, &expected}) {
    pixel(*picture, 30, 9) = glm::vec3(4000);
    pixel(*picture, 32, 10).r = 0.5f;
  }
  pixel(sky, 31, 9) = glm::vec3(-30, 1, -20);
  pixel(expected, 31, 9) = glm::vec3(0.5f, 1, 1);
  EXPECT_THAT(expect_like(sky, expected),
              ElementsAre(AllOf(HasSubstr("1 of 2048 pixels is negative and is filled"),
                                HasSubstr("x = 31, y = 9"))));
}

// Red that fades out towards a lamp whose colour is out of gamut: no red comes in from around.
TEST_F(PictureRepair, AnAreaThatIsOutOfGamutStaysDark) {
  LinearPicture sky = grey_sky(), expected = grey_sky();
  for (int y = 10; y < 20; ++y)
    for (int x = 10; x < 20; ++x) {
      const int inside =
          std::min({x - 10, 19 - x, y - 10, 19 - y});  // 0 at the border, then up to 4
      pixel(sky, x, y).r = 0.01f - 0.02f * static_cast<float>(inside);
      pixel(expected, x, y).r = 0.01f;
    }
  expect_like(sky, expected);
}

TEST_F(PictureRepair, AHoleIsFilledFromItsBorderInwards) {
  LinearPicture sky = grey_sky();
  for (int y = 0; y < 8; ++y)
    for (int x = -10; x < 20; ++x) pixel(sky, (x + 64) % 64, y) = glm::vec3(not_a_number);
  EXPECT_THAT(expect_like(sky, grey_sky()), ElementsAre(HasSubstr("240 of 2048 pixels")));
  // A sun that overflowed beside damage counts as good: it is 65504 before holes are filled. Three
  // neighbours of the hole are 1, of the five others each is a sun.
  sky = grey_sky();
  LinearPicture expected = grey_sky();
  pixel(sky, 30, 9).r = not_a_number;
  pixel(expected, 30, 9).r = 65504;
  for (const int y : {8, 9, 10}) {
    pixel(sky, 31, y).r = infinity;
    pixel(expected, 31, y).r = 65504;
  }
  for (const int y : {8, 10}) {
    pixel(sky, 30, y).r = infinity;
    pixel(expected, 30, y).r = 65504;
  }
  EXPECT_EQ(expect_like(sky, expected).size(), 2u);
}

TEST_F(PictureRepair, APictureWithoutAnyBrightnessIsRefused) {
  LinearPicture sky = grey_sky();
  for (glm::vec3& radiance : sky.radiance) radiance.g = not_a_number;
  EXPECT_THAT(refusal(sky), HasSubstr("sky.exr: no pixel's green holds a brightness"));
}

}  // namespace previz::lighting::picture_repair_test
