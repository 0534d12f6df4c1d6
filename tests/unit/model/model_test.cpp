// The command on the bundled take: from marks in its pictures to a phantom in the set file.
#include "daemon/tools/model/model.hpp"

#include <fmt/format.h>

#include "daemon/core/output/png.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/tools/calibrate/known_camera.hpp"
#include "daemon/tools/model/parts.hpp"
#include "daemon/tools/model/views.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/unit/model/tagged_scan.hpp"

namespace previz::test {
namespace {

namespace fs = std::filesystem;

const fs::path session = fs::path(PREVIZ_SOURCE_DIR) / "config/demo/session";
const fs::path demo = fs::path(PREVIZ_SOURCE_DIR) / "config/demo/demo.toml";

// The corners of a thing of the demo's own phantom, in the world.
std::vector<glm::dvec3> corners_of(const std::string& node) {
  set::Set set = set::load_set(demo);
  std::erase_if(set.objects,
                [](const set::Object& o) { return o.presence != set::Presence::phantom; });
  set.objects.at(0).nodes = {node};
  const scene::Scene scene = scene::load_scene(set);
  std::vector<glm::dvec3> corners;
  for (const glm::vec3& vertex : scene.meshes.at(0).positions) {
    const glm::dvec3 p(scene.instances.at(0).world_from_object * glm::dvec4(vertex, 1));
    if (std::ranges::none_of(corners,
                             [&](const glm::dvec3& q) { return glm::distance(p, q) < 1e-5; }))
      corners.push_back(p);
  }
  return corners;
}

// Its upper four, in order around.
std::vector<glm::dvec3> top_of(const std::string& node) {
  std::vector<glm::dvec3> corners = corners_of(node);
  std::ranges::sort(corners, {}, [](const glm::dvec3& p) { return -p.z; });
  corners.resize(4);
  glm::dvec3 middle(0);
  for (const glm::dvec3& p : corners) middle += 0.25 * p;
  std::ranges::sort(
      corners, {}, [&](const glm::dvec3& p) { return std::atan2(p.y - middle.y, p.x - middle.x); });
  return corners;
}

const std::vector<int> frames = {0, 2, 5};

// Returns the marks that a careful person would make of the red cube, to a tenth of a pixel.
std::string marks() {
  model::Parts parts;
  for (const int frame : frames) parts.pictures.push_back({fmt::format("frame {}", frame), {}});
  const ObserverCalibration camera = calibrate::known_observer(demo, session);
  const auto source = calibrate::open_source(session, "observer");
  const model::Views views =
      model::find_views(*source, camera, set::load_set(demo).tracking, parts);
  std::string text;
  for (const model::MarkedView& view : views.views) {
    text += fmt::format("[[picture]]\nfile = \"{}\"\n[picture.points]\n", view.name);
    int number = 0;
    for (const glm::dvec3& p : top_of("cube_red")) {
      const glm::dvec2 px =
          model::projected(views.lens, view.pose.pose.rotation * p + view.pose.pose.translation);
      text += fmt::format("t{} = [{:.1f}, {:.1f}]\n", ++number, px.x, px.y);
    }
  }
  return text;
}

const std::string parts_text = R"(
[[plane]]
name = "table"
tags = [0, 1, 2]
tag_thickness_m = 0.0003
[[box]]
name = "red"
on = "table"
top = ["t1", "t2", "t3", "t4"]
)";

class ModelCommand : public testing::Test {
 protected:
  void SetUp() override {
    fs::copy(demo.parent_path(), folder_ / "demo", fs::copy_options::recursive);
    options_.footage = session;
    options_.set_file = folder_ / "demo/demo.toml";
    options_.parts_file = folder_ / "demo/real.toml";
    options_.write = true;
    options_.grey = true;  // colours take seconds
  }

  void write_parts(const std::string& text) { std::ofstream(options_.parts_file) << text; }

  void make() { model::make_model(options_, out_); }
  std::string refusal() {
    std::ostringstream out;
    return error_of([&] { model::make_model(options_, out); });
  }

  TemporaryDirectory folder_;
  model::ModelOptions options_;
  std::ostringstream out_;
};

TEST_F(ModelCommand, MakesAPhantomAndAddsItToTheSet) {
  write_parts(marks() + parts_text);
  make();
  EXPECT_THAT(out_.str(), HasSubstr("12 marks in 3 pictures"));
  EXPECT_THAT(out_.str(), HasSubstr("red, top: accurate to"));
  EXPECT_THAT(out_.str(), HasSubstr("the set has a phantom \"table and cubes\" beside this model"));
  const set::Set set = set::load_set(*options_.set_file);
  const auto added = std::ranges::find(set.objects, "real", &set::Object::name);
  ASSERT_NE(added, set.objects.end());
  EXPECT_EQ(added->presence, set::Presence::phantom);
  EXPECT_TRUE(fs::exists(folder_ / "demo/real.glb"));
  // It is where the demo's own is, within three of the deviations that are stated of its worst
  // face: half a millimetre, by three pictures that are taken from nearly one side.
  set::Set only = set;
  only.objects = {*added};
  only.objects[0].nodes = {"red"};
  const scene::Scene scene = scene::load_scene(only);
  for (const glm::dvec3& p : corners_of("cube_red")) {
    double nearest = 1;
    for (const glm::vec3& vertex : scene.meshes.at(0).positions)
      nearest =
          std::min(nearest, glm::distance(p, glm::dvec3(scene.instances.at(0).world_from_object *
                                                        glm::dvec4(vertex, 1))));
    EXPECT_LT(nearest, 1.5e-3);
  }
  // Once more, nothing is added twice.
  std::ostringstream again;
  model::make_model(options_, again);
  EXPECT_THAT(again.str(), HasSubstr("lists this model already"));
  EXPECT_EQ(set::load_set(*options_.set_file).objects.size(), set.objects.size());
}

// Checks which worlds the made tags are in, and that what is under them has the table's colour, but
// for its grain.
void expect_tags(set::Set made, bool hides) {
  made.hides_tags = hides;
  const scene::Scene scene = scene::load_scene(made);
  const auto table = std::ranges::find(scene.materials, "table", &scene::Material::name);
  ASSERT_NE(table, scene.materials.end());
  int under = 0, printed = 0;
  for (const scene::Instance& instance : scene.instances) {
    if (instance.tag == scene::TagPart::printed) {
      ++printed;
      EXPECT_EQ(instance.presence, hides ? scene::world_real : scene::world_both);
    }
    if (instance.tag != scene::TagPart::under) continue;
    ++under;
    EXPECT_EQ(instance.presence, hides ? scene::world_mixed : 0u);
    glm::vec3 mean(0);
    const scene::Mesh& mesh = scene.meshes[instance.mesh];
    for (const glm::vec4& color : mesh.colors) mean += glm::vec3(color) / float(mesh.colors.size());
    for (glm::length_t c = 0; c < 3; ++c) EXPECT_NEAR(mean[c] / table->base_color[c], 1, 0.3);
  }
  EXPECT_EQ(under, 3);
  EXPECT_EQ(printed, 6);
}

// The red cube is matt. What the comparison does not know, of which the light that the fisheye
// cannot see and the grain of the table are most, is below a tenth.
TEST_F(ModelCommand, MeasuresTheColoursOfFacesAndTags) {
  options_.grey = false;
  write_parts(marks() + parts_text);
  make();
  set::Set made = set::load_set(*options_.set_file), own = made;
  std::erase_if(made.objects, [](const set::Object& o) { return o.name != "real"; });
  std::erase_if(own.objects, [](const set::Object& o) { return o.name != "table and cubes"; });
  const scene::Scene found = scene::load_scene(made), truth = scene::load_scene(own);
  const auto colour_in = [](const scene::Scene& scene, const std::string& material) {
    const auto at = std::ranges::find(scene.materials, material, &scene::Material::name);
    return at == scene.materials.end() ? glm::vec3(-1) : at->base_color;
  };
  for (glm::length_t c = 0; c < 3; ++c)
    EXPECT_NEAR(colour_in(found, "red")[c] / colour_in(truth, "red")[c], 1, 0.1) << c;
  // White paper and black print, as printers have them.
  for (glm::length_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(colour_in(found, "tag 0 paper")[c], 0.79, 0.08);
    EXPECT_NEAR(colour_in(found, "tag 0 print")[c], 0.04, 0.01);
  }
  EXPECT_THAT(out_.str(), HasSubstr("under tag 2: continued from"));
  // How far it is, from the first line on.
  EXPECT_THAT(out_.str(), StartsWith(session.string() + ": looking for tags and edges\n"));
  EXPECT_THAT(out_.str(), HasSubstr("colours: first rounds ("));
  EXPECT_THAT(out_.str(), HasSubstr("colours: looking around tags (100 %)"));
  for (const bool hides : {false, true}) expect_tags(made, hides);
}

// Tags alone go beside a phantom of another program, and need no box or mark in the file.
TEST_F(ModelCommand, MakesTheTagsAlone) {
  options_.tags_only = true;
  write_parts(marks() + parts_text);
  make();
  EXPECT_THAT(out_.str(), Not(HasSubstr("beside this model")));
  set::Set made = set::load_set(*options_.set_file);
  std::erase_if(made.objects, [](const set::Object& o) { return o.name != "real"; });
  const scene::Scene scene = scene::load_scene(made);
  EXPECT_EQ(scene.instances.size(), 6u);
  for (const scene::Instance& instance : scene.instances)
    EXPECT_EQ(instance.tag, scene::TagPart::printed);
  write_parts(marks() +
              "[[box]]\nname = \"red\"\nheight_m = 0.09\ntop = [\"t1\", \"t2\", \"t3\", \"t4\"]\n");
  EXPECT_THAT(refusal(), HasSubstr("no tag lies on a part"));
}

// The marks that somebody made by eye, as the demo's README shows them.
TEST_F(ModelCommand, MakesTheDemosThings) {
  options_.parts_file = folder_ / "demo/real.toml";
  options_.write = false;
  make();
  set::Set made = set::load_set(*options_.set_file);
  for (const auto& [node, truth] : {std::pair("red cube", "cube_red"),
                                    {"yellow cube", "cube_yellow"},
                                    {"blue cube", "cube_blue"}}) {
    made.objects.resize(1);
    made.objects[0].file = folder_ / "demo/real.glb";
    made.objects[0].nodes = {node};
    const scene::Scene scene = scene::load_scene(made);
    for (const glm::dvec3& p : corners_of(truth)) {
      double nearest = 1;
      for (const glm::vec3& vertex : scene.meshes.at(0).positions)
        nearest = std::min(nearest, glm::distance(p, glm::dvec3(vertex.x, -vertex.z, vertex.y)));
      EXPECT_LT(nearest, 1.5e-3) << node;
    }
  }
}

TEST_F(ModelCommand, PlacesAScanByItsPoints) {
  const std::vector<glm::dvec3> top = top_of("cube_red");
  std::ofstream obj(folder_ / "demo/cube.obj");
  std::string parts = "[[scan]]\nname = \"cube\"\nfile = \"cube.obj\"\n[scan.points]\n";
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec3 cm = 100.0 * glm::dvec3(top[i].y, top[i].z, top[i].x);
    obj << fmt::format("v {} {} {}\n", cm.x, cm.y, cm.z);
    parts += fmt::format("t{} = [{}, {}, {}]\n", i + 1, cm.x, cm.y, cm.z);
  }
  obj << "f 1 2 3\nf 1 3 4\n";
  obj.close();
  write_parts(marks() + parts);
  const std::string missing = refusal();
  EXPECT_THAT(missing, HasSubstr("its points fit best with unit = \"cm\""));
  EXPECT_THAT(missing, HasSubstr("its points fit best with up = \"y\""));
  parts.insert(parts.find("[scan.points]"), "unit = \"cm\"\nup = \"y\"\n");
  write_parts(marks() + parts);
  make();
  EXPECT_THAT(out_.str(), HasSubstr("scan cube: 4 points, rms 0."));
  EXPECT_THAT(out_.str(), HasSubstr("scan cube: 1 open borders"));
  EXPECT_THAT(out_.str(), Not(HasSubstr("ignored")));
  EXPECT_TRUE(fs::exists(folder_ / "demo/real.glb"));
}

TEST_F(ModelCommand, LooksForTagsOnAScanWithoutPoints) {
  std::ofstream(folder_ / "demo/cube.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  write_parts("[[scan]]\nname = \"cube\"\nfile = \"cube.obj\"\n");
  EXPECT_THAT(refusal(), HasSubstr("scan \"cube\", cube.obj: has no points, and neither a texture "
                                   "nor colours that could show the set's tags"));
}

// There is nothing to mark in the pictures, and nothing to draw over them.
TEST_F(ModelCommand, PlacesAScanAloneByItsTags) {
  TaggedFace table{{-0.5, -0.25, 0}, {1, 0, 0}, {0, 1, 0}, 0.9, 0.6};
  table.tags = set::load_set(*options_.set_file).tracking.tags;
  TaggedScan scan = textured_scan({table}, 2e-3);
  scan.move([](const glm::dvec3& p) { return glm::dvec3(p.x, p.z, -p.y); });
  write_textured_glb(folder_ / "demo/table.glb", scan);
  write_parts("[[scan]]\nname = \"table\"\nfile = \"table.glb\"\n");
  options_.overlay = folder_ / "over";
  make();
  EXPECT_THAT(out_.str(), HasSubstr("looking for tags on scan table\n"));
  EXPECT_THAT(out_.str(), HasSubstr("scan table: placed by tags 0, 1 and 2 (12 corners), rms 0."));
  EXPECT_THAT(out_.str(), Not(HasSubstr("marks in")));
  EXPECT_THAT(out_.str(), HasSubstr("scans are not drawn over the pictures"));
  EXPECT_FALSE(fs::exists(folder_ / "over"));
  set::Set made = set::load_set(*options_.set_file);
  std::erase_if(made.objects, [](const set::Object& o) { return o.name != "real"; });
  EXPECT_EQ(scene::load_scene(made).instances.size(), 1u);
}

TEST_F(ModelCommand, TakesANameThatTheSetDoesNotHave) {
  std::ofstream(*options_.set_file, std::ios::app)
      << "\n[[object]]\nname = \"real\"\nfile = \"phantom.glb\"\npresence = \"phantom\"\n";
  write_parts(marks() + parts_text);
  make();
  const set::Set set = set::load_set(*options_.set_file);
  EXPECT_NE(std::ranges::find(set.objects, "real 2", &set::Object::name), set.objects.end());
}

TEST_F(ModelCommand, ReplacesNothingThatItIsMadeOf) {
  write_parts(marks() + parts_text);
  const std::string before = test::content_of(options_.parts_file);
  options_.out = options_.parts_file;
  EXPECT_THAT(refusal(), HasSubstr("real.toml: the model is a .glb file"));
  EXPECT_EQ(test::content_of(options_.parts_file), before);
  options_.out = folder_ / "demo/phantom.glb";
  write_parts(marks() + parts_text +
              "[[scan]]\nname = \"s\"\nfile = \"phantom.glb\"\n[scan.points]\n"
              "t1 = [0, 0, 0]\nt2 = [1, 0, 0]\nt3 = [0, 1, 0]\n");
  EXPECT_THAT(refusal(), HasSubstr("phantom.glb: is a scan of the model"));
  options_.out = folder_ / "demo/virtual.glb";
  write_parts(marks() + parts_text);
  EXPECT_THAT(refusal(), HasSubstr("which is not a phantom"));
}

TEST_F(ModelCommand, SaysWhatABeginnerMeant) {
  options_.write = false;
  // A name that is misspelled in a picture.
  write_parts(marks() + "t33 = [100, 100]\n" + parts_text);
  make();
  EXPECT_THAT(
      out_.str(),
      HasSubstr("real.toml: point \"t33\" belongs to no part and is ignored; did you mean t3?"));
  EXPECT_THAT(out_.str(), HasSubstr("farthest off: \"t"));
  // The name of the picture's file.
  std::string text = marks();
  for (std::size_t at = text.find("frame "); at != std::string::npos; at = text.find("frame "))
    text[at + 5] = '_';
  write_parts(text + parts_text);
  make();
  // Corners in another order than around.
  std::string crossed = parts_text;
  crossed.replace(crossed.find("\"t3\", \"t4\""), 10, "\"t4\", \"t3\"");
  write_parts(marks() + crossed);
  EXPECT_THAT(refusal(), HasSubstr("list"));
  // A header that is forgotten.
  std::string lost = marks();
  lost.erase(lost.find("[[picture]]", 5), 11 + std::string("\nfile = \"frame 2\"").size());
  write_parts(lost + parts_text);
  EXPECT_THAT(refusal(), HasSubstr("is [[picture]] with its file missing above it?"));
}

TEST_F(ModelCommand, OnePictureHasOneTable) {
  write_parts(marks() +
              "[[picture]]\nfile = \"observer frame 0\"\n[picture.points]\nq = [10, 10]\n" +
              parts_text);
  EXPECT_THAT(refusal(), HasSubstr("are the same picture"));
}

// A set file that cannot be changed is found out before anything is written.
TEST_F(ModelCommand, WritesNoModelForASetThatCannotBeChanged) {
  std::string text = test::content_of(*options_.set_file);
  const std::size_t first = text.find("[[object]]");
  std::ofstream(*options_.set_file)
      << "object = [{name = \"x\", file = \"phantom.glb\", presence = \"phantom\"}]\n"
      << text.substr(0, first);
  write_parts(marks() + parts_text);
  EXPECT_THAT(refusal(), HasSubstr("object"));
  EXPECT_FALSE(fs::exists(folder_ / "demo/real.glb"));
}

// A green line goes along the cube's upper front edge, and a red cross is on each mark.
TEST_F(ModelCommand, DrawsTheModelOverThePictures) {
  options_.write = false;
  options_.overlay = folder_ / "over";
  write_parts(marks() + parts_text);
  make();
  for (const int frame : frames) {
    const Plate over =
        output::read_png(*options_.overlay / fmt::format("frame_{}.model.png", frame));
    int green = 0, red = 0;
    for (std::size_t i = 0; i + 2 < over.samples.size(); i += 3) {
      const int r = over.samples[i], g = over.samples[i + 1], b = over.samples[i + 2];
      green += g > 200 && r < 120 && b < 140;
      red += r > 240 && g < 75 && b < 75;
    }
    EXPECT_GT(green, 100) << frame;
    EXPECT_GT(red, 8) << frame;  // crosses are smoothed
  }
}

TEST_F(ModelCommand, WritesPicturesToMarkPointsIn) {
  options_.parts_file.clear();
  options_.pictures = folder_ / "marks";
  make();
  const std::string text = test::content_of(folder_ / "marks/model.toml");
  EXPECT_THAT(text, HasSubstr("tags = [0, 1, 2]"));
  EXPECT_TRUE(fs::exists(folder_ / "marks/frame_0.png"));
  // It is a file of parts as it is: a model of nothing but the table.
  const model::Parts parts = model::parse_parts(text, "model.toml");
  EXPECT_EQ(parts.planes.size(), 1u);
  EXPECT_GE(parts.pictures.size(), 3u);
  options_.pictures.reset();
  options_.parts_file = folder_ / "marks/model.toml";
  options_.write = false;
  make();
  EXPECT_TRUE(fs::exists(folder_ / "marks/model.glb"));
  // Marks are never overwritten.
  options_.pictures = folder_ / "marks";
  EXPECT_THAT(refusal(), HasSubstr("model.toml: already exists and may hold marks"));
}

TEST_F(ModelCommand, NamesAPictureThatIsNotOfTheLensesSize) {
  options_.parts_file.clear();
  options_.pictures = folder_ / "marks";
  options_.footage = folder_ / "walk";
  fs::create_directories(options_.footage);
  std::ofstream(*options_.set_file, std::ios::app)
      << "[observer.intrinsics]\nwidth = 640\nheight = 480\nfx = 600\nfy = 600\ncx = 319.5\ncy = "
         "239.5\n";
  const Plate grey{320, 240, 8, std::vector<std::uint16_t>(std::size_t{320} * 240 * 3, 128)};
  output::write_png(options_.footage / "0000.png", grey);
  EXPECT_THAT(refusal(),
              HasSubstr("0000.png: has 320x240 pixels, but the lens is calibrated for 640x480"));
  EXPECT_FALSE(fs::exists(folder_ / "marks"));
}

TEST_F(ModelCommand, NothingIsWrittenWhereSomethingIsWrong) {
  const auto refused = [&](const std::string& text, const std::string& words) {
    write_parts(text);
    EXPECT_THAT(refusal(), HasSubstr(words));
    EXPECT_FALSE(fs::exists(folder_ / "demo/real.glb"));
    EXPECT_FALSE(fs::exists(folder_ / "demo/demo.toml.1.old"));
  };
  refused("[[picture]]\nfile = \"frame 99\"\n" + parts_text, "no picture has a point \"t1\"");
  refused(
      "[[picture]]\nfile = \"frame 99\"\n[[plane]]\nname = \"t\"\ntags = [0]\n",
      "there is no picture \"frame 99\"; the pictures are named like \"frame 0\" and \"frame 5\"");
  refused(
      "[[picture]]\nfile = \"frame 0\"\n[picture.points]\na = [5000, 10]\n[[plane]]\nname = "
      "\"t\"\ntags = [0]\n",
      "frame 0: point \"a\" at 5000.0, 10.0 is outside of the picture");
  options_.set_file.reset();
  refused(marks() + parts_text, "--write needs --set");
}

}  // namespace
}  // namespace previz::test
