// What OpenEXR files say of their colours, windows and channels, and what becomes of it.
#include <ImfChannelList.h>
#include <ImfChromaticities.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>

#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/lighting/picture_file.hpp"
#include "tests/support/lighting.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::environment_exr_test {

using Matrix = std::array<double, 9>;

// Colour by column and row of the display window.
using Paint = std::function<glm::vec3(int x, int y)>;

Paint plain(const glm::vec3& color) {
  return [=](int, int) { return color; };
}

class ExrEnvironment : public testing::Test {
 protected:
  void write(const Imf::Header& from, const Paint& paint,
             const std::array<const char*, 3>& names = {"R", "G", "B"}) {
    Imf::Header header = from;
    const Imath::Box2i window = header.dataWindow();
    const auto width = static_cast<std::size_t>(window.max.x - window.min.x + 1);
    std::vector<glm::vec3> pixels;
    for (int y = window.min.y; y <= window.max.y; ++y)
      for (int x = window.min.x; x <= window.max.x; ++x) pixels.push_back(paint(x, y));
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < 3; ++c) {
      header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
      buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, &pixels[0][static_cast<int>(c)], window,
                                               sizeof(glm::vec3), sizeof(glm::vec3) * width));
    }
    Imf::OutputFile output(file.c_str(), header);
    output.setFrameBuffer(buffer);
    output.writePixels(window.max.y - window.min.y + 1);
  }

  LinearPicture read(std::int64_t most_kept = most_kept_pixels) {
    notes.clear();
    return read_linear_picture(file, notes, most_kept);
  }
  Lighting load() {
    set::Lighting settings;
    settings.environment = file;
    return load_environment(settings);
  }
  std::string refusal() {
    return test::error_of([&] { load(); });
  }

  // A sky of this colour is read as the matrix makes it, and `words` are in the only note.
  void expect_converted(const Matrix& m, const std::string& words,
                        const glm::dvec3& color = {0.4, 0.3, 0.1}) {
    const glm::dvec3 expected(m[0] * color.r + m[1] * color.g + m[2] * color.b,
                              m[3] * color.r + m[4] * color.g + m[5] * color.b,
                              m[6] * color.r + m[7] * color.g + m[8] * color.b);
    for (const glm::vec3& pixel : read().radiance)
      ASSERT_LT(glm::length(glm::dvec3(pixel) - expected), 5e-4) << words;
    EXPECT_THAT(notes, ElementsAre(HasSubstr(words)));
  }

  previz::test::TemporaryDirectory directory;
  const std::filesystem::path file = directory / "sky.exr";
  std::vector<std::string> notes;
};

// Published, to four or five digits: Academy TB-2014-004 with Bradford, ITU-R BT.2087, SMPTE EG
// 432-1, Adobe RGB (1998) and IEC 61966-2-1. A sum of three colours of 0.4 is off by 2e-4.
constexpr Matrix unit = {1, 0, 0, 0, 1, 0, 0, 0, 1};
constexpr Matrix of_ap1 = {1.70505,  -0.62179, -0.08326, -0.13026, 1.14080,
                           -0.01055, -0.02400, -0.12897, 1.15297};
constexpr Matrix of_ap0 = {2.52169,  -1.13413, -0.38756, -0.27648, 1.37272,
                           -0.09624, -0.01538, -0.15298, 1.16835};
constexpr Matrix of_rec2020 = {1.6605,  -0.5876, -0.0728, -0.1246, 1.1329,
                               -0.0083, -0.0182, -0.1006, 1.1187};
constexpr Matrix of_p3 = {1.2249, -0.2247, 0, -0.0420, 1.0419, 0, -0.0197, -0.0786, 1.0979};
constexpr Matrix of_adobe = {1.39836, -0.39836, 0, 0, 1, 0, 0, -0.04293, 1.04293};
constexpr Matrix of_xyz = {3.2410, -1.5374, -0.4986, -0.9692, 1.8760,
                           0.0416, 0.0556,  -0.2040, 1.0570};

const Imf::Chromaticities ap1_chromaticities({0.713f, 0.293f}, {0.165f, 0.830f}, {0.128f, 0.044f},
                                             {0.32168f, 0.33767f});

Imf::Header header_of(int width = 64, int height = 32) {
  Imf::Header header(width, height);
  header.compression() = Imf::ZIP_COMPRESSION;
  return header;
}
Imf::Header naming(const char* attribute, const std::string& value) {
  Imf::Header header = header_of();
  header.insert(attribute, Imf::StringAttribute(value));
  return header;
}

TEST_F(ExrEnvironment, ALinearSpaceByNameIsConvertedWhiteToWhite) {
  struct Case {
    const char* attribute;
    const char* name;
    const Matrix& matrix;
    const char* words;
  };
  for (const auto& [attribute, name, matrix, words] :
       {Case{"colorInteropID", "lin_ap1_scene", of_ap1, "is ACEScg (by colorInteropID"},
        {"colorInteropID", "lin_ap0_scene", of_ap0, "is ACES2065-1"},
        {"colorInteropID", "lin_rec2020_scene", of_rec2020, "is linear Rec. 2020"},
        {"colorInteropID", "lin_p3d65_scene", of_p3, "is linear P3-D65"},
        {"colorInteropID", "lin_adobergb_scene", of_adobe, "is linear Adobe RGB"},
        {"colorInteropID", "lin_ciexyzd65_scene", of_xyz, "is CIE XYZ"},
        {"oiio:ColorSpace", "lin_ap1", of_ap1, "is ACEScg (by oiio:ColorSpace \"lin_ap1\")"},
        {"oiio:ColorSpace", "ACEScg", of_ap1, "is ACEScg"},
        {"oiio:ColorSpace", "ACES - ACEScg", of_ap1, "is ACEScg"},
        {"oiio:ColorSpace", "ACES2065-1", of_ap0, "is ACES2065-1"},
        {"oiio:ColorSpace", "Utility - Linear - Rec.2020", of_rec2020, "is linear Rec. 2020"},
        {"oiio:ColorSpace", "ocio:lin_ciexyzd65_display", of_xyz, "is CIE XYZ"},
        {"oiio:ColorSpace", "Linear P3-D65", of_p3, "is linear P3-D65"}}) {
    write(naming(attribute, name), plain({0.4f, 0.3f, 0.1f}));
    expect_converted(matrix, words);
    write(naming(attribute, name), plain(glm::vec3(1)));
    if (&matrix != &of_xyz) expect_converted(unit, words, glm::dvec3(1));
  }
}

// Half of ACEScg's green is (-0.31090, 0.57040, -0.06449) in linear Rec. 709.
TEST_F(ExrEnvironment, AColourThatRec709CannotShowIsAtItsEdge) {
  const Imf::Header header = naming("colorInteropID", "lin_ap1_scene");
  const glm::vec3 green(0, 0.5f, 0), edge(0, 0.57040f, 0);
  write(header, plain(green));
  Lighting lighting = load();
  for (const glm::vec3& texel : lighting.environment.radiance)
    ASSERT_LT(glm::length(texel - edge), 5e-4f);
  EXPECT_THAT(lighting.report.notes,
              ElementsAre(HasSubstr("is ACEScg"),
                          HasSubstr("2048 of 2048 pixels are more saturated than Rec. 709 can "
                                    "show, and are shown at its edge")));

  // No light comes into it from a grey beside it: every texel is a mean of the two.
  write(header, [&](int x, int) { return x < 32 ? glm::vec3(0.5f) : green; });
  lighting = load();
  std::size_t greens = 0;
  for (const glm::vec3& texel : lighting.environment.radiance) {
    ASSERT_NEAR(texel.g, edge.g + texel.r * (0.5f - edge.g) / 0.5f, 5e-4f);
    ASSERT_NEAR(texel.b, texel.r, 5e-4f);
    greens += texel.r < 1e-4f;
  }
  EXPECT_GT(greens, lighting.environment.radiance.size() * 4 / 10);
  EXPECT_THAT(lighting.report.notes, Contains(HasSubstr("1024 of 2048 pixels are more")));

  // What the file has as negative is still repaired; roundings are neither.
  write(header,
        [](int x, int y) { return glm::vec3(0.5f, x == 9 && y == 9 ? -0.1f : 0.5f, 0.5f); });
  EXPECT_LT(read().at(9, 9).g, -0.18f);
  EXPECT_THAT(load().report.notes,
              ElementsAre(HasSubstr("is ACEScg"), HasSubstr("1 of 2048 pixels is negative")));
  write(header, plain({0.2f, 0.0227f, 0.0066f}));  // (0.32634, -0.00023, -0.00012)
  EXPECT_EQ(read().radiance[0].g, 0);
  EXPECT_THAT(notes, ElementsAre(HasSubstr("is ACEScg")));
}

TEST_F(ExrEnvironment, TheContainerOfAcesAndChromaticitiesAreConverted) {
  Imf::Header header = header_of();
  header.insert("acesImageContainerFlag", Imf::IntAttribute(1));
  write(header, plain({0.4f, 0.3f, 0.1f}));
  expect_converted(of_ap0, "is ACES2065-1 (by acesImageContainerFlag)");

  header = header_of();
  Imf::addChromaticities(header, ap1_chromaticities);
  write(header, plain({0.4f, 0.3f, 0.1f}));
  expect_converted(of_ap1, "is ACEScg (by chromaticities)");
  EXPECT_NEAR(load().environment.radiance[0].r, 0.487157f, 1e-3f);

  // The primaries of Rec. 709 with another white.
  Imf::Chromaticities warm;
  warm.white = {0.3457f, 0.3585f};  // D50
  header = header_of();
  Imf::addChromaticities(header, warm);
  write(header, plain(glm::vec3(1)));
  expect_converted(unit, "linear light of other primaries", glm::dvec3(1));
  write(header, plain({1, 0, 0}));
  EXPECT_GT(glm::length(read().radiance[0] - glm::vec3(1, 0, 0)), 0.01f);

  Imf::Chromaticities no_triangle;
  no_triangle.blue = no_triangle.red;
  header = header_of();
  Imf::addChromaticities(header, no_triangle);
  write(header, plain({0.4f, 0.3f, 0.1f}));
  EXPECT_THAT(refusal(), HasSubstr("--eraseattrib chromaticities"));
}

TEST_F(ExrEnvironment, Rec709KeepsItsBits) {
  const Paint paint = [](int x, int y) {
    return glm::vec3(0.1f + 0.013f * static_cast<float>(x), 0.7f, 0.31f * static_cast<float>(y));
  };
  std::vector<Imf::Header> headers{header_of(), header_of()};
  Imf::addChromaticities(headers.back(), Imf::Chromaticities());
  for (const auto& [attribute, name] : {std::pair{"colorInteropID", "lin_rec709_scene"},
                                        {"oiio:ColorSpace", "Linear"},
                                        {"oiio:ColorSpace", "scene_linear"},
                                        {"oiio:ColorSpace", "lin_srgb"},
                                        {"oiio:ColorSpace", "lin_rec709"},
                                        {"oiio:ColorSpace", "Linear Rec.709 (sRGB)"},
                                        {"oiio:ColorSpace", "Utility - Linear - Rec.709"}})
    headers.push_back(naming(attribute, name));
  for (const Imf::Header& header : headers) {
    write(header, paint);
    const LinearPicture picture = read();
    for (int y = 0; y < 32; ++y)
      for (int x = 0; x < 64; ++x) ASSERT_EQ(picture.at(x, y), paint(x, y));
    EXPECT_THAT(notes, IsEmpty());
  }
}

TEST_F(ExrEnvironment, CurvesAndUnknownSpacesAreRefusedWithTheCommand) {
  for (const char* name :
       {"sRGB", "srgb_rec709_scene", "g22_ap1_scene", "ARRI LogC3", "Rec709", "studio:secret"})
    for (const char* attribute : {"colorInteropID", "oiio:ColorSpace"}) {
      write(naming(attribute, name), plain(glm::vec3(0.5f)));
      EXPECT_THAT(refusal(),
                  AllOf(HasSubstr(std::string(attribute) + " is \"" + name + "\""),
                        HasSubstr("IN --colorconvert \"" + std::string(name) + "\" lin_rec709")));
    }
  write(naming("colorInteropID", "data"), plain(glm::vec3(0.5f)));
  EXPECT_THAT(refusal(), HasSubstr("which holds no colours"));
  for (const char* name : {"unknown", "Raw"}) {
    write(naming("colorInteropID", name), plain(glm::vec3(0.5f)));
    expect_converted(unit, "names no colour space", glm::dvec3(0.5));
    EXPECT_THAT(notes[0], HasSubstr("IN --colorconvert FROM lin_rec709"));
  }
}

// The newest attribute counts; but an oiio:ColorSpace of Rec. 709 says less than chromaticities.
TEST_F(ExrEnvironment, AttributesThatDisagreeAreSaid) {
  const auto expect_order = [&](const Imf::Header& header, const Matrix& matrix, const char* first,
                                const char* second) {
    write(header, plain({0.4f, 0.3f, 0.1f}));
    const glm::vec3 pixel = read().radiance[0];
    EXPECT_NEAR(pixel.r, 0.4 * matrix[0] + 0.3 * matrix[1] + 0.1 * matrix[2], 5e-4) << first;
    ASSERT_FALSE(notes.empty());
    EXPECT_THAT(notes[0], AllOf(HasSubstr(first), HasSubstr(second), HasSubstr("first counts"),
                                HasSubstr("--eraseattrib")));
  };
  Imf::Header header = naming("colorInteropID", "lin_rec2020_scene");
  Imf::addChromaticities(header, Imf::Chromaticities());
  expect_order(header, of_rec2020, "Rec. 2020", "linear Rec. 709 (by chromaticities)");
  header = naming("colorInteropID", "lin_rec709_scene");
  header.insert("acesImageContainerFlag", Imf::IntAttribute(1));
  expect_order(header, unit, "linear Rec. 709", "ACES2065-1 (by acesImageContainerFlag)");
  header = naming("oiio:ColorSpace", "lin_rec709");
  Imf::addChromaticities(header, ap1_chromaticities);
  expect_order(header, of_ap1, "ACEScg (by chromaticities)", "by oiio:ColorSpace");
  header = naming("oiio:ColorSpace", "ACEScg");
  Imf::addChromaticities(header, Imf::Chromaticities());
  expect_order(header, of_ap1, "ACEScg (by oiio:ColorSpace", "by chromaticities");

  // The same by two attributes, and a linear one without primaries, are no contradiction.
  header = naming("oiio:ColorSpace", "scene_linear");
  header.insert("colorInteropID", Imf::StringAttribute("lin_ap1_scene"));
  Imf::addChromaticities(header, ap1_chromaticities);
  write(header, plain({0.4f, 0.3f, 0.1f}));
  expect_converted(of_ap1, "is ACEScg (by colorInteropID");
}

// A sun that overflowed does not become a hole.
TEST_F(ExrEnvironment, ASunThatOverflowedIsOneAfterConversion) {
  const float inf = std::numeric_limits<float>::infinity();
  write(naming("colorInteropID", "lin_ap1_scene"),
        [&](int x, int y) { return glm::vec3(x == 20 && y == 8 ? inf : 0.5f); });
  EXPECT_EQ(read().at(20, 8), glm::vec3(inf));
}

TEST_F(ExrEnvironment, XyzIsConvertedAndPositionsAreRefused) {
  const std::array<const char*, 3> xyz = {"X", "Y", "Z"};
  write(header_of(), plain({0.4f, 0.3f, 0.1f}), xyz);
  expect_converted(of_xyz, "is CIE XYZ with a white of D65 (by its channels X, Y and Z)");
  // Equal energy is white where the file says so.
  Imf::Header header = header_of();
  Imf::addChromaticities(header, {{1, 0}, {0, 1}, {0, 0}, {1 / 3.f, 1 / 3.f}});
  write(header, plain(glm::vec3(0.5f)), xyz);
  expect_converted(unit, "is CIE XYZ", glm::dvec3(0.5));
  // A few pixels may be off.
  write(
      header_of(), [](int x, int y) { return glm::vec3(0.4f, x + y == 0 ? -0.1f : 0.3f, 0.1f); },
      xyz);
  EXPECT_EQ(refusal(), "");

  const auto is_place = AllOf(HasSubstr("look like positions"), HasSubstr("sky.exr: "));
  write(
      header_of(), [](int x, int y) { return glm::vec3(x - 32, y - 16, 2); }, xyz);
  EXPECT_THAT(refusal(), is_place);
  write(
      header_of(), [](int x, int) { return glm::vec3(1 + x, 0.5, 0); }, xyz);  // no such colour
  EXPECT_THAT(refusal(), is_place);
  header = header_of();
  header.setName("WorldPosition");
  header.setType("scanlineimage");
  write(header, plain({0.4f, 0.3f, 0.1f}), xyz);
  EXPECT_THAT(refusal(), is_place);
  for (const char* layer : {"P", "N", "position"}) {
    const std::string names[] = {layer + std::string(".X"), layer + std::string(".Y"),
                                 layer + std::string(".Z")};
    write(header_of(), plain(glm::vec3(0.5f)),
          {names[0].c_str(), names[1].c_str(), names[2].c_str()});
    EXPECT_THAT(refusal(), HasSubstr("channels R, G and B"));
  }
  write(naming("colorInteropID", "data"), plain(glm::vec3(0.5f)), xyz);
  EXPECT_THAT(refusal(), HasSubstr("holds no colours"));
}

TEST_F(ExrEnvironment, LowerCaseAndASingleLayerAreRead) {
  write(header_of(), plain({1, 2, 4}), {"r", "g", "b"});
  EXPECT_EQ(read().radiance[0], glm::vec3(1, 2, 4));
  EXPECT_THAT(notes, IsEmpty());
  write(header_of(), plain({1, 2, 4}), {"beauty.R", "beauty.G", "beauty.B"});
  expect_converted(unit, "the layer \"beauty\" is used", {1, 2, 4});
  write(header_of(), plain({1, 2, 4}), {"normal.R", "normal.G", "normal.B"});
  EXPECT_THAT(refusal(), HasSubstr("found normal.B, normal.G, normal.R"));
  std::vector<ExrChannel> channels;
  for (const char* name : {"left.R", "left.G", "left.B", "right.R", "right.G", "right.B"})
    channels.push_back({name, std::vector<float>(64 * 32, 1)});
  write_exr_channels(file, 64, 32, channels);
  EXPECT_THAT(refusal(), HasSubstr("oiiotool IN --ch R=left.R,G=left.G,B=left.B -o OUT.exr"));
}

TEST_F(ExrEnvironment, AnotherPartIsNamed) {
  std::vector<Imf::Header> headers(2, header_of());
  headers[0].setName("depth");
  headers[0].channels().insert("Z", Imf::Channel(Imf::FLOAT));
  headers[1].setName("beauty");
  for (const char* name : {"R", "G", "B"})
    headers[1].channels().insert(name, Imf::Channel(Imf::FLOAT));
  for (Imf::Header& header : headers) header.setType("scanlineimage");
  {
    Imf::MultiPartOutputFile output(file.c_str(), headers.data(), 2);
    const std::vector<float> values(64 * 32, 1);
    for (int part = 0; part < 2; ++part) {
      Imf::FrameBuffer buffer;
      for (auto c = headers[static_cast<std::size_t>(part)].channels().begin();
           c != headers[static_cast<std::size_t>(part)].channels().end(); ++c)
        buffer.insert(c.name(),
                      Imf::Slice::Make(Imf::FLOAT, values.data(), headers[0].dataWindow(), 4, 256));
      Imf::OutputPart written(output, part);
      written.setFrameBuffer(buffer);
      written.writePixels(32);
    }
  }
  EXPECT_THAT(refusal(), HasSubstr("its part 2 (beauty) has R, G and B: oiiotool IN --subimage 1"));
}

// Red and green say where a pixel of the display window is.
glm::vec3 place(int x, int y) {
  return {1.0f + static_cast<float>(x), 1.0f + static_cast<float>(y), 3};
}

TEST_F(ExrEnvironment, OverscanIsCutAndWhatIsLackingIsBlack) {
  Imf::Header header = header_of();
  header.dataWindow() = {{-2, -3}, {65, 33}};
  write(header, place);
  LinearPicture picture = read();
  ASSERT_EQ(picture.width, 64);
  ASSERT_EQ(picture.height, 32);
  EXPECT_THAT(notes, ElementsAre(HasSubstr("outside of the 64x32 that it shows; they are cut")));
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 64; ++x) ASSERT_EQ(picture.at(x, y), place(x, y));

  // Cropped at the zenith, the nadir and a side, with a display window that begins elsewhere.
  header.displayWindow() = {{10, 20}, {73, 51}};
  header.dataWindow() = {{13, 24}, {80, 49}};
  write(header, place);
  picture = read();
  EXPECT_THAT(notes,
              ElementsAre(HasSubstr("has 61x26 of its 64x32 pixels; the others are filled with "
                                    "black (left 3, right 0, above 4, below 2)"),
                          HasSubstr("they are cut")));
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 64; ++x)
      ASSERT_EQ(picture.at(x, y),
                x >= 3 && y >= 4 && y < 30 ? place(x + 10, y + 20) : glm::vec3(0));

  // A crop of a picture is no environment.
  header.dataWindow() = {{20, 30}, {30, 36}};
  write(header, place);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("a part of 11x7"), HasSubstr("--fullpixels")));
  header.dataWindow() = {{200, 30}, {210, 36}};
  write(header, place);
  EXPECT_THAT(refusal(), HasSubstr("a full picture is needed"));
}

// A smooth sky of 64x32 whose pairs of columns are alike is that of 32x32 with wide pixels, apart
// from what is between them: bilinear between centres that are half as far apart.
TEST_F(ExrEnvironment, WidePixelsAreStretched) {
  Imf::Header header = header_of(32, 32);
  header.pixelAspectRatio() = 2;
  const auto sky = [](double turns, int y) {
    return glm::vec3(2 + std::cos(turns * 2 * std::numbers::pi), 2 + 0.05 * y, 1);
  };
  write(header, [&](int x, int y) { return sky((x + 0.5) / 32, y); });
  const Lighting wide = load();
  EXPECT_THAT(wide.report.notes, ElementsAre(HasSubstr("2 times as wide as high")));
  write(header_of(), [&](int x, int y) { return sky((x + 0.5) / 64, y); });
  const Lighting square = load();
  ASSERT_EQ(wide.environment.size, square.environment.size);
  // A chord is off by h^2 / 8 of the second derivative, 1, with h = 2 pi / 32.
  for (std::size_t i = 0; i < wide.environment.radiance.size(); ++i)
    ASSERT_LT(glm::length(wide.environment.radiance[i] - square.environment.radiance[i]), 0.006f);
}

TEST_F(ExrEnvironment, AStereoPictureIsNamedWithTheWayToOneOfItsViews) {
  const auto view = [](int x, int y) {
    return glm::vec3(0.2 + 0.01 * x + 5.0 / (1 + y), 0.5 + 0.02 * y, x % 7 == 3 ? 40 : 0.2);
  };
  // The right eye sees what is near a pixel further to the left.
  write(header_of(64, 64), [&](int x, int y) { return y < 32 ? view(x, y) : view(x + 1, y - 32); });
  EXPECT_THAT(refusal(), AllOf(HasSubstr("stereo picture, two views above each other"),
                               HasSubstr("oiiotool IN --cut 64x32+0+0 -o OUT.exr")));
  write(header_of(128, 32),
        [&](int x, int y) { return x < 64 ? view(x, y) : view(x - 64 + 1, y); });
  EXPECT_THAT(refusal(), AllOf(HasSubstr("stereo picture, two views beside each other"),
                               HasSubstr("--cut 64x32+0+0")));
  for (const int side : {1, 8}) {  // neither holes nor a single pixel hide what it is
    write(header_of(side, side), plain(glm::vec3(std::nanf(""))));
    EXPECT_THAT(refusal(), HasSubstr("twice as wide as high"));
  }
  // A mirror ball: bright above, dark below, black around it.
  write(header_of(64, 64), [](int x, int y) {
    const int dx = 2 * x - 63, dy = 2 * y - 63;
    return glm::vec3(dx * dx + dy * dy > 64 * 64 ? 0 : y < 32 ? 3 : 0.4);
  });
  EXPECT_THAT(refusal(), AllOf(HasSubstr("mirror ball"), Not(HasSubstr("stereo"))));
  write(header_of(128, 32), [](int x, int y) { return glm::vec3(x, y, 1); });
  EXPECT_THAT(refusal(), AllOf(HasSubstr("128x32 pixels"), Not(HasSubstr("stereo"))));
}

// A picture that is too large to be kept becomes that of the means over its pixels.
TEST_F(ExrEnvironment, ATooLargePictureIsReadByItsMeans) {
  write(header_of(), place);
  LinearPicture picture = read(500);  // of 2048
  ASSERT_EQ(picture.width, 20);       // 32 / ceil(32 / floor(sqrt(500 / 2))) is 10
  ASSERT_EQ(picture.height, 10);
  EXPECT_THAT(notes, ElementsAre(HasSubstr("has 64x32 pixels, which are read as 20x10")));
  // The means of a ramp are its values in the centres; where an end cuts a pixel of the stairs, up
  // to 1/8 of a pixel among 3.2 are off, in two channels.
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 20; ++x)
      ASSERT_LT(glm::length(picture.at(x, y) -
                            glm::vec3(0.5 + (x + 0.5) * 3.2, 0.5 + (y + 0.5) * 3.2, 3)),
                0.056f)
          << x << " " << y;

  // By whole factors.
  picture = read(2048 / 4);
  ASSERT_EQ(picture.width, 32);
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x)
      ASSERT_EQ(picture.at(x, y), glm::vec3(1.5 + 2 * x, 1.5 + 2 * y, 3));

  EXPECT_EQ(picture.pixels_of_file, 2);

  // A picture that is kept is not changed, and a sun that overflowed lights its share.
  EXPECT_EQ(read(2048).at(63, 31), place(63, 31));
  EXPECT_THAT(notes, IsEmpty());
  const float inf = std::numeric_limits<float>::infinity();
  write(header_of(), [&](int x, int y) { return glm::vec3(x == 3 && y == 3 ? inf : 0); });
  EXPECT_EQ(read(512).at(1, 1), glm::vec3(65504.f / 4));
  EXPECT_THAT(notes, ElementsAre(HasSubstr("3 values of +Inf count as 65504")));
  // 67x31 has no smaller picture of its shape.
  write(header_of(67, 31), place);
  EXPECT_THAT(previz::test::error_of([&] { read(500); }), HasSubstr("oiiotool IN --resize"));
}

}  // namespace previz::lighting::environment_exr_test
