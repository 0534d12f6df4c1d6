#include <ImfChannelList.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>

#include "daemon/core/lighting/exr_picture.hpp"
#include "daemon/core/lighting/lighting.hpp"
#include "tests/support/lighting.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::environment_file_test {

using std::literals::string_view_literals::operator""sv;
using std::numbers::pi;
using test::towards;

class LoadEnvironment : public testing::Test {
 protected:
  LoadEnvironment() { settings.environment = file; }

  std::string refusal() {
    return test::error_of([&] { load_environment(settings); });
  }

  test::TemporaryDirectory directory;
  const std::filesystem::path file = directory / "sky.exr";
  set::Lighting settings;
};

// Rough texture in every pixel and a few pixels a hundred thousand times as bright.
LinearPicture rough_sky(int width) {
  LinearPicture picture{width, width / 2, {}};
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(0.1f, 1.0f);
  for (int p = 0; p < width * width / 2; ++p)
    picture.radiance.emplace_back(uniform(random), uniform(random), 3 * uniform(random));
  const auto pixel = [&](int x, int y) -> glm::vec3& {
    return picture.radiance[static_cast<std::size_t>(y * width + x)];
  };
  pixel(width / 3, width / 8) = glm::vec3(1e5f, 8e4f, 6e4f);
  pixel(0, width / 5) = glm::vec3(5e4f, 5e4f, 6e4f);  // across the seam
  pixel(width / 2, 3 * width / 8) = glm::vec3(1e5f);
  return picture;
}

// Midpoint sums over 4x4 directions a pixel of the bilinear function, in double.
template <typename Body>  // body(direction, radiance, solid angle)
void integrate(const LinearPicture& picture, const Body& body) {
  const auto pixel = [&](int x, int y) {
    y = std::clamp(y, 0, picture.height - 1);
    x = (x + picture.width) % picture.width;
    return glm::dvec3(picture.radiance[static_cast<std::size_t>(y * picture.width + x)]);
  };
  for (int r = 0; r < 4 * picture.height; ++r)
    for (int c = 0; c < 4 * picture.width; ++c) {
      const double x = (c + 0.5) / 4, y = (r + 0.5) / 4;
      const double azimuth = 2 * pi * (0.5 - x / picture.width);
      const double elevation = pi * (0.5 - y / picture.height);
      const double px = x - 0.5, py = y - 0.5;
      const int column = static_cast<int>(std::floor(px)), row = static_cast<int>(std::floor(py));
      const double s = px - column, t = py - row;
      const glm::dvec3 radiance =
          (1 - t) * ((1 - s) * pixel(column, row) + s * pixel(column + 1, row)) +
          t * ((1 - s) * pixel(column, row + 1) + s * pixel(column + 1, row + 1));
      body(glm::dvec3(std::cos(elevation) * std::cos(azimuth),
                      std::cos(elevation) * std::sin(azimuth), std::sin(elevation)),
           radiance, std::cos(elevation) * pi * pi / 8 / picture.height / picture.width);
    }
}

double largest_relative_error(const glm::dvec3& value, const glm::dvec3& expected) {
  const glm::dvec3 error = glm::abs(value / expected - 1.0);
  return std::max({error.x, error.y, error.z});
}

TEST_F(LoadEnvironment, KeepsFluxAndIrradiance) {
  const LinearPicture sky = rough_sky(256);
  write_exr_picture(file, sky);
  const std::vector<glm::dvec3> normals = test::upper_normals();
  glm::dvec3 flux(0);
  std::vector<glm::dvec3> expected(normals.size(), glm::dvec3(0));
  integrate(sky, [&](const glm::dvec3& direction, const glm::dvec3& radiance, double sr) {
    flux += radiance * sr;
    for (std::size_t n = 0; n < normals.size(); ++n)
      if (const double cosine = glm::dot(direction, normals[n]); cosine > 0)
        expected[n] += radiance * (sr * cosine);
  });
  for (int resolution : {0, 64, 1024}) {
    settings.resolution = resolution;
    const EnvironmentMap map = load_environment(settings).environment;
    EXPECT_EQ(map.size, resolution == 0 ? 256 : resolution);
    // The suns hold nearly all of the flux. Each is a tent two pixels wide that is summed over a
    // grid of h pixels; where its kink falls between two directions the sum is off by up to h^2 / 6
    // along that axis, with either sign: h is 1/4.4 at 64 texels and 1/7 at 256.
    EXPECT_LT(largest_relative_error(total_flux(map), flux), map.size >= 256 ? 1e-3 : 5e-3);
    double worst = 0;
    for (std::size_t n = 0; n < normals.size(); ++n)
      worst = std::max(worst, largest_relative_error(irradiance(map, normals[n]), expected[n]));
    // Texels of a degree and more move a sun that stands low over a plane by too much to compare.
    if (map.size >= 256) {
      EXPECT_LT(worst, 0.005) << resolution;
    }
  }
}

// What `previz calibrate balance` prints makes up for an environment that does not fit the camera.
TEST_F(LoadEnvironment, IsMultipliedByTheBalanceAndTheGain) {
  write_exr_picture(file, rough_sky(64));
  const EnvironmentMap plain = load_environment(settings).environment;
  settings.environment_gain = 2;
  settings.balance = {0.5, 0.25, 4};
  const EnvironmentMap balanced = load_environment(settings).environment;
  for (std::size_t i = 0; i < plain.radiance.size(); ++i)
    ASSERT_EQ(balanced.radiance[i], plain.radiance[i] * glm::vec3(1, 0.5f, 8));
}

TEST_F(LoadEnvironment, SeesTheLayoutFromInside) {
  // Red grows with x, green with y, blue with z.
  LinearPicture sky{256, 128, {}};
  for (int r = 0; r < 128; ++r)
    for (int c = 0; c < 256; ++c)
      sky.radiance.emplace_back(
          0.5 * towards(360 * (0.5 - (c + 0.5) / 256), 180 * (0.5 - (r + 0.5) / 128)) + 0.5);
  write_exr_picture(file, sky);
  for (double turn_deg : {0.0, 90.0, -133.0, 725.0}) {
    settings.environment_rotation_rad = turn_deg * pi / 180;
    settings.environment_gain = 2;
    const EnvironmentMap map = load_environment(settings).environment;
    const double c = std::cos(-turn_deg * pi / 180), s = std::sin(-turn_deg * pi / 180);
    for_each_texel(map, [&](const glm::dvec3& d, const glm::dvec3& radiance) {
      const glm::dvec3 unturned(c * d.x - s * d.y, s * d.x + c * d.y, d.z);
      // Slopes are 1/2: a texel's mean and a pixel's chord are off by their squared size, next to
      // a pole by a pixel, where azimuth is lost.
      const double limit = std::abs(d.z) > 0.999 ? 0.03 : 0.002;
      ASSERT_LT(glm::length(radiance - 2.0 * (0.5 * unturned + 0.5)), limit)
          << d.x << " " << d.y << " " << d.z;
    });
    // The picture for people is the same way around.
    if (turn_deg == 0) {
      const LinearPicture shown = to_latitude_longitude(map, 256);
      for (std::size_t p = 0; p < shown.radiance.size(); ++p)
        ASSERT_LT(glm::length(shown.radiance[p] - 2.0f * sky.radiance[p]), 0.04f);
    }
  }
}

// A channel of one value.
ExrChannel channel(const char* name, float value, bool is_half = true) {
  return {name, std::vector<float>(64 * 32, value), is_half};
}

void write_channels(const std::filesystem::path& file, const std::vector<ExrChannel>& channels) {
  write_exr_channels(file, 64, 32, channels);
}

TEST_F(LoadEnvironment, ReadsTheUsualChannels) {
  const ExrChannel r = channel("R", 1), g = channel("G", 2), b = channel("B", 4),
                   y = channel("Y", 3), a = channel("A", 1);
  const std::vector<std::pair<std::vector<ExrChannel>, glm::vec3>> files{
      {{r, g, b}, {1, 2, 4}},
      {{a, b, g, r}, {1, 2, 4}},
      {{channel("Z", 9, false), channel("R", 1, false), g, channel("B", 4, false)}, {1, 2, 4}},
      {{y}, {3, 3, 3}},
      {{y, a}, {3, 3, 3}}};
  for (const auto& [channels, expected] : files) {
    write_channels(file, channels);
    const Lighting lighting = load_environment(settings);
    for (const glm::vec3& radiance : lighting.environment.radiance)
      ASSERT_LT(glm::length(radiance - expected), 1e-5f);
    EXPECT_NEAR(lighting.report.seen_sr, 4 * pi, 1e-12);
    EXPECT_TRUE(lighting.report.notes.empty());
  }
}

TEST_F(LoadEnvironment, SaysWhatIsWrongWithAFile) {
  write_channels(file, {channel("R", 1), channel("G", 1), channel("left.B", 1)});
  EXPECT_THAT(refusal(), HasSubstr("found G, R, left.B"));
  write_channels(file, {channel("Y", 1), channel("RY", 0), channel("BY", 0)});
  EXPECT_THAT(refusal(), HasSubstr("found BY, RY, Y"));
  write_exr_picture(file, {30, 20, std::vector<glm::vec3>(600)});
  EXPECT_THAT(refusal(), HasSubstr("30x20"));
  settings.environment = directory / "none.exr";
  EXPECT_THAT(refusal(), HasSubstr("none.exr"));
  settings.environment = directory.path();
  EXPECT_THAT(refusal(), HasSubstr("is a folder and not a file"));
}

// A window is looked at before there are pixels.
TEST_F(LoadEnvironment, AHugeWindowIsRefusedBeforeMemoryIsAskedFor) {
  {
    Imf::Header header(static_cast<int>(most_side) + 1, 1);
    header.compression() = Imf::ZIP_COMPRESSION;
    for (const char* channel : {"R", "G", "B"})
      header.channels().insert(channel, Imf::Channel(Imf::HALF));
    const Imf::OutputFile without_pixels(file.c_str(), header);
  }
  EXPECT_THAT(refusal(), HasSubstr(std::to_string(most_side + 1) + "x1 pixels; allowed: at most"));
}

// Writes a header that begins with this attribute, and nothing behind its value but 64 zeros.
void write_attribute(const std::filesystem::path& file, std::string_view name_and_type,
                     std::int32_t size, std::string_view value) {
  std::ofstream stream(file, std::ios::binary);
  stream << std::string("\x76\x2f\x31\x01\2\0\0\0", 8) << name_and_type;
  stream.write(reinterpret_cast<const char*>(&size), sizeof size);
  stream << value << std::string(64, '\0');
}

TEST_F(LoadEnvironment, AnAttributeThatEndsBehindTheFileIsRefused) {
  write_attribute(file, "owner\0string\0"sv, 64 + 16, "15 of 16 bytes.");
  EXPECT_THAT(refusal(), HasSubstr("its header is damaged"));
}

TEST_F(LoadEnvironment, AnAttributeOfAnotherSizeThanItsTypesIsRefused) {
  write_attribute(file, "pixelAspectRatio\0float\0"sv, 8, "");
  EXPECT_THAT(refusal(), HasSubstr("its header is damaged"));
}

// OpenEXR reads both to the end of their value, and what comes then as the next attribute.
TEST_F(LoadEnvironment, AValueThatEndsElsewhereThanItsSizeSaysIsRefused) {
  const std::string channel = "R" + std::string(17, '\0');
  write_attribute(file, "channels\0chlist\0"sv, 19 + 4, channel + '\0');
  EXPECT_THAT(refusal(), HasSubstr("its header is damaged"));
  write_attribute(file, "channels\0chlist\0"sv, 12, channel + '\0');
  EXPECT_THAT(refusal(), HasSubstr("its header is damaged"));
  write_attribute(file, "preview\0preview\0"sv, 8 + 4 + 4, "\1\0\0\0\1\0\0\0rgba"sv);
  EXPECT_THAT(refusal(), HasSubstr("its header is damaged"));
  write_attribute(file, "preview\0preview\0"sv, 8 + 4, "\1\0\0\0\1\0\0\0rgba"sv);
  EXPECT_THAT(refusal(), Not(HasSubstr("its header is damaged")));
}

}  // namespace previz::lighting::environment_file_test
