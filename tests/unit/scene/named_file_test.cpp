#include "daemon/core/scene/named_file.hpp"

#include "tests/support/session_fixture.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::test::named_file_test {

// The scene stands in a folder of its own, beside which there is another.
class NamedFiles : public ::testing::Test {
 protected:
  NamedFiles() {
    for (const char* folder : {"scene/maps", "beside"})
      std::filesystem::create_directories(directory / folder);
  }
  void put(const std::string& name) { session::write_content(directory / name, name); }
  // The file that is found, from the folder above the scene's; "?" after it: by another name.
  std::string found(const std::string& name, scene::NameRules rules = scene::names_in_objects) {
    const auto file = scene::find_named_file(directory / "scene" / "a.gltf", name, rules);
    if (!file) return "";
    return std::filesystem::canonical(file->path)
               .lexically_relative(std::filesystem::canonical(directory.path()))
               .string() +
           (file->has_other_name ? "?" : "");
  }
  TemporaryDirectory directory;
};

TEST_F(NamedFiles, AreFoundAsProgramsWriteThem) {
  for (const char* name : {"scene/maps/a b.png", "scene/leaf+1.png", "scene/a#1.png"}) put(name);
  for (const auto rules : {scene::names_in_objects, scene::names_in_scans}) {
    for (const char* name : {"maps/a b.png", "maps/a%20b.png", "maps\\a b.png", "maps\\a%20b.png",
                             ".\\maps\\a b.png", "./maps//a%20b.png", "maps%2Fa%20b.png"})
      EXPECT_EQ(found(name, rules), "scene/maps/a b.png") << name;
    EXPECT_EQ(found("leaf+1.png", rules), "scene/leaf+1.png");
    EXPECT_EQ(found("leaf%2B1.png", rules), "scene/leaf+1.png");
    EXPECT_EQ(found("a#1.png", rules), "scene/a#1.png");
    EXPECT_EQ(found("leaf 1.png", rules), "");
  }
}

TEST_F(NamedFiles, OfAnotherComputerAreFoundBesideTheScene) {
  put("scene/red wood.png");
  for (const auto rules : {scene::names_in_objects, scene::names_in_scans})
    for (const char* name :
         {"C:\\jobs\\red wood.png", "/Users/x/red wood.png", "file:///C:/x/red%20wood.png",
          "\\\\server\\maps\\red wood.png", "../lost/red wood.png", "maps/red wood.png"})
      EXPECT_EQ(found(name, rules), "scene/red wood.png?") << name;
}

TEST_F(NamedFiles, AreFoundInLettersOfAnotherCaseIfThatIsClear) {
  for (const char* name : {"scene/maps/red.png", "scene/one.png", "scene/ONE.png"}) put(name);
  for (const char* name : {"maps/RED.PNG", "MAPS/red.png", "Maps\\Red.png"})
    EXPECT_EQ(found(name), "scene/maps/red.png?") << name;
  EXPECT_EQ(found("one.png"), "scene/one.png");
  EXPECT_EQ(found("One.png"), "");  // two have such a name
  EXPECT_EQ(found("C:\\x\\RED.png"), "");
  put("scene/RED.png");
  EXPECT_EQ(found("C:\\x\\red.PNG"), "scene/RED.png?");
}

TEST_F(NamedFiles, LeadOutOfTheFolderOnlyWhereTheyMay) {
  put("beside/a.png");
  EXPECT_EQ(found("../beside/a.png"), "beside/a.png");
  EXPECT_EQ(found("../BESIDE/A.png"), "beside/a.png?");
  EXPECT_EQ(found((directory / "beside" / "a.png").string()), "");
  for (const char* name : {"../beside/a.png", "..\\beside\\a.png", "..%2Fbeside%2Fa.png",
                           "maps/../../beside/a.png", "../BESIDE/A.png"})
    EXPECT_EQ(found(name, scene::names_in_scans), "") << name;
}

TEST_F(NamedFiles, WithoutSenseAreNotFound) {
  put("scene/a.png");
  for (const char* name : {"", ".", "..", "/", "maps", "\\", "a.png%00.exe", "%", "a.png/"})
    EXPECT_EQ(found(name), "") << name;
}

TEST_F(NamedFiles, OfAnyLengthTakeLittleMemory) {
  put("scene/X.mtl");
  std::string dots, folders;
  for (int i = 0; i < 20000; ++i) dots += "./", folders += "m/../";
  for (const std::string& name : {dots + "x.mtl", folders + "x.mtl"}) {
    EXPECT_EQ(found(name), "");  // no system has such a name
    EXPECT_EQ(found(name.substr(name.size() - 4005)), "scene/X.mtl?");
    EXPECT_EQ(found(name + "/"), "");
  }
}

// RFC 3986, 3.4 and 3.5.
TEST_F(NamedFiles, OfUrisMayHaveAQueryOrAFragment) {
  put("scene/maps/a.png");
  for (const char* name : {"maps/a.png?v=3", "maps/a.png#b", "maps/a.png?v=3#b", "MAPS/A.png?v"}) {
    EXPECT_EQ(found(name, scene::names_in_objects), "scene/maps/a.png?") << name;
    EXPECT_EQ(found(name, scene::names_in_scans), "") << name;
  }
  put("scene/maps/a.png#b");
  EXPECT_EQ(found("maps/a.png#b"), "scene/maps/a.png#b");
  EXPECT_EQ(found("?a"), "");
}

// RFC 3986: what a URI decodes to comes first.
TEST_F(NamedFiles, AreDecodedFirstWhereTheyAreUris) {
  for (const char* name : {"scene/a b.png", "scene/a%20b.png"}) put(name);
  EXPECT_EQ(found("a%20b.png", scene::names_in_objects), "scene/a b.png");
  EXPECT_EQ(found("a%20b.png", scene::names_in_scans), "scene/a%20b.png");
}

}  // namespace previz::test::named_file_test
