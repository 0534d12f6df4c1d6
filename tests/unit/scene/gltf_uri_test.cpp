#include "daemon/core/scene/gltf_uri.hpp"

#include "tests/support/gltf_test.hpp"
#include "tests/support/session_fixture.hpp"

namespace previz::test::gltf_uri_test {

const std::vector<unsigned char> one_texel = {200, 60, 30, 255};

std::string escaped_bytes(const std::vector<unsigned char>& bytes) {
  std::string text;
  for (const unsigned char byte : bytes)
    text += {'%', "0123456789abcdef"[byte >> 4], "0123456789abcdef"[byte & 15]};
  return text;
}

class GltfUris : public GltfTest {
 protected:
  GltfUris() {
    gltf.root("a", gltf.triangle_mesh());
    gltf.save(directory / "sound.gltf");
    sound = Json::parse(session::content_of(directory / "sound.gltf"));
    first_primitive()["material"] =
        gltf.add("materials",
                 {{"name", "m"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
    gltf.add("textures", {{"source", 0}});
    gltf.add("images", Json::object());
  }
  scene::Scene load_with_image(const std::string& uri) {
    gltf.json["images"][0] = {{"uri", uri}};
    return load();
  }
  std::string error_with_image(const std::string& uri) {
    return test::error_of([&] { load_with_image(uri); });
  }
  // Loads the sound file with another URI of its only buffer.
  scene::Scene load_with_buffer(const std::string& uri) {
    Json json = sound;
    json["buffers"][0]["uri"] = uri;
    session::write_content(directory / "raw.gltf", json.dump());
    return scene::load_scene(set_of(directory / "raw.gltf"));
  }
  Json sound;
};

// RFC 2397: data:[<mediatype>][;base64],<data>
TEST_F(GltfUris, DataOfAnyTypeIsDecoded) {
  const std::vector<unsigned char> picture = png(1, 1, one_texel);
  const std::vector<float> corners = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::vector<unsigned char> buffer = GltfWriter::bytes_of(corners);
  const auto texels =
      load_with_image("data:image/png;base64," + base64(picture)).textures.at(0).texels;
  const auto positions = load_with_buffer("data:application/octet-stream;base64," + base64(buffer))
                             .meshes.at(0)
                             .positions;
  for (const char* type : {"image/jpg", "image/jpeg;name=a.jpg", "image/webp", "", ";charset=utf-8",
                           "model/vnd.x+y", "application/octet-stream;charset=utf-8",
                           "application/gltf-buffer", "text/plain;a=b;c=d"}) {
    for (const std::string& start : {std::string("data:"), std::string("DATA:")})
      for (const std::string& code : {std::string(";base64,"), std::string("; BASE64,")}) {
        EXPECT_EQ(load_with_image(start + type + code + base64(picture)).textures.at(0).texels,
                  texels)
            << start << type << code;
        EXPECT_EQ(load_with_buffer(start + type + code + base64(buffer)).meshes.at(0).positions,
                  positions)
            << start << type << code;
      }
    const std::string plain = std::string("data:") + type + ",";
    EXPECT_EQ(load_with_image(plain + escaped_bytes(picture)).textures.at(0).texels, texels)
        << type;
    EXPECT_EQ(load_with_buffer(plain + escaped_bytes(buffer)).meshes.at(0).positions, positions)
        << type;
  }
}

TEST(GltfData, IsDecodedInEveryFormOfBase64) {
  const std::vector<unsigned char> bytes = {0xfb, 0xff, 0xfe, 0x41};  // +//+QQ==
  for (const char* code :
       {"+//+QQ==", "-__-QQ==", "%2B%2F%2f%2BQQ%3D%3D", "+//+QQ", "+// +\n QQ=="})
    EXPECT_EQ(scene::data_of(std::string("data:;base64,") + code, "x"), bytes) << code;
  for (const char* type :
       {";base64;charset=utf-8", "image/png;Base64;charset=utf-8", ";a=b;base64"})
    EXPECT_EQ(scene::data_of(std::string("data:") + type + ",+//+QQ==", "x"), bytes) << type;
  for (const char* type : {";name=base64", "base64", ";base64=1"})
    EXPECT_EQ(scene::data_of(std::string("data:") + type + ",QQ==", "x").size(), 4u) << type;
  EXPECT_EQ(scene::data_of("data:,a%20b+c%zz%4", "x"),
            (std::vector<unsigned char>{'a', ' ', 'b', '+', 'c', '%', 'z', 'z', '%', '4'}));
  for (const char* code : {"+//+Q", "a*bc", "ab==cd=\xff", "="})
    EXPECT_THAT(error_of([&] { scene::data_of(std::string("data:;base64,") + code, "x"); }),
                HasSubstr("x: its data URI is not valid base64"))
        << code;
  EXPECT_THAT(error_of([&] { scene::data_of("data:image/png", "x"); }), HasSubstr("has no comma"));
}

TEST_F(GltfUris, AreNeverRepeatedAtLength) {
  const std::string file = (directory / "test.gltf").string();
  const std::string junk(100000, 'A');
  std::vector<std::string> said = {
      error_with_image("data:image/png;base64," + junk + "*"),
      error_with_image("data:image/png;base64," + junk),
      error_with_image("data:image/png" + junk),
      error_with_image("maps/" + junk + ".png"),
      error_of([&] { load_with_buffer("data:x;base64," + junk); }),
      error_of([&] { load_with_buffer("data:x;base64," + junk + "*"); }),
      error_of([&] { load_with_buffer(junk + ".bin"); })};
  for (const std::string& message : said) {
    EXPECT_NE(message, "");
    EXPECT_LT(message.size(), file.size() + 250) << message.substr(0, 400);
  }
  gltf.json["nodes"][0]["name"] = gltf.json["materials"][0]["name"] = junk;
  gltf.json["materials"][0]["alphaMode"] = junk;
  gltf.json["extensionsUsed"] = {junk};
  for (const std::string& note :
       load_with_image("data:," + escaped_bytes(png(1, 1, one_texel))).notes)
    EXPECT_LT(note.size(), file.size() + 350) << note.substr(0, 500);
}

TEST_F(GltfUris, OfFilesAreReadAsOtherProgramsWriteThem) {
  std::filesystem::create_directories(directory / "maps");
  const std::vector<unsigned char> picture = png(1, 1, one_texel);
  const std::vector<float> corners = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::vector<unsigned char> buffer = GltfWriter::bytes_of(corners);
  for (const char* name : {"maps/a b", "leaf+1", "red"}) {
    session::write_content(directory / (name + std::string(".png")),
                           {picture.begin(), picture.end()});
    session::write_content(directory / (name + std::string(".bin")),
                           {buffer.begin(), buffer.end()});
  }
  for (const char* name : {"maps/a b", "maps\\a b", "maps/a%20b", "leaf+1", "leaf%2B1"}) {
    EXPECT_THAT(load_with_image(name + std::string(".png")).notes, Each(HasSubstr("TEXCOORD_0")))
        << name;
    EXPECT_THAT(load_with_buffer(name + std::string(".bin")).notes, ElementsAre()) << name;
  }
  EXPECT_THAT(load_with_image("RED.PNG").notes,
              Contains(HasSubstr("texture \"RED.PNG\": is read from red.png")));
  EXPECT_THAT(load_with_image("C:\\jobs\\red.png").notes,
              Contains(HasSubstr("texture \"C:\\jobs\\red.png\": is read from red.png")));
  EXPECT_THAT(load_with_buffer("/Users/x/RED.bin").notes,
              ElementsAre(HasSubstr("buffer \"/Users/x/RED.bin\": is read from red.bin")));
  EXPECT_THAT(error_with_image("maps/lost.png"),
              HasSubstr("image 0 \"maps/lost.png\": not found; put it beside the file"));
  gltf.json["images"][0] = {{"uri", "lost.png"}, {"name", "wood"}};
  EXPECT_THAT(error(),
              HasSubstr("image 0 \"wood\": its file \"lost.png\" is not found; put it beside"));
}

}  // namespace previz::test::gltf_uri_test
