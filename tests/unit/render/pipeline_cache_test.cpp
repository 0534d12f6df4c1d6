// Whatever the driver has compiled is kept in a file, and a file that is of no use costs nothing
// but the time to compile.
#include "daemon/core/render/device/device.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/environment_variable.hpp"
#include "tests/support/pixels_by_hand.hpp"
#include "tests/support/temporary_directory.hpp"

namespace previz::test::pipeline_cache_test {

namespace fs = std::filesystem;

void write(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

class PipelineCacheTest : public ::testing::Test {
 protected:
  // Draws a picture on a device that is opened for it.
  render::Sheet<glm::vec3> picture() {
    render::DeviceOptions options;
    options.validation = true;
    options.cache = folder_ / "cache";
    const auto device = render::open_device(options);
    View view = empty_view({0, -0.8, 1}, {0, 0, 0}, pinhole(16, 12, 0.8), glm::vec3(0.2f));
    add(view.scene, rectangle_mesh({2, 2}), diffuse(glm::vec3(0.5f)));
    SetRenderer renderer(view, {}, set::LightSampling::importance, device);
    auto mixed = renderer.rendered(1).mixed;
    EXPECT_EQ(render::validation_messages(*device), 0u);
    return mixed;
  }

  // Returns the only file that is kept.
  fs::path file() const {
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "cache"))
      files.push_back(entry.path());
    EXPECT_EQ(files.size(), 1u);
    return files.empty() ? fs::path() : files.front();
  }

  // The same, and what is logged meanwhile.
  std::string log_of_picture() {
    testing::internal::CaptureStdout();
    picture();
    return testing::internal::GetCapturedStdout();
  }

  TemporaryDirectory folder_;
};

TEST_F(PipelineCacheTest, IsWrittenOnceForADevice) {
  const auto first = picture();
  EXPECT_THAT(file().filename().string(), StartsWith("pipelines-"));
  EXPECT_GT(fs::file_size(file()), 64u);
  EXPECT_EQ(picture(), first);
  EXPECT_THAT(log_of_picture(), Not(HasSubstr("compiled again")));
  file();
}

TEST_F(PipelineCacheTest, IsLeftOutAndReplacedWhereItIsDamaged) {
  const auto first = picture();
  const std::string whole = test::content_of(file());
  std::string damaged = whole;
  damaged[damaged.size() / 2] ^= 0x20;
  for (const std::string& content : {damaged, whole.substr(0, whole.size() / 2), std::string()}) {
    write(file(), content);
    EXPECT_THAT(log_of_picture(),
                HasSubstr(file().string() + " is damaged; the shaders are compiled"));
    EXPECT_GT(fs::file_size(file()), 64u);
    EXPECT_EQ(picture(), first);
  }
}

TEST_F(PipelineCacheTest, ThatCannotBeWrittenIsSaidAndHarmsNothing) {
  write(folder_ / "cache", "a file in the place of the folder");
  EXPECT_THAT(log_of_picture(), HasSubstr("cannot be kept for the next start"));
}

TEST_F(PipelineCacheTest, KeepsTheFilesOfTheDevicesUsedLast) {
  for (int i = 0; i < 6; ++i) {
    const fs::path old = folder_ / "cache" / ("pipelines-" + std::to_string(i));
    fs::create_directories(old.parent_path());
    write(old, "of another device");
    fs::last_write_time(old, fs::file_time_type::clock::now() - std::chrono::hours(10 - i));
  }
  write(folder_ / "cache" / "other", "of another program");
  picture();
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "cache"))
    names.insert(entry.path().filename());
  EXPECT_EQ(names.size(), render::PipelineCache::most_files + 1);
  EXPECT_TRUE(names.contains("other") && names.contains("pipelines-5"));
  EXPECT_FALSE(names.contains("pipelines-2"));
}

TEST(CacheFolder, IsThatOfTheSpecification) {
  const EnvironmentVariable cache("XDG_CACHE_HOME", "/var/cache/rig");
  EXPECT_EQ(render::cache_folder(), "/var/cache/rig/previzd");
  const EnvironmentVariable relative("XDG_CACHE_HOME", "cache");
  const EnvironmentVariable home("HOME", "/home/crew");
  EXPECT_EQ(render::cache_folder(), "/home/crew/.cache/previzd");
}

}  // namespace previz::test::pipeline_cache_test
