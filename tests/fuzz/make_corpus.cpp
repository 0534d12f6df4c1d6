// Writes what the fuzzer begins with, made by code: make_corpus FOLDER.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>

#include <cstdio>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "daemon/output/png.hpp"
#include "drivers/aravis/protocol.hpp"
#include "drivers/session/session.hpp"
#include "tests/support/gltf_compressed.hpp"
#include "tests/support/gltf_sample.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/temporary_directory.hpp"

namespace previz::fuzz {
namespace {

namespace fs = std::filesystem;

void write(const fs::path& file, const std::string& content) {
  session::write_content(file, content);
}

cv::Mat noise(int type, int width, int height) {
  cv::Mat picture(height, width, type);
  cv::RNG(1).fill(picture, cv::RNG::UNIFORM, 0, picture.depth() == CV_16U ? 65536 : 256);
  return picture;
}

void write_pictures(const fs::path& corpus) {
  for (const char* folder : {"picture", "texture", "mjpeg", "png", "environment"})
    fs::create_directories(corpus / folder);
  const cv::Mat rgb = noise(CV_8UC3, 48, 32), deep = noise(CV_16UC3, 9, 7),
                gray = noise(CV_8UC1, 9, 7);
  cv::imwrite(corpus / "picture/rgb.png", noise(CV_8UC3, 9, 7));
  cv::imwrite(corpus / "picture/deep.png", deep);
  cv::imwrite(corpus / "picture/rgb.jpg", noise(CV_8UC3, 9, 7));
  cv::imwrite(corpus / "picture/deep.tiff", deep);
  cv::imwrite(corpus / "picture/gray.tiff", gray);
  cv::imwrite(corpus / "texture/rgb.png", noise(CV_8UC3, 9, 7));
  cv::imwrite(corpus / "texture/deep.png", deep);
  cv::imwrite(corpus / "texture/gray.jpg", gray);
  cv::imwrite(corpus / "texture/progressive.jpg", noise(CV_8UC3, 24, 16),
              {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  cv::imwrite(corpus / "mjpeg/baseline.jpg", rgb, {cv::IMWRITE_JPEG_QUALITY, 30});
  cv::imwrite(corpus / "mjpeg/progressive.jpg", rgb,
              {cv::IMWRITE_JPEG_QUALITY, 30, cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  for (const int bits : {8, 16}) {
    Plate plate{5, 3, bits, {}};
    for (int i = 0; i < 5 * 3 * 3; ++i)
      plate.samples.push_back(static_cast<std::uint16_t>(i * 5 % (1 << bits)));
    output::write_png(corpus / "png" / (std::to_string(bits) + ".png"), plate);
  }
}

void write_environment(const fs::path& file, const std::vector<const char*>& channels,
                       Imf::Compression compression, int width = 16, int height = 8) {
  Imf::Header header(width, height);
  header.compression() = compression;
  std::vector<float> values(static_cast<std::size_t>(width * height));
  const bool is_cross = width != 2 * height;  // its corners are bare
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = is_cross ? 0.5f : 0.1f * static_cast<float>(i % 13);
  Imf::FrameBuffer buffer;
  for (const char* channel : channels) {
    header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
    buffer.insert(channel,
                  Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()), sizeof(float),
                             sizeof(float) * static_cast<std::size_t>(width)));
  }
  Imf::OutputFile written(file.c_str(), header);
  written.setFrameBuffer(buffer);
  written.writePixels(height);
}

// Radiance .hdr: flat pixels, runs by component, and older runs of pixels in a turned picture.
void write_radiance(const fs::path& folder) {
  const std::string format = "FORMAT=32-bit_rle_rgbe\n\n", pixel = "\x80\x40\x20\x81";
  std::string flat, runs, older;
  for (int line = 0; line < 8; ++line) {
    for (int x = 0; x < 16; ++x) flat += pixel;
    runs += std::string("\2\2\0\x10\x90\x80\x8a\x40\6\1\2\3\4\5\6\x90\x20\x90\x81", 19);
    older += pixel + "\1\1\1\x0f";
  }
  write(folder / "flat.hdr", "#?RADIANCE\n" + format + "-Y 8 +X 16\n" + flat);
  write(folder / "runs.hdr", "#?RGBE\nEXPOSURE=2\n" + format + "-Y 8 +X 16\n" + runs);
  write(folder / "older.hdr", "#?RADIANCE\nCOLORCORR=1 2 3\n" + format + "+Y 8 -X 16\n" + older);
}

void write_session(const fs::path& corpus) {
  const test::TemporaryDirectory directory;
  const fs::path take = directory / "take";
  session::SessionInfo info;
  info.name = "small";
  info.set_text = "[set]\nname = \"small\"\n";
  info.observer.emplace();
  info.observer->intrinsics = {24, 18, 20, 20, 11.5, 8.5};
  info.observer->lens = ThinLens{0.035, 2.8, 1.2};
  info.light.emplace();
  info.light->intrinsics = {32, 32, 10, 10, 15.5, 15.5, {}, 1.57};
  info.take = session::TakeInfo{3, "12A", "14:03:27:12", 25, "rain", true};
  session::SessionWriter writer(take, info);
  for (int i = 0; i < 2; ++i)
    writer.write(session::noise_frame("observer", i, PixelFormat::rgb8, 24, 18));
  session::TrackRecord record;
  record.tracked = true;
  record.tags = {0, 2};
  record.scene.objects["cup"] = glm::dmat4(1);
  record.scene.objects["lid"] = std::nullopt;
  record.scene.lights["lamp"] = {};
  record.scene.variants["cup"] = "red";
  record.scene.animation_s = 1.5;
  record.carriers["stick"].tags = {7};
  record.captured_light = session::CapturedLight{
      {{1, {0, 0, 1}, 0.01, {1, 2, 3}}}, 2, std::vector<glm::vec3>(4, glm::vec3(0.5f))};
  writer.write(record);
  record = {};
  record.frame = 1;
  writer.write(record);
  writer.write(ButtonEvent{"gpio:pedal", true, 5});
  writer.write_event(6, "the camera was lost");
  writer.set_lost({1, 2, 3});
  writer.close();
  const auto keep = [&](const char* from, const char* to) {
    write(corpus / to, session::content_of(take / from));
  };
  keep("session.toml", "session_toml/take.toml");
  keep("observer.jsonl", "frame_lines/observer.jsonl");
  keep("track.jsonl", "track_lines/track.jsonl");
  keep("events.jsonl", "button_lines/events.jsonl");
  keep("observer.mkv", "matroska/observer.mkv");
}

template <class Body>
void write_message(const fs::path& file, aravis::Kind kind, const Body& body) {
  const std::vector<std::uint8_t> bytes = aravis::Writer()(body).bytes();
  std::string message(reinterpret_cast<const char*>(&kind), sizeof kind);
  message.append(bytes.begin(), bytes.end());
  write(file, message);
}

void write_messages(const fs::path& folder) {
  using aravis::Kind;
  write_message(folder / "listing", Kind::done,
                aravis::Listing{{{"Basler-1", "10.0.0.2", "1", "Basler", "acA", "GigEVision"}}});
  write_message(folder / "terms", Kind::done,
                aravis::Terms{0x01080009, 64, 48, 3072, 25, 0.01, 2, true, 0x0a000002});
  write_message(
      folder / "frame", Kind::frame,
      aravis::FrameNote{1, 0, 0x01080009, 64, 48, 0, 0, 3072, 9, 1'000, 2'000, 0.01, 2.0});
  write_message(folder / "pulse", Kind::pulse, aravis::Pulse{{{"stream underruns", 3}}});
}

void write_texts(const fs::path& corpus) {
  write(corpus / "hid/pedals",
        std::string("2.5\n2-7=1e\n3/2.5\n\n"
                    "\x04\x01\x00\x20\x00\x08\x01\x00\x1e\x00\x00\x00\x00\x00"
                    "\x03\x03\x00\x20\x00",
                    37));
  write(corpus / "wire/mono", std::string(16, '\0') + std::string(64, '\x55'));
  write(corpus / "wire/raw12",
        std::string("\0\1\0\4\0\3\0\0\0\0\0\3\0\1\0\0", 16) + std::string(64, '\x55'));
  write(corpus / "wire/yuyv",
        std::string("\0\7\0\0\0\0\0\0\0\0\0\3\0\1\0\0", 16) + std::string(64, '\x55'));
  write(corpus / "wire/nv12",
        std::string("\0\11\0\0\0\0\0\1\0\1\0\3\0\3\0\0", 16) + std::string(64, '\x55'));
  write(corpus / "wire/i420",
        std::string("\0\12\0\0\0\0\0\1\0\1\0\3\0\3\0\0", 16) + std::string(64, '\x55'));
  write(corpus / "frames_json/list", R"({"name": "shoot", "clock": "camera",
 "observer": {"pictures": ["0000.png", "0001.png"], "timestamps_ns": [1, 2], "exposure": [1, 2],
  "intrinsics": {"width": 64, "height": 48, "fx": 50, "fy": 50, "cx": 31.5, "cy": 23.5},
  "lens": {"focal_length_mm": 35, "f_number": 2.8, "focus_distance_m": 1.2},
  "response": {"kind": "gamma", "gamma": 2.2}},
 "light": {"pictures": "%04d.png", "fps": 25, "start_ns": 5, "exposure_s": 0.01, "gain": 2},
 "track": [{"frame": 1, "world_from_camera": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
  "tags": [0, 3]}]})");
  write(corpus / "frames_json/pattern", R"({"observer": {"pictures": "000?.png",
 "timestamps_ns": [3, 2, 1], "sort_by_time": true, "exposure": 1}})");
  write(corpus / "frames_csv/table",
        "file,timestamp_ns,exposure_s,gain\n0000.png,1,0.01,1\n0001.png,2,0.02,1.5\n");
  char kind = 0;
  for (const char* text :
       {"record", "live", "1", "fps", "", "move_left", "12A/take", "Recording"}) {
    write(corpus / "bus" / std::to_string(kind), std::string(1, '\0') + kind + text);
    ++kind;
  }
}

// As OpenCV writes them itself.
void write_opencv_lenses(const fs::path& folder) {
  for (const char* name : {"opencv.yml", "opencv.xml", "opencv.json"}) {
    cv::FileStorage file(name, cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
    file << "image_width" << 640 << "image_height" << 480;
    file << "camera_matrix" << cv::Mat(cv::Matx33d(520, 0, 319, 0, 521, 239, 0, 0, 1));
    file << "distortion_coefficients" << cv::Mat(cv::Matx<double, 1, 5>(-0.1, 0.02, 0, 0, 0));
    write(folder / name, file.releaseAndGetString());
  }
}

void write_lenses(const fs::path& folder) {
  write_opencv_lenses(folder);
  write(folder / "stereo.json",
        R"({"M1": [[520, 0, 319], [0, 521, 239], [0, 0, 1]], "D1": [0.01, 0, 0, 0],
 "M2": [[520, 0, 319], [0, 521, 239], [0, 0, 1]], "D2": [0.01, 0, 0, 0], "size": [640, 480]})");
  write(
      folder / "camera_info.yaml",
      "image_width: 640\nimage_height: 480\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [520, 0, "
      "319, 0, 521, 239, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  data: "
      "[-0.1, 0.02, 0, 0, 0]\n");
  write(folder / "camchain.yaml",
        "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.02, 0.004, 0, 0]\n  "
        "distortion_model: equidistant\n  intrinsics: [260, 260, 319, 239]\n  resolution: [640, "
        "480]\ncam1:\n  camera_model: omni\n  intrinsics: [1, 260, 260, 319, 239]\n  resolution: "
        "[640, 480]\n");
  write(
      folder / "cameras.txt",
      "# Camera list with one line of data per camera:\n1 OPENCV 640 480 520 521 320 240 -0.1 0.02 "
      "0 0\n2 SIMPLE_RADIAL_FISHEYE 640 480 260 320 240 0.01\n");
}

}  // namespace
}  // namespace previz::fuzz

int main(int count, char** arguments) {
  if (count != 2) {
    std::fputs("make_corpus FOLDER\n", stderr);
    return 2;
  }
  using namespace previz::fuzz;
  const fs::path corpus = arguments[1];
  write_pictures(corpus);
  write_environment(corpus / "environment/rgb.exr", {"R", "G", "B"}, Imf::ZIP_COMPRESSION);
  write_environment(corpus / "environment/y.exr", {"Y"}, Imf::PIZ_COMPRESSION);
  write_environment(corpus / "environment/plain.exr", {"R", "G", "B"}, Imf::NO_COMPRESSION);
  write_environment(corpus / "environment/vertical_cross.exr", {"Y"}, Imf::ZIP_COMPRESSION, 12, 16);
  write_environment(corpus / "environment/horizontal_cross.exr", {"Y"}, Imf::RLE_COMPRESSION, 16,
                    12);
  write_radiance(corpus / "environment");
  write_session(corpus);
  write_messages(corpus / "aravis");
  fs::create_directories(corpus / "gltf");
  previz::test::gltf_sample().save(corpus / "gltf/sample.glb");
  previz::test::meshopt_grid().save(corpus / "gltf/meshopt.glb");
  previz::test::draco_grid().save(corpus / "gltf/draco.glb");
  write_texts(corpus);
  write_lenses(corpus / "lens_file");
  return 0;
}
