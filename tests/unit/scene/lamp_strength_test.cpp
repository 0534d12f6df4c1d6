// Lamps of objects beside the film camera's white, in the units that programs write them in.
#include "daemon/core/scene/lamp_strength.hpp"

#include "tests/support/gltf_test.hpp"

namespace previz::test::lamp_strength_test {

using scene::remarks_on_bright_lamps;

// Blender writes a lamp of P watts as 683 P / (4 pi) cd in its "standard" lighting mode.
constexpr double blender_100_w = 100 * 683 / (4 * std::numbers::pi);  // 5435.14

class LampStrength : public GltfTest {
 protected:
  LampStrength() {
    object.name = "chair";
    gltf.json["extensionsUsed"] = {"KHR_lights_punctual"};
  }

  // A root node of the file with a lamp, at this height of glTF's Y.
  void add_lamp(const char* name, const char* type, double intensity, double height = 0) {
    Json& lights = gltf.json["extensions"]["KHR_lights_punctual"]["lights"];
    lights.push_back(
        {{"type", type}, {"name", name}, {"intensity", intensity}, {"spot", Json::object()}});
    gltf.root(name, -1,
              {{"translation", {0, height, 0}},
               {"extensions", {{"KHR_lights_punctual", {{"light", lights.size() - 1}}}}}});
  }

  // A triangle in the world's plane z = 0 at the origin.
  void add_floor() {
    add_mesh({{"POSITION", gltf.positions({{-1, 0, -1}, {1, 0, -1}, {0, 0, 1}})}});
  }

  std::vector<std::string> remarks(const std::optional<double>& exposure = 1.0) {
    const scene::Scene scene = load();
    set::Set set = a_set;
    set.objects.insert(set.objects.begin(), object);
    return remarks_on_bright_lamps(scene, set, exposure);
  }
};

// A white sheet that faces a lamp of I cd at 1 m has radiance I / pi, one in a sun of E lux E / pi.
TEST_F(LampStrength, IsComparedWithAWhiteSheet) {
  add_lamp("key", "point", blender_100_w);
  add_lamp("cone", "spot", std::numbers::pi);
  add_lamp("sun", "directional", 100'000);
  set::Light panel;
  panel.type = set::LightType::rectangle;
  panel.emission = {2, 3, 1};
  a_set.lights = {panel, {}};
  const scene::Scene scene = load();
  EXPECT_EQ(strength_words(scene, 0, 1.0),
            "5435 cd in its file: a white sheet at 1 m is 1730 times white");
  EXPECT_EQ(strength_words(scene, 1, 1.0),
            "3.142 cd in its file: a white sheet at 1 m is 1 times white");
  EXPECT_EQ(strength_words(scene, 2, 1.0),
            "100000 lux in its file: a white sheet that faces it is 31831 times white");
  EXPECT_EQ(strength_words(scene, 2, 0.01),
            "100000 lux in its file: a white sheet that faces it is 318.3 times white");
  EXPECT_EQ(
      strength_words(scene, 2, {}),
      "100000 lux in its file: a white sheet that faces it is 31831 times white at exposure 1");
  EXPECT_EQ(strength_words(scene, 3, 0.5), "3 W/sr/m^2: the lamp itself is 1.5 times white");
  EXPECT_EQ(strength_words(scene, 4, 1.0), "1 W/sr: a white sheet at 1 m is 0.3183 times white");
}

TEST_F(LampStrength, LampGainScalesTheEmissionOfEveryLampOfItsObjectAlone) {
  add_lamp("key", "point", 8);
  add_lamp("cone", "spot", 12);
  add_lamp("sun", "directional", 3);
  gltf.json["extensions"]["KHR_lights_punctual"]["lights"][0]["color"] = {1, 0.5, 0.25};
  gltf.json["materials"] = {{{"emissiveFactor", {1, 1, 1}}}};
  add_mesh({{"POSITION", gltf.positions({{-1, 0, -1}, {1, 0, -1}, {0, 0, 1}})}}, {{"material", 0}});
  a_set.lights.emplace_back();
  set::Object same = object;
  same.file = directory / "test.gltf";
  a_set.objects = {same};  // the same file again, with lamps as they are
  object.lamp_gain = 0.125;
  for (const auto presence :
       {set::Presence::virtual_object, set::Presence::phantom, set::Presence::removed}) {
    object.presence = presence;
    const scene::Scene scene = load();
    ASSERT_EQ(scene.lights.size(), 7u);
    EXPECT_EQ(scene.lights[0].emission, glm::dvec3(1, 0.5, 0.25));
    EXPECT_EQ(scene.lights[1].emission, glm::dvec3(1.5));
    EXPECT_EQ(scene.lights[2].emission, glm::dvec3(0.375));
    EXPECT_EQ(scene.lights[3].emission, glm::dvec3(8, 4, 2));
    EXPECT_EQ(scene.lights[6].emission, glm::dvec3(1));
    const scene::Instance& floor = scene.instances.at(0);
    EXPECT_EQ(glm::dvec3(scene.materials[floor.material].emission), glm::dvec3(1));
  }
  object.lamp_gain = 0;
  EXPECT_EQ(load().lights[1].emission, glm::dvec3(0));
}

TEST_F(LampStrength, TooMuchIsSaidWithTheKeyThatMendsIt) {
  add_floor();
  add_lamp("key", "point", blender_100_w, 2);
  add_lamp("fill", "spot", blender_100_w / 4, 2);
  EXPECT_THAT(remarks(),
              ElementsAre("object \"chair\": with its lamp \"key\" of 5435 cd (the worst of 2) a "
                          "white sheet at 2 m is 432.5 times white: 1 cd is used as 1 W/sr, "
                          "which Blender's \"standard\" mode writes as 683; set the object's "
                          "lamp_gain = 0.001464 (1 / 683)"));
  object.lamp_gain = 1 / 683.0;
  EXPECT_THAT(remarks(), IsEmpty());
  object.lamp_gain = 1;
  EXPECT_THAT(remarks(0.01), IsEmpty());  // 4.3 times white
  EXPECT_THAT(remarks(std::nullopt),
              ElementsAre(HasSubstr("is 432.5 times white at exposure 1: ")));
}

// 0.1 of 100000 lux leaves 3183 times white; 0.1 / 3183 = 3.14e-05.
TEST_F(LampStrength, ASunOfLuxIsTooMuchAtAnyDistance) {
  add_lamp("sun", "directional", 100'000, 50);
  object.lamp_gain = 0.1;
  EXPECT_THAT(remarks(),
              ElementsAre(AllOf(HasSubstr("\"sun\" of 100000 lux a white sheet that faces it is "
                                          "3183 times white: 1 lux is used as 1 W/m^2"),
                                HasSubstr("set the object's lamp_gain = 3.14e-05 (just white)"))));
  object.lamp_gain = 3.14e-05;
  EXPECT_THAT(remarks(), IsEmpty());
}

TEST_F(LampStrength, OfPlausibleLampsNothingIsSaid) {
  add_lamp("bulb", "point", 90);       // 28.6 times white at 1 m
  add_lamp("sun", "directional", 5);   // 1.6 times
  add_lamp("stage", "spot", 1000, 5);  // 318 times at 1 m, 12.7 on the floor
  add_floor();
  EXPECT_THAT(remarks(), IsEmpty());
  // Its housing, 0.1 m away, is not what it lights.
  gltf.root("housing", gltf.json["nodes"].back()["mesh"].get<int>(),
            {{"translation", {0, 5.1, 0}}});
  EXPECT_THAT(remarks(), IsEmpty());
}

// Places of what a carrier carries are its own; a floor of the world is at no distance from them.
TEST_F(LampStrength, OfACarriedLampOnlyThingsOfTheCarrierAreNear) {
  add_lamp("torch", "point", 1000, 5);
  object.nodes = {"torch"};
  set::Object floor = object;
  add_floor();
  floor.file = directory / "test.gltf";
  floor.nodes = {"a"};
  a_set.objects = {floor};
  EXPECT_THAT(remarks(), IsEmpty());
  object.carrier = "stick";
  EXPECT_THAT(remarks(), ElementsAre(HasSubstr("a white sheet at 1 m is 318.3 times white")));
}

}  // namespace previz::test::lamp_strength_test
