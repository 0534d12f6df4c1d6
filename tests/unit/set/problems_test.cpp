// Every kind of mistake in a set file: reported once, at its line and column, with the key and a
// way out.
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/set.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::set::problems_test {

std::vector<std::string> problems_of(const std::string& text, const std::filesystem::path& file) {
  std::vector<std::string> lines;
  std::istringstream all(test::error_of([&] { parse_set(text, file); }));
  for (std::string line; std::getline(all, line);) lines.push_back(line);
  return lines;
}

struct Mistake {
  const char* text;
  const char* start;     // of the one problem, after the file's name: "line:column: key: "
  const char* fragment;  // must be in it
};

void PrintTo(const Mistake& mistake, std::ostream* out) {
  *out << mistake.text;
}

class SetMistake : public testing::TestWithParam<Mistake> {};

TEST_P(SetMistake, IsToldOnceWithLineAndKey) {
  test::TemporaryDirectory directory;
  std::ofstream(directory / "vase.glb") << "glTF";
  const auto file = directory / "stage.toml";
  const auto problems = problems_of(GetParam().text, file);
  ASSERT_EQ(problems.size(), 1u) << testing::PrintToString(problems);
  EXPECT_TRUE(problems[0].starts_with(file.string() + ':' + GetParam().start)) << problems[0];
  EXPECT_THAT(problems[0], HasSubstr(GetParam().fragment));
}

// The rest of tables in which a test makes only one mistake.
#define PINHOLE "width=64\nheight=48\nfx=60.0\nfy=60.0\ncx=31.5\ncy=23.5\n"
#define FISHEYE "width=64\nheight=64\nfx=20.0\nfy=20.0\ncx=31.5\ncy=31.5\n"
#define POSE "[light_camera.pose]\nposition_m=[0,0,0]\n"
#define SQUARE "[[0,0,0],[1,0,0],[1,1,0],[0,1,0]]"
#define IDENTITY "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"
#define TAG "[[tag]]\nid=1\nsize_m=0.1\n"
#define POINT "[[light]]\ntype='point'\nposition_m=[0,0,1]\n"
#define OPTICS "[observer.intrinsics]\n" PINHOLE
#define LENS "[observer.lens]\nfocal_length_mm=35\n"
#define VASE "[[object]]\nname='v'\nfile='vase.glb'\npresence='virtual'\n"

const Mistake syntax[] = {
    {"[quality\nsamples = 1", "1:9: not valid TOML", ""},
    {"[quality]\nsamples = \n", "2:11: not valid TOML", ""},
    {"[quality]\nsamples = 1\nsamples = 2\n", "3:", "not valid TOML"},
    {"\n\n[set]\nname = \"a\n", "4:10: not valid TOML", ""},
    {"[set]\nname = \"\xff\"\n", "2:", "not valid TOML"},
    {"\n{ \"format_version\": 1 }", "2:1: is JSON, and a set file is TOML",
     "previz import FILE SESSION"},
    {TAG "[tag]\nhide=true\n", "4:1: tag: is a list of tables; allowed: [[tag]]",
     "did you mean [tags]?"},
    {"[set]\n  [tag]\nhide=true\n" TAG, "2:3: tag: is a list of tables", "did you mean [tags]?"},
    {"[[object]]\nname='v'\n[object]\n", "3:1: object: is a list of tables; allowed: [[object]]",
     ""},
    {"[quality]\nsamples = 1\n[[quality]]\n", "3:1: quality: is one table",
     "all its keys under one [quality]"},
    {"[[quality]]\n[quality]\n", "1:1: quality: is one table", ""},
    {"[set]\n[[ quality ]]\n[quality]\n", "3:1: quality: is one table", ""},
};
INSTANTIATE_TEST_SUITE_P(Syntax, SetMistake, testing::ValuesIn(syntax));

const Mistake unknown[] = {
    {"[quality]\nsample = 4\n", "2:1: quality.sample: ", "did you mean samples?"},
    {"[quality]\n  smaples = 4\n", "2:3: quality.smaples: ", "did you mean samples?"},
    {"[qualitty]\nsamples = 4\n", "1:2: qualitty: unknown table", "did you mean quality?"},
    {"[[tags]]\nid = 4\n", "1:3: tags: ", "did you mean [[tag]]?"},
    {"[observer.lense]\n", "1:11: observer.lense: ", "did you mean lens?"},
    {"[observer.lens]\nfocal_length=35\nfocal_length_mm=35\nf_number=2.0\nfocus_distance_m=1.0\n"
     "[observer.intrinsics]\n" PINHOLE,
     "2:1: observer.lens.focal_length: ", "did you mean focal_length_mm?"},
    {"samples = 4\n", "1:1: samples: ", "does it belong under [quality]?"},
    {"[quality]\nseed = 4\n", "2:1: quality.seed: ", "does it belong under [estimator]?"},
    {"[set]\nsize_m = 4\n", "2:1: set.size_m: ", "does it belong under [[tag]]?"},
    {"[quality]\nzzzzzzzzzz = 4\n", "2:1: quality.zzzzzzzzzz: ",
     "allowed: samples, adaptive, denoise, accumulate, neighbours, memory_mb, error, seconds, "
     "scale, fps"},
    {"[quality]\n\"a\\nb\" = 4\n", "2:1: quality.a\\nb: ", "unknown key"},
};
INSTANTIATE_TEST_SUITE_P(Unknown, SetMistake, testing::ValuesIn(unknown));

const Mistake types[] = {
    {"[quality]\nsamples = 4.0\n", "2:11: quality.samples: 4 is not", "whole number, 1 to 1000000"},
    {"[quality]\nsamples = \"4\"\n", "2:11: quality.samples: \"4\" is not", "whole number"},
    {"[quality]\nscale = true\n", "2:9: quality.scale: true is not", "number, 0.01 to 1"},
    {"[output]\nexr = 1\n", "2:7: output.exr: 1 is not", "true or false"},
    {"[output]\nexr = 2020-01-01\n", "2:7: output.exr: a table, date or time", "true or false"},
    {"[output.exr]\na = 1\n", "1:1: output.exr: a table", "true or false"},
    {"[set]\nname = 4\n", "2:8: set.name: 4 is not", "text in quotes"},
    {"quality = 4\n", "1:1: quality: is not a table", "[quality]"},
    {"tag = 4\n", "1:1: tag: is not a list of tables", "[[tag]]"},
    {"[tag]\nid = 4\n", "1:2: tag: is not a list of tables", "[[tag]]"},
    {"[[quality]]\nsamples = 4\n", "1:3: quality: is not a table", "[quality]"},
    {"tag = [4]\n", "1:8: tag: has an entry that is not a table", "[[tag]]"},
    {"[observer]\ndriver = 4\n", "2:10: observer.driver: 4 is not allowed",
     "\"replay\" | \"v4l2\" | "},
    {"[display]\ndriver = \"vga\"\n", "2:10: display.driver: \"vga\"",
     "\"kms\" | \"headless\" | \"none\""},
    {"[observer]\ndriver = \"gopro\"\n", "2:10: observer.driver: \"gopro\"", " | \"none\""},
    {"[tracking]\nfamily = \"tag36h12\"\n", "2:10: tracking.family: \"tag36h12\"",
     "\"tag36h11\" | "},
    {TAG "position_m=[0,0]\n", "4:12: tag.position_m: a list of 2 entries", "3 numbers"},
    {TAG "position_m=[0,0,\n  \"up\"]\n", "5:3: tag.position_m: \"up\"", "number in m"},
    {TAG "world_from_tag=[[1,0,0,0],[0,1,0,0],[0,0,1,0]]\n",
     "4:16: tag.world_from_tag: a list of 3 entries", "4 rows of 4 numbers"},
    {TAG "world_from_tag=[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,1,1]]\n",
     "4:16: tag.world_from_tag: the last row", "0 0 0 1"},
    {"[[tag]]\nid=1\ncorners_m=[[0,0,0],[1,0,0],[1,1,0]]\n", "3:11: tag.corners_m: a list of 3",
     "4 points of 3 numbers"},
    {"[[button]]\nname='red'\naction='recrod'\n", "3:8: button.action: \"recrod\"",
     "\"record\" | "},
    {"[[button]]\nname='red'\naction='live'\npress='hard'\n", "4:7: button.press: \"hard\"",
     "\"short\" | \"long\" | \"double\""},
    {"[display]\ndriver='headless'\nmode='1080p'\n", "3:6: display.mode: \"1080p\"",
     "WIDTHxHEIGHT"},
    {VASE "nodes='all'\n", "5:7: object.nodes: \"all\"", "list of texts"},
    {VASE "nodes=['a',3]\n", "5:12: object.nodes: 3", "text in quotes"},
    {"[lighting]\nenvironment=''\n", "2:13: lighting.environment: \"\"", "path"},
};
INSTANTIATE_TEST_SUITE_P(Types, SetMistake, testing::ValuesIn(types));

const Mistake ranges[] = {
    {"[quality]\nsamples = 0\n", "2:11: quality.samples: 0 is not", "1 to 1000000"},
    {"[quality]\nsamples = 1000001\n", "2:11: quality.samples: 1000001", "1 to 1000000"},
    {"[quality]\nsamples = 9223372036854775807\n", "2:11: quality.samples: 9223372036854775807",
     ""},
    {"[[quality.preview]]\nsamples = 51\n", "2:11: quality.preview.samples: 51 is not", "1 to 50"},
    {"[quality.preview]\nsamples = 5\n", "1:10: quality.preview: is not a list of tables",
     "[[quality.preview]]"},
    {"[quality]\nscale = 0\n", "2:9: quality.scale: 0 is not", "0.01 to 1"},
    {"[quality]\nscale = nan\n", "2:9: quality.scale: nan is not", "finite number"},
    {"[estimator]\nseed = -1\n", "2:8: estimator.seed: -1", "0 to 4294967295"},
    {"[estimator]\nseed = 4294967296\n", "2:8: estimator.seed: 4294967296", "0 to 4294967295"},
    {"[estimator]\nmax_depth = 65\n", "2:13: estimator.max_depth: 65", "1 to 64"},
    {"[observer]\nexposure = 0.0\n", "2:12: observer.exposure: 0 is not", "1e-12 to 1e+12"},
    {"[observer]\nexposure = inf\n", "2:12: observer.exposure: inf", "finite"},
    {"[lighting]\nenvironment_rotation_deg = -inf\n",
     "2:28: lighting.environment_rotation_deg: -inf", "finite"},
    {"[lighting]\nresolution = 100\n", "2:1: lighting.resolution: 100", "power of two"},
    {"[lighting]\nresolution = 8192\n", "2:14: lighting.resolution: 8192", "0 to 4096"},
    {TAG "position_m=[0,nan,0]\n", "4:15: tag.position_m: nan", "finite"},
    {"[[tag]]\nid=1\nsize_m=-0.1\nposition_m=[0,0,0]\n", "3:8: tag.size_m: -0.1", "0.0001 to 100"},
    {"[[tag]]\nid=-1\nsize_m=0.1\nposition_m=[0,0,0]\n", "2:4: tag.id: -1", "0 to 65535"},
    {POINT "emission=[1,-1,1]\n", "4:13: light.emission: -1", "0 to 1e+12"},
    {"[recording]\ndirectory='/proc/takes'\n",
     "2:1: recording.directory: /proc/takes is not on a disk", "a folder on a disk"},
    {"[recording]\nsecond_directory='/a/../sys'\n",
     "2:1: recording.second_directory: /sys is not on a disk", "a folder on a disk"},
    {"[output]\ndirectory='/sys/kernel'\n", "2:1: output.directory: /sys/kernel is not on a disk",
     "a folder on a disk"},
};
INSTANTIATE_TEST_SUITE_P(Ranges, SetMistake, testing::ValuesIn(ranges));

const Mistake missing[] = {
    {"[[button]]\nname='red'\n", "1:1: button.action: is missing", "\"record\""},
    {"[observer.intrinsics]\nwidth=64\nheight=48\nfx=60.0\ncx=31.5\ncy=23.5\n",
     "1:1: observer.intrinsics.fy: is missing", "number in px, 1 to 1000000"},
    {"[observer.lens]\nf_number=2.0\nfocal_length_mm=35\nfocus_distance_m=1.0\n",
     "1:1: observer.lens: [observer.intrinsics] is missing", "all of the session's"},
    {"[light_camera.response]\nkind=\"linear\"\n",
     "1:1: light_camera.response: [light_camera.intrinsics] is missing", ""},
    {"[light_camera.intrinsics]\nmax_angle_deg=90\n" FISHEYE, "1:1: light_camera.pose: is missing",
     "position_m, rotation_deg"},
    {"\n[[tag]]\nsize_m=0.1\nposition_m=[0,0,0]\n", "2:1: tag.id: is missing", ""},
    {"\n[[tag]]\nid=1\nposition_m=[0,0,0]\n", "2:1: tag.size_m: is missing", "corners_m"},
    {"\n[[tag]]\nid=1\nsize_m=0.1\n", "2:1: tag.position_m: is missing", "world_from_tag"},
    {TAG "rotation_deg=[0,0,0]\n", "1:1: tag.position_m: is missing", ""},
    {"[[object]]\nfile='vase.glb'\npresence='virtual'\n", "1:1: object.name: is missing",
     "\"vase\""},
    {"[[surface]]\nmaterial='a'\nalbedo=[0.5,0.5,1.5]\n", "3:17: surface.albedo: 1.5", "0 to 1"},
    {"[[surface]]\nmaterial='a'\nalbedo=[1,1,1]\n[[surface]]\nmaterial='a'\nalbedo=[1,1,1]\n",
     "5:1: surface.material: \"a\" is already on line 2", "each material once"},
    {"[lighting]\nbalance=[1,0,1]\n", "2:12: lighting.balance: 0", "1e-06"},
    {"[[object]]\nname='v'\npresence='virtual'\n", "1:1: object.file: is missing", ""},
    {"[[object]]\nname='v'\nfile='vase.glb'\n", "1:1: object.presence: is missing",
     "\"phantom\" | \"virtual\" | \"removed\""},
    {"[[light]]\nemission=[1,1,1]\n", "1:1: light.type: is missing", "\"spot\""},
    {"[[light]]\ntype='sphere'\nposition_m=[0,0,1]\nemission=[1,1,1]\n",
     "1:1: light.radius_m: is missing", "a sphere light needs it"},
    {"[[light]]\ntype='directional'\nemission=[1,1,1]\n", "1:1: light.direction: is missing", ""},
    {POINT "", "1:1: light.emission: is missing", "3 numbers"},
    {"[[captured_light]]\nname='a'\ncone_deg=5\n", "1:1: captured_light.direction: is missing",
     "position_m"},
    {"[[captured_light]]\nname='a'\ndirection=[0,0,1]\n",
     "1:1: captured_light.cone_deg: is missing", "60"},
    {"[lighting]\nunseen='constant'\n", "1:1: lighting.unseen_radiance: is missing", "3 numbers"},
    {"[lighting.room]\nposition_m=[0,0,1]\n", "1:1: lighting.room.size_m: is missing", "a file"},
    {OPTICS "[observer.response]\nkind='table'\n", "8:1: observer.response.table: is missing",
     "strictly increasing"},
};
INSTANTIATE_TEST_SUITE_P(Missing, SetMistake, testing::ValuesIn(missing));

const Mistake contradictions[] = {
    {"[[tag]]\nid=7\nsize_m=0.1\nposition_m=[0,0,0]\n[[tag]]\nid=7\nsize_m=0.1\nposition_m=[1,0,0]"
     "\n",
     "6:1: tag.id: tag 7 is already on line 2", "each id once"},
    {"[[button]]\nname='red'\naction='record'\n[[button]]\naction='live'\nname='red'\n",
     "6:1: button.name: a short press of \"red\" is already on line 2", "one action per press"},
    {"[[button]]\nname='gpoi:pads:1'\naction='record'\n",
     "2:1: button.name: no button driver matches \"gpoi:pads:1\"",
     "gpio:CHIP:LINE | hid:VENDOR:PRODUCT:SELECTOR"},
    {"[observer]\ndriver='v4l2'\ndevice='c'\n[[button]]\nname='red'\naction='record'\n",
     "5:1: button.name: no button driver matches \"red\"", "`previzd devices`"},
    {"[[button]]\nname='gpio:pads:1'\naction='record'\n[[gpio]]\nname='gpio:pads'\nbias='up'\n",
     "6:6: gpio.bias: \"up\"", "\"pull_up\""},
    {"[[gpio]]\nname='hid:1:2'\n", "2:1: gpio.name: \"hid:1:2\" is not a GPIO line", "gpio:CHIP"},
    {"[[button]]\nname='gpio:pads:1'\naction='record'\n[[gpio]]\nname='gpio:pad'\n",
     "5:1: gpio.name: \"gpio:pad\" has no [[button]]", "last colon"},
    {"[[button]]\nname='gpio:pads:1'\naction='record'\n[[gpio]]\nname='gpio:pads'\n[[gpio]]\n"
     "name='gpio:pads'\n",
     "7:1: gpio.name: \"gpio:pads\" is already on line 5", "each name once"},
    {TAG "carrier='stick'\n" VASE "carrier='stik'\n",
     "9:1: object.carrier: no tag is on a carrier \"stik\"", "did you mean \"stick\"?"},
    {POINT "emission=[1,1,1]\ncarrier='x'\n", "5:1: light.carrier: no tag is on a carrier \"x\"",
     "the carrier of a [[tag]]"},
    {TAG "carrier='a'\n[[tag]]\nid=2\nsize_m=0.1\ncarrier='a'\n",
     "8:1: tag.carrier: another tag of \"a\" already defines its frame", "position_m"},
    {TAG "carrier='a'\n[[tag]]\nid=1\nsize_m=0.1\ncarrier='b'\n",
     "6:1: tag.id: tag 1 is already on line 2", "each id once"},
    {"[[light]]\nname='key'\ntype='point'\nposition_m=[0,0,1]\nemission=[1,1,1]\n"
     "[[light]]\nname='key'\ntype='point'\nposition_m=[0,0,1]\nemission=[1,1,1]\n",
     "7:1: light.name: \"key\" is already on line 2", "each name once"},
    {VASE VASE, "6:1: object.name: \"v\" is already on line 2", "each name once"},
    {TAG "position_m=[0,0,0]\nworld_from_tag=" IDENTITY,
     "4:1: tag.position_m: conflicts with world_from_tag", "one of the two"},
    {"[[tag]]\nid=1\nrotation_deg=[0,0,0]\ncorners_m=" SQUARE,
     "3:1: tag.rotation_deg: conflicts with corners_m", ""},
    {"[[tag]]\nid=1\nsize_m=0.5\ncorners_m=" SQUARE, "3:1: tag.size_m: conflicts with corners_m",
     "1.0 m"},
    {VASE "scale=2\nworld_from_file=" IDENTITY, "5:1: object.scale: conflicts with world_from_file",
     ""},
    {"[observer]\ndriver='none'\ndevice='cam'\n", "3:1: observer.device: driver \"none\"", ""},
    {"[observer]\ndriver='aravis'\n", "1:1: observer.device: is missing for driver \"aravis\"",
     "`previzd devices`"},
    {"[light_camera.camera]\ngain=2.0\n",
     "1:1: light_camera.camera: cannot be used with driver \"replay\"", ""},
    {"[observer]\ndriver='v4l2'\ndevice='c'\n[observer.camera]\nwidth=640\n",
     "4:1: observer.camera.height: is missing; width and height", ""},
    {"[light_camera]\ndriver='v4l2'\ndevice='c'\n[light_camera.camera]\nexposure_s=0.1\nbracket_s=["
     "0.1]\n",
     "5:1: light_camera.camera.exposure_s: conflicts with bracket_s", ""},
    {"[recording]\ndirectory='a/takes'\nsecond_directory='a/b/../takes/'\n",
     "3:1: recording.second_directory: is the folder of recording.directory", "another disk"},
    {"[lighting]\nfrom='recording'\n", "2:1: lighting.from: a recording has", "mode = \"sources\""},
    {"[lighting]\nmode='hybrid'\nfrom='recording'\n", "2:1: lighting.mode: a recording has",
     "\"hybrid\""},
    {"[lighting.room]\nsize_m=[6,5,3]\n[lighting.sources]\ndistance_m=2\n",
     "4:1: lighting.sources.distance_m: conflicts with", "[lighting.room]"},
    {"[lighting.sources]\ncontrast=1\n", "2:10: lighting.sources.contrast: 1", "2 to"},
    {"[display]\ndriver='headless'\nconnector='HDMI-A-1'\n",
     "3:1: display.connector: driver \"headless\" has no connector", ""},
    {"[display]\nmode='640x480'\n", "2:1: display.mode: driver \"none\" has no mode", ""},
    {"[lighting]\nunseen_radiance=[0,0,0]\n", "2:1: lighting.unseen_radiance: needs unseen",
     "constant"},
    {OPTICS "[observer.response]\ngamma=2.0\n",
     "9:1: observer.response.gamma: conflicts with kind \"srgb\"", "\"gamma\""},
    {"[lighting.room]\nfile='vase.glb'\nsize_m=[3,4,2]\n",
     "3:1: lighting.room.size_m: conflicts with file", "one of the two"},
    {"[lighting]\nenvironment='vase.glb'\n[lighting.room]\nsize_m=[3,4,2]\n",
     "3:1: lighting.room: conflicts with lighting.environment", "from infinity"},
    {POINT "emission=[1,1,1]\ncaptured=true\n", "5:1: light.captured: is for real lamps",
     "gain_real above 0"},
    {POINT "emission=[1,1,1]\ncone_deg=5\n", "5:1: light.cone_deg: needs captured = true", ""},
    {"[[captured_light]]\nname='a'\ncone_deg=5\ndirection=[0,0,1]\nposition_m=[0,0,1]\n",
     "4:1: captured_light.direction: conflicts with position_m", ""},
    {"[lighting]\nfrom='set'\n[[captured_light]]\nname='a'\ncone_deg=5\ndirection=[0,0,1]\n",
     "3:1: captured_light: conflicts with lighting.from", ""},
    {"[[light]]\nname='a'\ntype='point'\nposition_m=[0,0,1]\nemission=[1,1,1]\n"
     "[[captured_light]]\nname='a'\ncone_deg=5\ndirection=[0,0,1]\n",
     "7:1: captured_light.name: \"a\" is also a [[light]]", "each name once"},
    {POINT "emission=[1,1,1]\nwidth_m=1\n", "5:1: light.width_m: a point light does not have this",
     ""},
    {"[[light]]\ntype='spot'\nposition_m=[0,0,1]\ndirection=[0,0,-1]\nemission=[1,1,1]\n"
     "inner_cone_deg=50\n",
     "6:1: light.inner_cone_deg: is wider", "45.0"},
};
INSTANTIATE_TEST_SUITE_P(Contradictions, SetMistake, testing::ValuesIn(contradictions));

const Mistake geometry[] = {
    {"[light_camera.intrinsics]\n" FISHEYE
     "max_angle_deg=90\nvignetting=[-0.5,0,0]\n[light_camera.pose]\nposition_m=[0,0,0]\n",
     "9:1: light_camera.intrinsics.vignetting: passes no light", "at least 0.01"},
    {TAG "world_from_tag=[[1,0,0,0],[0,1.1,0,0],[0,0,1,0],[0,0,0,1]]\n",
     "4:1: tag.world_from_tag: is not rigid", "0.21"},
    {TAG "world_from_tag=[[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]\n",
     "4:1: tag.world_from_tag: mirrors or is singular", "rotation"},
    {"[light_camera.intrinsics]\nmax_angle_deg=90\n" FISHEYE
     "[light_camera.pose]\nworld_from_camera=[[1,0.001,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n",
     "10:1: light_camera.pose.world_from_camera: is not rigid", "1e-4"},
    {VASE "world_from_file=[[1,0,0,0],[0,1,0,0],[0,0,0,0],[0,0,0,1]]\n",
     "5:1: object.world_from_file: flattens", ""},
    {"[[tag]]\nid=1\ncorners_m=[[0,0,0],[1,0,0],[1,1.1,0],[0,1,0]]\n",
     "3:1: tag.corners_m: is not a square", "2.0 %"},
    {"[[tag]]\nid=1\ncorners_m=[[0,0,0],[1,0,0],[0,1,0],[1,1,0]]\n",
     "3:1: tag.corners_m: ", "lower left, lower right, upper right, upper left"},
    {"[[tag]]\nid=1\ncorners_m=[[0,0,0],[0,0,0],[0,0,0],[0,0,0]]\n",
     "3:1: tag.corners_m: has no area", ""},
    {"[[light]]\ntype='directional'\ndirection=[0,0,0]\nemission=[1,1,1]\n",
     "3:1: light.direction: has zero length", ""},
    {"[[light]]\ntype='rectangle'\nposition_m=[0,0,1]\ndirection=[0,0,-1]\nup=[0,0,1]\nwidth_m=1\n"
     "height_m=1\nemission=[1,1,1]\n",
     "5:1: light.up: is parallel", ""},
};
INSTANTIATE_TEST_SUITE_P(Geometry, SetMistake, testing::ValuesIn(geometry));

const Mistake optics[] = {
    {OPTICS LENS "f_number=0\nfocus_distance_m=1\n", "10:10: observer.lens.f_number: 0 is not",
     "0.5 to"},
    {OPTICS LENS "f_number=-2.8\nfocus_distance_m=1\n", "10:10: observer.lens.f_number: -2.8", ""},
    {OPTICS LENS "f_number=2.8\nfocus_distance_m=0.03\n",
     "11:1: observer.lens.focus_distance_m: must exceed", "0.035 m"},
    {OPTICS "[observer.response]\nkind='table'\ntable=[0.0, 0.5, 0.5, 1.0]\n",
     "10:1: observer.response.table: number 3", "strictly increasing"},
    {OPTICS "[observer.response]\nkind='table'\ntable=[0.1, 0.5, 1.0]\n",
     "10:1: observer.response.table: does not run from 0 to 1", ""},
    {OPTICS "[observer.response]\nkind='table'\ntable=[]\n",
     "10:1: observer.response.table: does not run", "at least 2"},
    {OPTICS "[observer.response]\nkind='gamma'\ngamma=0\n", "10:7: observer.response.gamma: 0",
     "0.1 to 10"},
    // r = t - 0.2 t^3 stops growing at t = sqrt(1 / 0.6) = 73.97 degrees.
    {"[light_camera.intrinsics]\nmax_angle_deg=90\nk=[-0.2,0,0,0]\n" FISHEYE POSE,
     "3:1: light_camera.intrinsics.k: the lens model folds back at 73.9 degrees", "max_angle_deg"},
    {"[light_camera.intrinsics]\nmax_angle_deg=181\n" FISHEYE POSE,
     "2:15: light_camera.intrinsics.max_angle_deg: 181", "1 to 180"},
};
INSTANTIATE_TEST_SUITE_P(Optics, SetMistake, testing::ValuesIn(optics));

const Mistake files[] = {
    {"[[object]]\nname='v'\nfile='no.glb'\npresence='virtual'\n",
     "3:1: object.file: no such file:", "no.glb"},
    {"[[object]]\nname='v'\nfile='.'\npresence='virtual'\n", "3:1: object.file: no such file:", ""},
    {"[lighting]\nenvironment='no.exr'\n", "2:1: lighting.environment: no such file:", "no.exr"},
};
INSTANTIATE_TEST_SUITE_P(Files, SetMistake, testing::ValuesIn(files));

TEST(SetProblems, AreToldTogetherInTheOrderOfTheirLines) {
  const char* set = R"([quality]
samples = -3
sclae = 1.0
[[light]]
type = 'spot'
[observer]
driver = 'gopro'
[[tag]]
)";
  EXPECT_THAT(
      problems_of(set, "set"),
      ElementsAre(StartsWith("set:2:11: quality.samples: "), StartsWith("set:3:1: quality.sclae: "),
                  StartsWith("set:4:1: light.emission: "),
                  StartsWith("set:4:1: light.position_m: "),
                  StartsWith("set:4:1: light.direction: "),
                  StartsWith("set:7:10: observer.driver: "), StartsWith("set:8:1: tag.id: "),
                  StartsWith("set:8:1: tag.size_m: "), StartsWith("set:8:1: tag.position_m: ")));
}

TEST(SetProblems, OfAnOverlayNameItsFileAndItsLines) {
  const auto problems = [](const std::string& own, const std::string& overlay) {
    return test::error_of([&] {
      parse_set(own, "stage.toml", {}, Origin::crew, Overlay{"live.toml", overlay});
    });
  };
  EXPECT_EQ(problems("[quality]\nsamples = 4", "[quality]\nsamples = 5\n"), "");
  EXPECT_THAT(problems("[quality]\nsamples = 0\n", "\n[quality]\nfps = -1\n"),
              AllOf(StartsWith("stage.toml:2:11: quality.samples: 0 is not"),
                    HasSubstr("\nlive.toml:3:7: quality.fps: -1 is not")));
  EXPECT_THAT(problems("", "[quality]\nfsp = 1\n"), StartsWith("live.toml:2:1: quality.fsp: "));
  EXPECT_THAT(problems("", "[quality\n"), StartsWith("live.toml:1:9: not valid TOML"));
  EXPECT_THAT(problems("", "[[tag]]\nid = 1\n"),
              StartsWith("live.toml:1:3: tag: belongs in the set file"));
}

TEST(SetProblems, NameAFileThatCannotBeRead) {
  EXPECT_THAT(test::error_of([] { load_set("no/such/stage.toml"); }),
              StartsWith("no/such/stage.toml: "));
}

}  // namespace previz::set::problems_test
