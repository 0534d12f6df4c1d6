// The EXR that carries every layer: exact names, exact values, honest header.
#include "daemon/core/output/exr.hpp"

#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfChromaticitiesAttribute.h>
#include <ImfDoubleAttribute.h>
#include <ImfInputFile.h>
#include <ImfIntAttribute.h>
#include <ImfMatrixAttribute.h>
#include <ImfRgbaFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>

#include "daemon/core/output/exr_file.hpp"
#include "daemon/core/session/files.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::output::exr_test {

using test::TemporaryDirectory;

// Every value different, with negative, tiny and huge ones, so that swapped channels cannot hide.
render::Layers sample_layers(int width, int height) {
  render::Layers layers;
  layers.width = width;
  layers.height = height;
  layers.samples = 256;
  layers.denoised = true;
  float next = 0.001f;
  const auto value = [&] { return next = next * -1.01f - 0.37f; };
  for (int i = 0; i < width * height; ++i) {
    for (auto* layer : {&layers.composite, &layers.mixed, &layers.real, &layers.diff,
                        &layers.normal, &layers.variance})
      layer->emplace_back(value(), 1e-20f * value(), 1e20f * value());
    layers.mask.push_back(i % 3 == 0 ? 0.0f : i % 3 == 1 ? 0.25f : 1.0f);
    layers.depth.push_back(value());
  }
  return layers;
}

class Exr : public testing::Test {
 protected:
  // The header of a file of small layers with this metadata.
  Imf::Header header_of(const ExrMetadata& metadata) const {
    write_exr(file_, sample_layers(5, 3), metadata);
    return Imf::InputFile(file_.c_str()).header();
  }
  // Writes the layers, and returns what is read again.
  render::Layers read_again(const render::Layers& layers) const {
    write_exr(file_, layers, {});
    return read_exr(file_);
  }

  const TemporaryDirectory directory_;
  const std::filesystem::path file_ = directory_ / "frame.exr";
};

// A camera at (1, 2, 3) that looks along +Y: a point 2 m ahead, 0.5 m right and 1 m up of it, as
// OpenEXR's camera sees it and where it is in the picture.
TEST_F(Exr, StandardCameraAttributesProjectAKnownPoint) {
  ExrMetadata metadata;
  metadata.world_from_camera = {{1, 0, 0, 0}, {0, 0, -1, 0}, {0, 1, 0, 0}, {1, 2, 3, 1}};
  metadata.intrinsics = PinholeIntrinsics{64, 48, 60, 60, 31.5, 23.5};
  metadata.lens = ThinLens{0.035, 2.8, 1.5};
  metadata.exposure_s = 0.02;
  const Imf::Header header = header_of(metadata);
  const Imath::V3f world(1.5f, 4.0f, 4.0f);
  Imath::V3f camera, ndc;
  Imf::worldToCamera(header).multVecMatrix(world, camera);
  Imf::worldToNDC(header).multVecMatrix(world, ndc);
  EXPECT_EQ(camera, Imath::V3f(0.5f, 1.0f, 2.0f));
  EXPECT_FLOAT_EQ(ndc.x, (32 + 60 * 0.25f) / 64);
  EXPECT_FLOAT_EQ(ndc.y, (24 - 60 * 0.5f) / 48);
  EXPECT_FLOAT_EQ(Imf::aperture(header), 2.8f);
  EXPECT_FLOAT_EQ(Imf::focus(header), 1.5f);
  EXPECT_FLOAT_EQ(Imf::expTime(header), 0.02f);

  metadata.pose = "lost";
  const Imf::Header lost = header_of(metadata);
  EXPECT_FALSE(Imf::hasWorldToCamera(lost));
  EXPECT_EQ(lost.findTypedAttribute<Imf::M44dAttribute>("previz.world_from_camera"), nullptr);
}

TEST_F(Exr, HasRateAndTimecode) {
  ExrMetadata metadata;
  metadata.fps = 30000.0 / 1001;
  metadata.timecode = session::timecode_after({"01:00:59;29", metadata.fps}, 1);
  const Imf::Header header = header_of(metadata);
  EXPECT_EQ(Imf::framesPerSecond(header).n, 30000);
  EXPECT_EQ(Imf::framesPerSecond(header).d, 1001u);
  const Imf::TimeCode& code = Imf::timeCode(header);
  EXPECT_EQ(code.hours(), 1);
  EXPECT_EQ(code.minutes(), 1);
  EXPECT_EQ(code.seconds(), 0);
  EXPECT_EQ(code.frame(), 2);
  EXPECT_TRUE(code.dropFrame());

  metadata.fps = 60;  // in pairs
  metadata.timecode = session::timecode_after({"10:00:00:00", 60}, 59);
  const Imf::TimeCode fast = Imf::timeCode(header_of(metadata));
  EXPECT_EQ(fast.frame(), 29);
  EXPECT_TRUE(fast.fieldPhase());

  EXPECT_FALSE(Imf::hasTimeCode(header_of({})));
}

TEST_F(Exr, ChannelsAreExactlyTheNamedOnesIn32BitFloat) {
  const Imf::Header header = header_of({});
  std::set<std::string> names;
  const Imf::ChannelList& channels = header.channels();
  for (auto channel = channels.begin(); channel != channels.end(); ++channel) {
    names.insert(channel.name());
    EXPECT_EQ(channel.channel().type, Imf::FLOAT) << channel.name();
  }
  const std::set<std::string> expected{
      "R",       "G",        "B",        "A",        "mixed.R",    "mixed.G",    "mixed.B",
      "real.R",  "real.G",   "real.B",   "diff.R",   "diff.G",     "diff.B",     "mask.Y",
      "depth.Z", "normal.X", "normal.Y", "normal.Z", "variance.R", "variance.G", "variance.B"};
  EXPECT_EQ(names, expected);
  EXPECT_EQ(header.compression(), Imf::ZIP_COMPRESSION);
}

TEST_F(Exr, EveryValueComesBackBitForBit) {
  const render::Layers written = sample_layers(7, 4);
  const render::Layers read = read_again(written);
  EXPECT_EQ(read.width, 7);
  EXPECT_EQ(read.height, 4);
  EXPECT_EQ(read.samples, 256);
  EXPECT_EQ(read.denoised, written.denoised);
  EXPECT_EQ(read.composite, written.composite);
  EXPECT_EQ(read.mixed, written.mixed);
  EXPECT_EQ(read.real, written.real);
  for (std::size_t i = 0; i < written.diff.size(); ++i)  // of the uncovered part
    EXPECT_EQ(read.diff[i], written.diff[i] * (1.0f - written.mask[i])) << i;
  EXPECT_EQ(read.normal, written.normal);
  EXPECT_EQ(read.variance, written.variance);
  EXPECT_EQ(read.mask, written.mask);
  EXPECT_EQ(read.depth, written.depth);
}

// Programs that know no layers read R, G, B and A.
TEST_F(Exr, TheCompositeIsWhatOtherProgramsRead) {
  const render::Layers written = sample_layers(7, 4);
  write_exr(file_, written, {});
  Imf::Array2D<Imf::Rgba> pixels(4, 7);
  Imf::RgbaInputFile file(file_.c_str());
  file.setFrameBuffer(&pixels[0][0], 1, 7);
  file.readPixels(0, 3);
  for (int i = 0; i < 28; ++i) {
    const Imf::Rgba& read = pixels[i / 7][i % 7];
    EXPECT_EQ(read.r, Imath::half(written.composite[i].r)) << i;
    EXPECT_EQ(read.g, Imath::half(written.composite[i].g)) << i;
    EXPECT_EQ(read.b, Imath::half(written.composite[i].b)) << i;
    EXPECT_EQ(read.a, Imath::half(1.0f)) << i;
  }
}

TEST_F(Exr, FilesWithANamedCompositeAreRead) {
  const render::Layers written = sample_layers(7, 4);
  write_exr(file_, written, {});
  // The same pixels with other names: all channels of the file by the names of earlier versions.
  Imf::Header header(7, 4);
  Imf::FrameBuffer buffer;
  std::vector<std::vector<float>> samples;
  samples.reserve(32);
  Imf::InputFile read(file_.c_str());
  const Imf::ChannelList& channels = read.header().channels();
  Imf::FrameBuffer in;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel) {
    const std::string name = channel.name();
    if (name == "A") continue;
    const std::string old = name.size() == 1 ? "composite." + name : name;
    const Imf::Slice slice = exr_slice(samples.emplace_back(28).data(), 1, 7);
    header.channels().insert(old, Imf::Channel(Imf::FLOAT));
    in.insert(name, slice);
    buffer.insert(old, slice);
  }
  read.setFrameBuffer(in);
  read.readPixels(0, 3);
  exr_draft(file_, header, buffer).put();
  EXPECT_EQ(read_exr(file_).composite, written.composite);
}

TEST_F(Exr, HeaderSaysWhatThePictureIs) {
  ExrMetadata metadata;
  metadata.exposure = 1.25;
  metadata.timestamp_ns = 1'700'000'000'567'008'006;
  metadata.set_name = "glass";
  metadata.world_from_camera[3] = {0.5, -0.25, 2.0, 1.0};  // glm: the fourth column
  const Imf::Header header = header_of(metadata);
  EXPECT_EQ(header.typedAttribute<Imf::IntAttribute>("previz.samples").value(), 256);
  EXPECT_EQ(header.typedAttribute<Imf::DoubleAttribute>("previz.exposure").value(), 1.25);
  EXPECT_EQ(header.typedAttribute<Imf::StringAttribute>("previz.timestamp_ns").value(),
            "1700000000567008006");
  EXPECT_EQ(header.typedAttribute<Imf::StringAttribute>("previz.set").value(), "glass");
  EXPECT_EQ(header.typedAttribute<Imf::StringAttribute>("previz.pose").value(), "tracked");
  const Imath::M44d& pose =
      header.typedAttribute<Imf::M44dAttribute>("previz.world_from_camera").value();
  EXPECT_EQ(pose[0][3], 0.5);
  EXPECT_EQ(pose[1][3], -0.25);
  EXPECT_EQ(pose[2][3], 2.0);
  EXPECT_EQ(pose[3][0], 0.0);
  ASSERT_TRUE(Imf::hasChromaticities(header));
  EXPECT_FLOAT_EQ(Imf::chromaticities(header).red.x, 0.64f);
  EXPECT_FLOAT_EQ(Imf::chromaticities(header).white.x, 0.3127f);
}

TEST_F(Exr, IncompleteLayersAreRefusedAndLeaveNoFile) {
  render::Layers layers = sample_layers(4, 4);
  layers.depth.pop_back();
  EXPECT_THROW(write_exr(file_, layers, {}), Error);
  EXPECT_FALSE(std::filesystem::exists(file_));
}

TEST_F(Exr, UnwritablePlaceIsNamed) {
  const std::string file = "/nowhere/at/all/frame.exr";
  EXPECT_THAT(test::error_of([&] { write_exr(file, sample_layers(1, 1), {}); }), HasSubstr(file));
}

// The disk runs full at every place of the file, the end that OpenEXR writes as it closes it among
// them. A black picture compresses to little: then most of the file is in those last writes.
TEST_F(Exr, OnAFullDiskThereIsTheWholeFileOrNone) {
  render::Layers layers = sample_layers(64, 48);
  for (auto* layer : {&layers.composite, &layers.mixed, &layers.real, &layers.diff, &layers.normal,
                      &layers.variance})
    layer->assign(layer->size(), glm::vec3(0));
  write_exr(directory_ / "whole.exr", layers, {});
  const auto whole = std::filesystem::file_size(directory_ / "whole.exr");
  for (std::uintmax_t room = 0; room < whole + 16; room += 16) {
    std::string error;
    {
      const test::FileSizeLimit limit(room);
      error = test::error_of([&] { write_exr(file_, layers, {}); });
    }
    const bool written = error.empty();
    EXPECT_TRUE(written || error.find(file_.string()) != std::string::npos) << error;
    EXPECT_EQ(written, room >= whole) << room << " of " << whole << " bytes";
    EXPECT_EQ(std::filesystem::exists(file_), written) << room << " of " << whole << " bytes";
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory_.path()), {}),
              written ? 2 : 1)
        << "a draft was left";
  }
  EXPECT_EQ(read_exr(file_).depth, layers.depth);
}

// A data window that lies elsewhere, or has a side that is too long, is refused before
// anything is read into memory that was made for it.
TEST_F(Exr, ADataWindowThatDoesNotBeginAtZeroIsRefused) {
  const render::Layers layers = sample_layers(4, 4);
  const auto window_of = [&](int min_x, int min_y, int max_x, int max_y) {
    write_exr(file_, layers, {});
    std::string bytes = test::content_of(file_);
    const std::string name("dataWindow\0box2i\0\x10\0\0\0", 21);
    const std::size_t at = bytes.find(name);
    EXPECT_NE(at, std::string::npos);
    const int window[] = {min_x, min_y, max_x, max_y};
    std::memcpy(&bytes[at + name.size()], window, sizeof window);
    std::ofstream(file_, std::ios::binary) << bytes;
    return file_;
  };
  EXPECT_NO_THROW(read_exr(window_of(0, 0, 3, 3)));
  EXPECT_THROW(read_exr(window_of(-2, -2, 1, 1)), Error);
  EXPECT_THROW(read_exr(window_of(2, 2, 5, 5)), Error);
  EXPECT_THROW(read_exr(window_of(5, 5, 2, 2)), Error);
  EXPECT_THROW(read_exr(window_of(0, 0, 1 << 16, 0)), Error);
}

}  // namespace previz::output::exr_test
