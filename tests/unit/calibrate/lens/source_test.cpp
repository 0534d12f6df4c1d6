// Which files of a folder are its pictures.
#include "daemon/tools/calibrate/lens/source.hpp"
#include "daemon/core/session/files.hpp"
#include "tests/support/test.hpp"

namespace previz::calibrate::source_test {

// Cameras write raw photographs beside their JPEGs.
TEST(PictureSource, ARawPhotographIsNoPictureOfAFolder) {
  const test::TemporaryDirectory folder;
  session::write_content(folder.path() / "DSC_1.NEF", "MM");
  session::write_content(folder.path() / "notes.txt", "");
  EXPECT_THAT(test::error_of([&] { picture_files(folder.path()); }),
              HasSubstr("DSC_1.NEF: is a raw photograph; develop it"));
  session::write_content(folder.path() / "DSC_1.JPG", "");
  EXPECT_EQ(picture_files(folder.path()).size(), 1u);
  std::filesystem::remove(folder.path() / "DSC_1.JPG");
  std::filesystem::remove(folder.path() / "DSC_1.NEF");
  EXPECT_THAT(test::error_of([&] { picture_files(folder.path()); }),
              HasSubstr("contains no pictures; allowed: PNG, JPEG"));
}

}  // namespace previz::calibrate::source_test
