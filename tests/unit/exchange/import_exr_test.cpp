// Plates as OpenEXR: what they say of their colours and windows.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>

#include "tests/support/import_fixture.hpp"

namespace previz::exchange::import_exr_test {

double encoded(double light) {  // IEC 61966-2-1, in parts of 255
  return 255 * (1.055 * std::pow(light, 1 / 2.4) - 0.055);
}

// A plate of 16x16 with pixels of one colour in the data window.
void write(const std::filesystem::path& path, const Imath::Box2i& data,
           const std::array<float, 3>& color, const char* space = "lin_rec709_scene") {
  Imf::Header header(16, 16);
  header.dataWindow() = data;
  header.insert("colorInteropID", Imf::StringAttribute(space));
  Imf::FrameBuffer buffer;
  std::array<std::vector<float>, 3> samples;
  for (std::size_t c = 0; c < 3; ++c) {
    samples[c].assign(std::size_t{32} * 32, color[c]);
    const std::string name(1, "RGB"[c]);
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    buffer.insert(name, Imf::Slice::Make(Imf::FLOAT, samples[c].data(), data));
  }
  Imf::OutputFile file(path.c_str(), header);
  file.setFrameBuffer(buffer);
  file.writePixels(data.max.y - data.min.y + 1);
}

class ImportStillsExr : public testing::Test {
 protected:
  double sample(std::size_t i) const {
    const FramePtr frame = shoot.open()->read(0);
    return reinterpret_cast<const std::uint16_t*>(frame->bytes.data())[i] / 257.0;
  }

  Shoot shoot{"a.exr"};
  const std::filesystem::path file = shoot.folder() / "a.exr";
};

// FRAMES.json may say other primaries. CSS Color 4, 17 has the row of P3.
TEST_F(ImportStillsExr, OfOtherColoursIsConverted) {
  write(file, {{0, 0}, {15, 13}}, {0.5f, 0.18f, 0.02f}, "lin_p3d65_scene");
  const ImportReport report = shoot.import();
  EXPECT_THAT(report.notes, Contains(HasSubstr("is linear P3-D65 (by colorInteropID")));
  EXPECT_NEAR(sample(0), encoded(1.2249402 * 0.5 - 0.2249402 * 0.18), 0.01);
  EXPECT_EQ(sample(std::size_t{3} * 16 * 14), 0);

  shoot.json["observer"]["read_as"] = {{"primaries", "bt709"}};
  shoot.import();
  EXPECT_NEAR(sample(0), encoded(0.5), 0.01);
}

// Half of ACEScg's green is (-0.31090, 0.57040, -0.06449) in linear Rec. 709: two of three samples
// are clipped.
TEST_F(ImportStillsExr, AColourThatRec709CannotShowIsClippedAndCounted) {
  write(file, {{0, 0}, {15, 15}}, {0, 0.5f, 0}, "lin_ap1_scene");
  const ImportReport report = shoot.import();
  EXPECT_THAT(report.notes,
              Contains(HasSubstr("67 % of its samples are outside of what Rec. 709")));
  EXPECT_THAT(report.notes, Not(Contains(HasSubstr("more saturated"))));
  EXPECT_EQ(sample(0), 0);
  EXPECT_NEAR(sample(1), encoded(0.57040), 0.02);
  EXPECT_EQ(sample(2), 0);
}

// Programs of effects cut black margins, each frame's own; overscan is cut.
TEST_F(ImportStillsExr, WindowsThatVaryAreOneNoteOfAllFrames) {
  const Imath::Box2i windows[] = {
      {{0, 0}, {15, 14}}, {{1, 1}, {15, 15}}, {{0, 0}, {14, 13}}, {{-2, 1}, {17, 15}}};
  Json names = Json::array();
  for (const Imath::Box2i& window : windows) {
    names.push_back(numbered("f", static_cast<int>(names.size()), ".exr"));
    write(shoot.folder() / names.back().get<std::string>(), window, {0.5f, 0.5f, 0.5f});
  }
  shoot.json["observer"]["pictures"] = names;
  const ImportReport report = shoot.import();
  EXPECT_EQ(report.observer_frames, 4u);
  EXPECT_THAT(report.notes,
              testing::UnorderedElementsAre(
                  HasSubstr("lacks at most an eighth of its rows and columns; they are filled with "
                            "black (4 pictures)"),
                  HasSubstr("outside of the 16x16 that it shows; they are cut"),
                  HasSubstr("holds linear light"), HasSubstr("25 frames per second")));
}

TEST_F(ImportStillsExr, APlateThatLacksMoreThanAMarginIsRefused) {
  for (const Imath::Box2i& window :
       {Imath::Box2i{{0, 0}, {15, 12}}, {{3, 0}, {15, 15}}, {{2, 2}, {14, 14}}}) {
    write(file, window, {0.5f, 0.5f, 0.5f});
    EXPECT_THAT(shoot.error(),
                AllOf(HasSubstr("a.exr: its pixels are a part of"), HasSubstr("of 16x16"),
                      HasSubstr("--croptofull"), HasSubstr("--fullpixels")));
  }
}

}  // namespace previz::exchange::import_exr_test
