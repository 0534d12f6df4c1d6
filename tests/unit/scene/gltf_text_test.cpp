#include "daemon/core/scene/gltf_text.hpp"

#include "tests/support/gltf_test.hpp"
#include "tests/support/session_fixture.hpp"

namespace previz::test::gltf_text_test {

class GltfText : public GltfTest {
 protected:
  GltfText() {
    gltf.root("chair", gltf.triangle_mesh());
    gltf.save(directory / "sound.gltf");
    sound = session::content_of(directory / "sound.gltf");
  }
  // The sound file with one text of it changed into another; saved() is given to load_bytes().
  std::string with(const std::string& text, const std::string& other) const {
    std::string changed = sound;
    const std::size_t at = changed.find(text);
    return at == std::string::npos ? "" : changed.replace(at, text.size(), other);
  }
  // JSON with members before those of the sound file.
  std::string with_members(const std::string& members) const {
    return "{" + members + "," + sound.substr(sound.find('{') + 1);
  }
  scene::Scene load_bytes(const std::string& bytes, const std::string& name = "raw.gltf") {
    session::write_content(directory / name, bytes);
    return scene::load_scene(set_of(directory / name));
  }
  std::string error_of_bytes(const std::string& bytes, const std::string& name = "raw.gltf") {
    const std::string file = (directory / name).string();
    std::string message = test::error_of([&] { load_bytes(bytes, name); });
    EXPECT_THAT(message, Not(HasSubstr("json.exception")));
    EXPECT_LT(message.size(), file.size() + 250) << message;
    return message.starts_with(file + ": ") ? message.substr(file.size() + 2) : message;
  }
  std::string sound;
};

TEST_F(GltfText, BoundsThatAreNotFiniteAreIgnoredWithANote) {
  for (const char* word :
       {"NaN", "nan", "-nan(ind)", "Infinity", "-Infinity", "inf", "1e999", "-1.#IND", "1.#QNAN"}) {
    const std::string bounds =
        with("\"accessors\":[{",
             std::string("\"accessors\":[{\"min\":[0,") + word + ",0],\"max\":[" + word + ",1,1],");
    ASSERT_NE(bounds, "");
    const scene::Scene scene = load_bytes(bounds);
    EXPECT_EQ(scene.instances.size(), 1u) << word;
    EXPECT_THAT(scene.notes,
                ElementsAre(HasSubstr("accessors[0].min is not finite, as 1 more of the file: "
                                      "bounds are not needed; ignored")))
        << word;
  }
}

TEST_F(GltfText, NumbersThatAreNotFiniteAreRefusedByTheirPlace) {
  for (const char* word : {"NaN", "-Infinity", "1e999"})
    EXPECT_EQ(error_of_bytes(with("\"nodes\":[{",
                                  std::string("\"nodes\":[{\"translation\":[0,") + word + ",0],")),
              std::string("nodes[0].translation[1] is ") + word +
                  "; it must be a finite number; export the file again, or correct it there");
  EXPECT_EQ(load_bytes(with_members(R"("extras":{"a":[NaN,"NaN"]})")).instances.size(), 1u);
}

TEST_F(GltfText, LettersThatAreNotUtf8AreReplacedWithANote) {
  const scene::Scene scene = load_bytes(with("\"chair\"", "\"St\xfchle \xe4\xf6, gr\xc3\xbcn\""));
  ASSERT_EQ(scene.instances.size(), 1u);
  EXPECT_EQ(scene.instances[0].node, "St\xef\xbf\xbdhle \xef\xbf\xbd\xef\xbf\xbd, gr\xc3\xbcn");
  EXPECT_THAT(scene.notes,
              ElementsAre(HasSubstr("nodes[0].name has letters that are not UTF-8: \xef\xbf\xbd "
                                    "stands for each; export the file again")));
  for (const char* bad :
       {"\xc3", "\xed\xa0\x80", "\xf5\x80\x80\x80", "\xc0\xaf", "\xe2\x82", "\xff"})
    EXPECT_EQ(load_bytes(with("\"chair\"", std::string("\"a") + bad + "\"")).notes.size(), 1u)
        << bad;
}

TEST_F(GltfText, OtherDamageIsRefusedByItsPlace) {
  EXPECT_EQ(
      error_of_bytes("{\n \"asset\": {\"version\": \"2.0\"},\n \"nodes\": [{\"name\": oak}]\n}"),
      "is not a valid glTF file: its JSON is damaged in line 3, column 21, near nodes[0].name, "
      "at \"oak}]\"; export the file again, or correct it there");
  EXPECT_THAT(error_of_bytes("{\"asset\": {\"version\": \"2.0\"},\n\"nodes\": [{}, {},]}"),
              AllOf(HasSubstr("in line 2, column 18, near nodes[2], at \"]}\"")));
  EXPECT_EQ(
      error_of_bytes("{\"asset\": {\"version\": \"2.0\"}, \"nodes\": [{}, {\"na"),
      "is not a valid glTF file: its JSON ends too early, near nodes[1]: the file is cut short; "
      "copy it or export it again");
  EXPECT_THAT(error_of_bytes(with("\"chair\"", "\"a\tb\"")), HasSubstr("nodes[0].name"));
  EXPECT_THAT(error_of_bytes("{" + std::string(300, 'x') + "}"), HasSubstr("line 1, column 2"));
  for (const char* comment : {"// made by x\n", "/* made by x */\n"})
    EXPECT_THAT(error_of_bytes(comment + sound),
                AllOf(HasSubstr("its JSON is damaged in line 1, column 1, at \"/"),
                      HasSubstr("made by x")));
  EXPECT_THAT(error_of_bytes(" \n"), HasSubstr("it is empty; export it again"));
  EXPECT_THAT(error_of_bytes("hello there"), HasSubstr("it is neither binary glTF nor JSON"));
}

TEST_F(GltfText, FilesOfOtherFormatsAreNamed) {
  const auto is = [](const std::string& what) {
    return "is " + what + "; an object is glTF 2.0 (.glb or .gltf): export it as that";
  };
  const std::string blender = ", or open it in Blender and export it";
  const std::string own = " from the program that it was made in";
  struct Try {
    std::string bytes, name, words;
  };
  const std::string junk(40, '\2');
  for (const auto& [bytes, name, words] : std::vector<Try>{
           {"# chair\no Chair\nv 0 0 0\n", "chair.obj", is("an OBJ file") + blender},
           {"mtllib a.mtl\n", "chair", is("an OBJ file") + blender},
           {"Kaydara FBX Binary  " + junk, "chair", is("an FBX file") + blender},
           {"; FBX 7.4.0 project file\n", "chair.glb", is("an FBX file") + blender},
           {"#usda 1.0\n", "chair.usd", is("a USD file") + blender},
           {"PXR-USDC" + junk, "chair.glb", is("a USD file") + blender},
           {"PK\3\4" + junk, "chair.USDZ", is("a USDZ file") + blender},
           {"<?xml version=\"1.0\"?>\n<COLLADA xmlns=\"\">", "chair",
            is("a COLLADA file") + blender},
           {"<?xml version=\"1.0\"?>\n<X3D>", "chair", is("an X3D file") + blender},
           {"#VRML V2.0 utf8\n", "chair.wrl", is("a VRML file") + blender},
           {"Ogawa" + junk, "chair", is("an Alembic file") + blender},
           {"\x89HDF\r\n" + junk, "chair.abc", is("an Alembic file") + blender},
           {"solid chair\n", "chair", is("an STL file") + blender},
           {junk, "chair.stl", is("an STL file") + blender},
           {"ply\nformat ascii 1.0\n", "chair", is("a PLY file") + blender},
           {"BLENDER-v304" + junk, "chair", is("a Blender file") + blender},
           {"\x28\xb5\x2f\xfd" + junk, "chair.blend", is("a Blender file") + blender},
           {"MM" + junk, "chair.3ds", is("a 3DS file") + own},
           {"\xd0\xcf\x11\xe0" + junk, "chair.max", is("a 3ds Max file") + own},
           {"//Maya ASCII 2024 scene\n", "chair.ma", is("a Maya file") + own},
           {"FOR4" + junk, "chair.mb", is("a Maya file") + own},
           {"QC4DC4D6" + junk, "chair", is("a Cinema 4D file") + own},
           {"ISO-10303-21;\n", "chair.stp", is("a STEP file") + own},
           {"PK\3\4" + junk, "chair.zip",
            "is a ZIP archive: unpack it, and name the .glb or .gltf file in it"},
           {"\n<!DOCTYPE HTML><html>", "chair.glb", "is a web page: download the file itself"},
           {"version https://git-lfs.github.com/spec/v1\noid", "chair.glb",
            "is a pointer of Git LFS: fetch the file by \"git lfs pull\""},
           {"\x89PNG\r\n\x1a\n" + junk, "chair.glb",
            "is a picture (PNG); an object is glTF 2.0 (.glb or .gltf)"}})
    EXPECT_EQ(error_of_bytes(bytes, name), words);
  // As much as a scene has; its bytes happen to be brackets, too.
  std::minstd_rand random(1);
  std::string noise(1u << 20u, '\0');
  for (char& c : noise) c = static_cast<char>(random() >> 8u & 255u);
  noise[0] = '\2';
  EXPECT_EQ(error_of_bytes("BLENDER-v300" + noise, "chair"), is("a Blender file") + blender);
  EXPECT_EQ(error_of_bytes("Ogawa" + noise, "chair"), is("an Alembic file") + blender);
  EXPECT_EQ(error_of_bytes(noise, "chair.mb"), is("a Maya file") + own);
  EXPECT_THAT(error_of_bytes(noise, "chair"), HasSubstr("it is neither binary glTF nor JSON"));
  EXPECT_EQ(load_bytes(sound, "chair.obj").instances.size(), 1u);  // what it holds decides
}

TEST_F(GltfText, PartsWithoutANameAreCalledByTheirNumber) {
  first_primitive()["material"] = gltf.add("materials", {{"alphaMode", "ODD"}});
  gltf.json["meshes"][0].erase("name");
  gltf.json["materials"][0]["extensions"]["KHR_materials_unlit"] = Json::object();
  gltf.json["extensionsUsed"] = {"KHR_materials_unlit"};
  EXPECT_THAT(load().notes,
              UnorderedElementsAre(HasSubstr("(materials: number 0)"),
                                   HasSubstr(": material 0: alphaMode \"ODD\" is unknown")));
}

}  // namespace previz::test::gltf_text_test
