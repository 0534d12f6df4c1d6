// What an environment's picture may be besides a latitude-longitude OpenEXR: Radiance .hdr, a cube
// cross; and what is said about everything else.
#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/lighting/picture_file.hpp"
#include "tests/support/lighting.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::picture_formats_test {

using std::numbers::pi;

using Rgbe = std::array<int, 4>;
using Sky = previz::test::Sky;

class PictureFormats : public testing::Test {
 protected:
  Lighting load(const std::string& bytes, double turn_rad = 0, int resolution = 0) {
    std::ofstream(file_, std::ios::binary) << bytes;
    return load_file(turn_rad, resolution);
  }
  Lighting load(const LinearPicture& picture, double turn_rad = 0, int resolution = 0) {
    write_exr_picture(file_, picture);
    return load_file(turn_rad, resolution);
  }
  template <typename Picture>
  std::string refusal(const Picture& picture) {
    return test::error_of([&] { load(picture); });
  }

 private:
  Lighting load_file(double turn_rad, int resolution) {
    set::Lighting settings;
    settings.environment = file_;
    settings.environment_rotation_rad = turn_rad;
    settings.resolution = resolution;
    return load_environment(settings);
  }

  previz::test::TemporaryDirectory directory_;
  // The name says nothing: the content is what counts.
  std::filesystem::path file_ = directory_ / "sky.exr";
};

std::string with_header(const std::string& size, const std::string& variables = "",
                        const std::string& magic = "#?RADIANCE") {
  return magic + "\n# made by a test\n" + variables + "FORMAT=32-bit_rle_rgbe\n\n" + size + "\n";
}
std::string bytes_of(const std::vector<int>& values) {
  return {values.begin(), values.end()};
}
std::string flat(int count, const Rgbe& pixel) {
  std::string bytes;
  for (int i = 0; i < count; ++i) bytes += bytes_of({pixel.begin(), pixel.end()});
  return bytes;
}

void expect_even(const Lighting& lighting, const glm::vec3& radiance) {
  for (const glm::vec3& texel : lighting.environment.radiance)
    ASSERT_LE(glm::length(texel - radiance), 1e-5f * glm::length(radiance));
}

// (128, 64, 32) 2^(129 - 136) = (1, 0.5, 0.25), and zero exponent is black.
TEST_F(PictureFormats, RadiancePixelsAreReadHoweverTheyArePacked) {
  const std::string size = "-Y 8 +X 16";
  const Rgbe grey{128, 64, 32, 129};
  const glm::vec3 expected(1, 0.5, 0.25);
  const Lighting plain = load(with_header(size) + flat(128, grey));
  expect_even(plain, expected);
  EXPECT_TRUE(plain.report.notes.empty());
  expect_even(load(with_header(size, "", "#?RGBE") + flat(128, grey)), expected);
  std::string older, newer;
  for (int y = 0; y < 8; ++y) {
    older += flat(2, grey) + flat(1, {1, 1, 1, 14});
    newer += bytes_of({2, 2, 0, 16});
    newer += bytes_of({128 + 16, 128});                            // one run
    newer += bytes_of({128 + 10, 64, 6, 64, 64, 64, 64, 64, 64});  // a run, and six values
    newer += bytes_of({128 + 16, 32, 128 + 16, 129});
  }
  expect_even(load(with_header(size) + older), expected);
  expect_even(load(with_header(size) + newer), expected);
  expect_even(load(with_header(size) + flat(128, {128, 128, 128, 0})), glm::vec3(0));
  // The run of a line of 600 pixels needs two counts: 599 = 2 * 256 + 87.
  std::string long_lines;
  for (int y = 0; y < 300; ++y)
    long_lines += flat(1, grey) + flat(1, {1, 1, 1, 87}) + flat(1, {1, 1, 1, 2});
  expect_even(load(with_header("-Y 300 +X 600") + long_lines), expected);
}

// The values were multiplied by 4 = 2 * 2, then red by 2 and blue by 0.5: 1 / 8, 0.5 / 4, 0.25 / 2.
TEST_F(PictureFormats, ExposureAndColourCorrectionAreDividedOut) {
  const Lighting lighting =
      load(with_header("-Y 8 +X 16", "EXPOSURE=2\nEXPOSURE= 2.0\nCOLORCORR= 2 1 0.5\n") +
           flat(128, {128, 64, 32, 129}));
  expect_even(lighting, glm::vec3(0.125f));
  EXPECT_THAT(lighting.report.notes, ElementsAre(HasSubstr("8, 4 and 2 times as bright")));
}

// Whichever program it names.
TEST_F(PictureFormats, AnyProgramsRadianceFileIsRead) {
  for (const char* magic : {"#?rgbe", "#?RGBE", "#?", "#?Autopano", "#?radiance"}) {
    const Lighting lighting =
        load(with_header("-Y 8 +X 16", "", magic) + flat(128, {128, 64, 32, 129}));
    expect_even(lighting, {1, 0.5, 0.25});
    EXPECT_THAT(lighting.report.notes, IsEmpty()) << magic;
  }
}

// The matrix of Rec. 2020 is that of ITU-R BT.2087, to four digits.
TEST_F(PictureFormats, OtherPrimariesOfRadianceAreConverted) {
  const auto with_primaries = [&](const char* numbers, const Rgbe& pixel = {128, 64, 32, 129}) {
    return load(with_header("-Y 8 +X 16", "PRIMARIES=" + std::string(numbers) + "\n") +
                flat(128, pixel));
  };
  const auto expect_near = [](const Lighting& lighting, const glm::vec3& radiance) {
    for (const glm::vec3& texel : lighting.environment.radiance)
      ASSERT_LT(glm::length(texel - radiance), 3e-4f);
    EXPECT_THAT(lighting.report.notes, ElementsAre(HasSubstr("white to white")));
  };
  // Photoshop's, and those of Rec. 709.
  for (const char* numbers :
       {"0 0 0 0 0 0 0 0", " 0.6400 0.3300 0.3000 0.6000 0.1500 0.0600 0.3127 0.3290"}) {
    const Lighting lighting = with_primaries(numbers);
    expect_even(lighting, {1, 0.5, 0.25});
    EXPECT_THAT(lighting.report.notes, IsEmpty()) << numbers;
  }
  expect_near(with_primaries("0.708 0.292 0.170 0.797 0.131 0.046 0.3127 0.3290"),
              {1.6605 - 0.5876 * 0.5 - 0.0728 * 0.25, -0.1246 + 1.1329 * 0.5 - 0.0083 * 0.25,
               -0.0182 - 0.1006 * 0.5 + 1.1187 * 0.25});
  // Its green has a red of -0.5876 and a blue of -0.1006.
  const Lighting green =
      with_primaries("0.708 0.292 0.170 0.797 0.131 0.046 0.3127 0.3290", {0, 128, 0, 129});
  for (const glm::vec3& texel : green.environment.radiance)
    ASSERT_LT(glm::length(texel - glm::vec3(0, 1.1329f, 0)), 3e-4f);
  EXPECT_THAT(green.report.notes, ElementsAre(HasSubstr("white to white"),
                                              HasSubstr("128 of 128 pixels are more saturated")));
  // Radiance's own, whose white has equal energy.
  const char* radiance = "0.640 0.330 0.290 0.600 0.150 0.060 0.333 0.333";
  expect_near(with_primaries(radiance, {128, 128, 128, 129}), glm::vec3(1));
  EXPECT_THAT(with_primaries("1 2 3").report.notes, ElementsAre(HasSubstr("span no colours")));
  // XYZ, whose white has equal energy, too.
  expect_near(
      load("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 8 +X 16\n" + flat(128, {128, 128, 128, 129})),
      glm::vec3(1));
}

TEST_F(PictureFormats, RadiancePixelsThatAreNotSquareAreStretched) {
  const Lighting lighting =
      load(with_header("-Y 16 +X 16", "PIXASPECT=0.5\n") + flat(256, {128, 64, 32, 129}));
  expect_even(lighting, {1, 0.5, 0.25});
  EXPECT_THAT(lighting.report.notes, ElementsAre(HasSubstr("2 times as wide as high")));
}

TEST_F(PictureFormats, ATooLargeRadiancePictureIsReadByItsMeans) {
  const previz::test::TemporaryDirectory directory;
  const std::filesystem::path file = directory / "sky.hdr";
  // Columns of 1 and 0.5, rows of the same brightness, from below.
  std::string bytes = with_header("+Y 8 +X 16");
  for (int i = 0; i < 64; ++i)
    bytes += flat(1, {128, 128, 128, 129}) + flat(1, {128, 128, 128, 128});
  std::ofstream(file, std::ios::binary) << bytes;
  std::vector<std::string> notes;
  const LinearPicture picture = read_linear_picture(file, notes, 32);
  ASSERT_EQ(picture.width, 8);
  ASSERT_EQ(picture.height, 4);
  for (const glm::vec3& pixel : picture.radiance) EXPECT_EQ(pixel, glm::vec3(0.75f));
  EXPECT_THAT(notes, ElementsAre(HasSubstr("sky.hdr: has 16x8 pixels, which are read as 8x4")));
}

// A world with every direction another colour, none of whose channels is zero.
glm::dvec3 smooth_world(const glm::dvec3& d) {
  return 0.5 * d + 0.6 + 0.1 * glm::dvec3(d.y * d.z, d.z * d.x, d.x * d.y);
}

LinearPicture latitude_longitude(int width, const Sky& sky) {
  LinearPicture picture{width, width / 2, {}};
  for (int y = 0; y < width / 2; ++y)
    for (int x = 0; x < width; ++x)
      picture.radiance.emplace_back(sky(previz::test::towards(
          360 * (0.5 - (x + 0.5) / width), 180 * (0.5 - (y + 0.5) / (0.5 * width)))));
  return picture;
}

std::string rgbe(const glm::vec3& radiance) {
  int exponent = 0;
  std::frexp(std::max({radiance.r, radiance.g, radiance.b}), &exponent);
  const auto mantissa = [&](float value) {
    return static_cast<int>(std::ldexp(value, 8 - exponent));
  };
  return bytes_of(
      {mantissa(radiance.r), mantissa(radiance.g), mantissa(radiance.b), exponent + 128});
}

// Written in every order of pixels, the same picture gives the same light.
TEST_F(PictureFormats, RadiancePicturesAreTurnedUpright) {
  constexpr int width = 64, height = 32;
  const LinearPicture upright = latitude_longitude(width, smooth_world);
  const auto written = [&](bool by_columns, bool from_left, bool from_top) {
    std::string bytes;
    for (int line = 0; line < (by_columns ? width : height); ++line)
      for (int place = 0; place < (by_columns ? height : width); ++place) {
        const int x = by_columns ? line : place, y = by_columns ? place : line;
        bytes += rgbe(upright.radiance[static_cast<std::size_t>(
            (from_top ? y : height - 1 - y) * width + (from_left ? x : width - 1 - x))]);
      }
    const std::string across = (from_left ? "+X " : "-X ") + std::to_string(width);
    const std::string down = (from_top ? "-Y " : "+Y ") + std::to_string(height);
    return with_header(by_columns ? across + " " + down : down + " " + across) + bytes;
  };
  const auto expected = load(written(false, true, true)).environment.radiance;
  // A mantissa is off by up to 2^-7 of the brightest channel, 1.2; where the map interpolates, as
  // well.
  const auto exact = load(upright).environment.radiance;
  for (std::size_t i = 0; i < exact.size(); ++i)
    ASSERT_LT(glm::length(exact[i] - expected[i]), 1.8f * 1.2f / 128);
  for (const bool by_columns : {false, true})
    for (const bool from_left : {false, true})
      for (const bool from_top : {false, true})
        EXPECT_EQ(load(written(by_columns, from_left, from_top)).environment.radiance, expected)
            << by_columns << from_left << from_top;
}

TEST_F(PictureFormats, DamagedRadianceFilesAreRefusedByName) {
  const std::string pixels = flat(128, {128, 64, 32, 129});
  const std::string size = "-Y 8 +X 16";
  const std::pair<std::string, const char*> damages[] = {
      {with_header(size) + pixels.substr(0, 200),
       "sky.exr: cannot be read as Radiance .hdr: scan line 4 is cut off"},
      {with_header("-Y 65536 +X 131072"), "131072x65536 pixels; allowed: at most"},
      {with_header("-Y 8192 +X 16384"), "scan line 1 is cut off"},
      {with_header("-Y -8 +X 16") + pixels, "16x-8 pixels"},
      {with_header("-Y 8 +Y 16") + pixels, "its size is \"-Y 8 +Y 16\""},
      {"#?RADIANCE\nFORMAT=32-bit_rle_abcd\n\n-Y 8 +X 16\n" + pixels,
       "FORMAT is \"32-bit_rle_abcd"},
      {with_header(size, "PIXASPECT=0\n") + pixels, "\"PIXASPECT=0\" is not a pixel's aspect"},
      {with_header(size, "EXPOSURE=0\n") + pixels, "\"EXPOSURE=0\" is not a brightness factor"},
      {"#?RADIANCE\nFORMAT=32-bit_rle", "ends in its header"},
      {with_header(size) + bytes_of({2, 2, 0, 16, 128 + 17, 1}),
       "scan line 1 has a run that does not fit"},
      {with_header(size) + flat(128, {1, 1, 1, 3}), "scan line 1 has a"},
  };
  for (const auto& [bytes, words] : damages) EXPECT_THAT(refusal(bytes), HasSubstr(words));
}

TEST_F(PictureFormats, OtherFormatsAreRefusedByName) {
  EXPECT_THAT(refusal(std::string("\x89PNG\r\n\x1a\n")),
              AllOf(HasSubstr("sky.exr: is a PNG; an environment needs linear light"),
                    HasSubstr("OpenEXR (.exr) or Radiance (.hdr)"), HasSubstr("no brighter than")));
  EXPECT_THAT(refusal(std::string("\xff\xd8\xff\xe0")), HasSubstr("is a JPEG"));
  EXPECT_THAT(refusal(std::string("II*\0....", 8)), HasSubstr("oiiotool IN -o OUT.exr"));
  EXPECT_THAT(refusal(std::string("\xabKTX 20\xbb")), HasSubstr("is a KTX texture"));
  EXPECT_THAT(refusal(std::string("hello")), HasSubstr("is neither OpenEXR nor Radiance"));
  EXPECT_THAT(refusal(std::string()), HasSubstr("is empty"));
}

// HDRShop's crosses as one sees them from inside the cube: up above the middle face, down below it,
// left and right beside it. The last face of a vertical cross is upside down.
LinearPicture cross(bool vertical, int size, const Sky& sky, const glm::vec3& corners) {
  const int columns = vertical ? 3 : 4, rows = vertical ? 4 : 3;
  LinearPicture picture{columns * size, rows * size, {}};
  for (int y = 0; y < rows * size; ++y)
    for (int x = 0; x < columns * size; ++x) {
      const int column = x / size, row = y / size;
      const double to_right = (2 * (x % size) + 1.0) / size - 1;
      const double to_top = 1 - (2 * (y % size) + 1.0) / size;
      glm::dvec3 d(0);
      if (row == 1 && column == 1) d = {1, -to_right, to_top};
      if (row == 1 && column == 0) d = {to_right, 1, to_top};
      if (row == 1 && column == 2) d = {-to_right, -1, to_top};
      if (row == 1 && column == 3) d = {-1, to_right, to_top};
      if (row == 0 && column == 1) d = {-to_top, -to_right, 1};
      if (row == 2 && column == 1) d = {to_top, -to_right, -1};
      if (row == 3 && column == 1) d = {-1, -to_right, -to_top};
      picture.radiance.push_back(d == glm::dvec3(0) ? corners : glm::vec3(sky(glm::normalize(d))));
    }
  return picture;
}

TEST_F(PictureFormats, ACubeCrossShowsTheSameWorldAsALatitudeLongitudePicture) {
  for (const double turn_rad : {0.0, 2.0}) {
    const auto expected = load(latitude_longitude(256, smooth_world), turn_rad, 64).environment;
    for (const bool vertical : {true, false}) {
      const Lighting found = load(cross(vertical, 64, smooth_world, glm::vec3(0)), turn_rad, 64);
      EXPECT_THAT(found.report.notes, ElementsAre(HasSubstr(vertical ? "vertical cube cross"
                                                                     : "horizontal cube cross")));
      // A pixel of either picture is h = 2 / 64 wide or less; a tent over a pixel is off by h^2 / 4
      // of second derivatives, which are below 1.5 in sum; next to a pole by a pixel, with slope 1.
      for (std::size_t i = 0; i < expected.radiance.size(); ++i) {
        const bool at_a_pole =
            std::abs(texel_direction(64, static_cast<int>(i) % 64, static_cast<int>(i) / 64).z) >
            0.999;
        ASSERT_LT(glm::length(found.environment.radiance[i] - expected.radiance[i]),
                  at_a_pole ? 0.03f : 0.002f)
            << i << " " << vertical << " " << turn_rad;
      }
    }
  }
}

// The six directions of the world one by one: the middle of each face has its own colour.
TEST_F(PictureFormats, ACubeCrossIsTheRightWayAround) {
  const auto painted = [](const glm::dvec3& d) {
    glm::dvec3 color(1.5);
    for (int axis = 0; axis < 3; ++axis)
      if (std::abs(d[axis]) > 0.8) color[axis] += std::copysign(1.0, d[axis]);
    return color;
  };
  for (const bool vertical : {true, false}) {
    const EnvironmentMap map = load(cross(vertical, 32, painted, glm::vec3(0))).environment;
    for (const glm::vec3& axis : {glm::vec3(1, 0, 0), glm::vec3(-1, 0, 0), glm::vec3(0, 1, 0),
                                  glm::vec3(0, -1, 0), glm::vec3(0, 0, 1), glm::vec3(0, 0, -1)})
      EXPECT_LT(glm::length(map.radiance[texel_index(map.size, axis)] - (axis + 1.5f)), 1e-5f)
          << vertical << axis.x << axis.y << axis.z;
  }
}

// What lies beside the faces is no light and no damage.
TEST_F(PictureFormats, TheCornersOfACrossDoNotCount) {
  const auto grey = [](const glm::dvec3&) { return glm::dvec3(1); };
  LinearPicture picture = cross(true, 16, grey, glm::vec3(std::nanf("")));
  picture.radiance[16 * 48 + 16].g = std::nanf("");  // beside a corner, in the middle face
  const Lighting lighting = load(picture);
  expect_even(lighting, glm::vec3(1));
  ASSERT_EQ(lighting.report.notes.size(), 2u);
  EXPECT_THAT(lighting.report.notes[0], HasSubstr("1 of 1536 pixels"));
  EXPECT_EQ(refusal(LinearPicture{4, 3, std::vector<glm::vec3>(12, glm::vec3(0.5f))}), "");
}

TEST_F(PictureFormats, OtherShapesAreRefusedWithARemedy) {
  const auto of_size = [](int width, int height) {
    LinearPicture picture{width, height, {}};
    for (int i = 0; i < width * height; ++i)
      picture.radiance.emplace_back(static_cast<float>(i % 97));
    return picture;
  };
  EXPECT_THAT(refusal(of_size(40, 30)), HasSubstr("nothing but one colour in its corners"));
  EXPECT_THAT(refusal(of_size(32, 32)), AllOf(HasSubstr("mirror ball, an angular map or a fisheye"),
                                              HasSubstr("HDRShop"), HasSubstr("Hugin")));
  EXPECT_THAT(refusal(of_size(96, 16)), HasSubstr("strip of six cube faces"));
  EXPECT_THAT(refusal(of_size(16, 96)), HasSubstr("strip of six cube faces"));
  EXPECT_THAT(refusal(of_size(65, 33)), HasSubstr("65x33 pixels"));
}

// A map far coarser than the picture keeps its light, although it meets fewer samples: each of the
// picture's pixels is in the mean of one that the map then samples, weighted by its solid angle.
// The sun fills such a pixel of 1/8 texel in part, and a row's midpoints weigh it wrongly by the
// square of its width in radians (0.44 / 8)^2 / 24, and the sums over tents by 1/6 of (1/4.4)^2.
TEST_F(PictureFormats, ACoarseMapOfAFinePictureKeepsItsFlux) {
  const auto sunny = [](const glm::dvec3& d) {
    return smooth_world(d) + (d.x > 0.9 && d.z > 0.2 ? 500.0 : 0.0);
  };
  for (const int width : {1022, 1024}) {
    const LinearPicture picture = latitude_longitude(width, sunny);
    const glm::dvec3 fine = total_flux(load(picture, 1).environment);
    const glm::dvec3 coarse = total_flux(load(picture, 1, 8).environment);
    EXPECT_LT(glm::length(coarse / fine - 1.0), 0.01) << width;
  }
  const LinearPicture faces = cross(true, 255, sunny, glm::vec3(0));
  const glm::dvec3 fine = total_flux(load(faces, 1).environment);
  EXPECT_LT(glm::length(total_flux(load(faces, 1, 8).environment) / fine - 1.0), 0.01);
}

}  // namespace previz::lighting::picture_formats_test
