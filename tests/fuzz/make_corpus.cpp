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
#include "tests/support/import_fixture.hpp"
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

exchange::VideoForm form_of(const char* pixel_format, const char* encoder) {
  exchange::VideoForm form;
  form.pixel_format = pixel_format;
  form.encoder = encoder;
  form.width = form.height = 16;
  return form;
}

// A video of four frames, behind the two bytes that say how it is read.
void write_video(const fs::path& kept, const std::string& head, const char* name,
                 const exchange::VideoForm& form, std::size_t half_bytes_per_pixel) {
  const test::TemporaryDirectory directory;
  std::vector<std::vector<std::uint8_t>> frames;
  for (int i = 0; i < 4; ++i)
    frames.emplace_back(16 * 16 * half_bytes_per_pixel / 2, static_cast<std::uint8_t>(1 + i % 2));
  exchange::write_video(directory / name, form, frames);
  write(kept, head + session::content_of(directory / name));
}

void write_videos(const fs::path& folder) {
  exchange::VideoForm h264 = form_of("yuv420p", "libx264");
  h264.options = {{"crf", "40"}, {"bf", "2"}};
  write_video(folder / "h264", "v0", "a.mp4", h264, 3);
  write_video(folder / "transport_stream", "v0", "a.ts", h264, 3);
  exchange::VideoForm mjpeg = form_of("yuvj420p", "mjpeg");
  mjpeg.metadata = {{"timecode", "10:00:00:00"}};
  write_video(folder / "mjpeg", "v3", "a.mov", mjpeg, 3);
  exchange::VideoForm turned = form_of("rgb24", "png");
  const int one = 1 << 16;
  turned.display_matrix = {0, one, 0, -one, 0, 0, 0, 0, 1 << 30};
  turned.pixel_aspect = {2, 1};
  write_video(folder / "turned", "v0", "a.mov", turned, 6);
  exchange::VideoForm hlg = form_of("yuv422p10le", "prores_ks");
  hlg.matrix = AVCOL_SPC_BT2020_NCL;
  hlg.transfer = AVCOL_TRC_ARIB_STD_B67;
  hlg.primaries = AVCOL_PRI_BT2020;
  write_video(folder / "hlg", "v0", "a.mov", hlg, 8);
  write_video(folder / "read_as", "v1", "a.mov", hlg, 8);
  write_video(folder / "gray", "v2", "a.mkv", form_of("gray10le", "ffv1"), 4);
  write_video(folder / "vp9", "v0", "a.webm", form_of("yuv420p", "libvpx-vp9"), 3);
}

// FRAMES.json that names the videos above.
void write_video_descriptions(const fs::path& folder) {
  write(folder / "both", R"({"name": "shoot", "clock": "camera",
 "observer": {"video": "a.mp4", "timestamps_ns": "container", "start_ns": 1000, "exposure": 1,
  "intrinsics": {"width": 16, "height": 16, "fx": 15, "fy": 15, "cx": 7.5, "cy": 7.5},
  "response": {"kind": "srgb"}},
 "light": {"video": "b.mov", "fps": 23.976, "start_ns": 5, "exposure_s": 0.01, "gain": [1, 1, 2, 2]},
 "track": [{"frame": 0, "world_from_camera": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
  "tags": [0, 3]},
 {"frame": 3, "world_from_camera": [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]}]})");
  write(folder / "stamps", R"({"observer": {"video": "b.mov", "timestamps_ns": [1, 20, 300, 4000],
 "exposure": [1, 1, 0.5, 0.5], "read_as": {"range": "limited", "matrix": "bt709",
  "transfer": "as recorded", "primaries": "p3-d65"}}})");
  write(folder / "table", R"({"observer": {"video": "a.mp4", "csv": "times.csv",
 "read_as": {"range": "full", "matrix": "bt2020", "transfer": "pq", "primaries": "bt601-525",
  "rotation_deg": 90, "pixel_aspect": [3, 2]}}})");
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
  write(folder / "models.txt",
        "1 FULL_OPENCV 640 480 520 521 320 240 -0.1 0.02 0 0 0.001 0.1 0.01 0.001\n"
        "2 OPENCV_FISHEYE 640 480 260 261 320 240 0.01 0 0 0\n3 FOV 640 480 520 521 320 240 0.9\n");
  write(folder / "rectified.yaml",
        "width: 640\nheight: 480\ndistortion_model: rational_polynomial\nd: [-0.1, 0.02, 0, 0, 0, "
        "0.1, 0, 0]\nk: [520, 0, 319, 0, 521, 239, 0, 0, 1]\np: [520, 0, 319, 0, 0, 521, 239, 0, "
        "0, 0, 1, 0]\nroi: {x_offset: 0, y_offset: 0, width: 640, height: 480, do_rectify: true}\n"
        "binning_x: 1\n");
  write(
      folder / "nodes.xml",
      "<opencv_storage><left><K type_id=\"opencv-matrix\"><rows>3</rows><cols>3</cols><data>\n260 "
      "0 319 0 261 239 0 0 1</data></K><D><data>0.01 0 0 0</data></D><fisheye_model>1"
      "</fisheye_model><imageSize>640 480</imageSize></left></opencv_storage>\n");
  // These are refused by name.
  write(folder / "lens.nk",
        "LensDistortion {\n model_preset \"3DE4 Radial - Standard, Degree 4\"\n}\n");
  write(folder / "classic.nk",
        "set cut_paste_input [stack 0]\n LensDistortion {\n distortion1 0.1\n}\n");
  std::string binary("\1\0\0\0\0\0\0\0\1\0\0\0\0\0\0\0\x80\2\0\0\0\0\0\0\xe0\1\0\0\0\0\0\0", 32);
  for (const double parameter : {520.0, 320.0, 240.0})
    binary.append(reinterpret_cast<const char*>(&parameter), sizeof parameter);
  write(folder / "cameras.bin", binary);
}

// What is done to a take's folder: what, to which file, and how (take_targets.cpp).
void write_takes(const fs::path& folder) {
  write(folder / "whole", "");
  write(folder / "not_closed", {2, 12, 0});
  write(folder / "cut_short", {6, 11, 0, '\x80'});
  write(folder / "links", {1, 8, 2, 0, 1, 10, 2, 5, 1, 5, 2, 6, 1, 0, 2, 0});
  write(folder / "pipe_and_folder", {1, 10, 1, 1, 6, 0, 1, 1, 2, 1, 1, 3, 2, 1});
  write(folder / "names_the_owners", {2, 12, 3, 2, 12, 1});
  const std::string sum = std::string(64, '0') + "  ", line = sum + "../../owners/session.toml\n",
                    most = sum + std::string(180, 'n'), more(100, 'n');
  const auto text = [](char how, const std::string& words) {
    return std::string{how, 1, static_cast<char>(words.size())} + words;
  };
  write(folder / "checksums", text(4, line));
  write(folder / "name_too_long", text(4, most) + text(5, more));
  const char strange_asset = 15;
  write(folder / "line_in_a_name", {4, strange_asset, 1, 'x'});
}

// A camera's formats, rows, settings and what happens to it (v4l2_targets.cpp). Where the bytes
// end, the device answers as it is.
void write_v4l2(const fs::path& folder) {
  write(folder / "yuyv", {0, 0, 0});
  write(folder / "mjpeg", {1, 2, 2, 0, 1});
  write(folder / "with_all", {0x77, 7, 8, 6, 30, 100, 0xf, 30, 10, 5});
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
  write_takes(corpus / "take_folder");
  write_v4l2(corpus / "v4l2");
  write_messages(corpus / "aravis");
  fs::create_directories(corpus / "gltf");
  previz::test::gltf_sample().save(corpus / "gltf/sample.glb");
  previz::test::meshopt_grid().save(corpus / "gltf/meshopt.glb");
  previz::test::draco_grid().save(corpus / "gltf/draco.glb");
  write_texts(corpus);
  write_lenses(corpus / "lens_file");
  write_videos(corpus / "import_video");
  write_video_descriptions(corpus / "import_video");
  return 0;
}
