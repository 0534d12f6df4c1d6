// What `previz import` reads, but for videos (video_targets.cpp).
#include <fstream>

#include "daemon/tools/exchange/footage.hpp"
#include "daemon/tools/exchange/import_description.hpp"
#include "daemon/tools/exchange/picture_header.hpp"
#include "tests/fuzz/mutators.hpp"
#include "tests/fuzz/targets.hpp"

namespace previz::fuzz {
namespace footage_targets_cpp {

// Pictures of a shoot, for descriptions to name. Their contents are not looked at.
void make_pictures() {
  for (const char* name : {"0000.png", "0001.png", "0002.png"})
    std::ofstream(work_folder() / name, std::ios::app);
}

void read(const std::filesystem::path& description) {
  const exchange::ImportDescription read = exchange::read_description(description);
  for (const auto* footage : {&read.observer, read.light ? &*read.light : nullptr}) {
    if (!footage) continue;
    expect(!footage->exposure.empty(), "the exposure is resolved");
    expect(footage->pictures.files.empty() != footage->videos.empty(),
           "there are pictures or a video");
  }
}

void frames_json(Bytes bytes) {
  make_pictures();
  read(file_of(bytes, "FRAMES.json"));
}

void frames_csv(Bytes bytes) {
  static constexpr std::string_view description =
      R"({"observer": {"csv": "frames.csv", "exposure": 1}})";
  make_pictures();
  file_of(bytes, "frames.csv");
  read(file_of({reinterpret_cast<const std::uint8_t*>(description.data()), description.size()},
               "csv.json"));
}

void picture(Bytes bytes) {
  // Larger pictures are read as well, but slowly.
  const auto size = exchange::picture_size(text_of(bytes));
  if (size && size->width * size->height > 1u << 22) return;
  const auto picture = exchange::open_pictures({file_of(bytes, "picture")})->next();
  expect(picture.has_value() &&
             picture->bytes.size() == frame_bytes(picture->format, picture->width, picture->height),
         "a picture is as long as its format and size say");
}

constexpr Target own[] = {
    {"frames_json", "FRAMES.json", frames_json, mutate_json},
    {"frames_csv", "the table that FRAMES.json names", frames_csv},
    {"picture", "a picture to import", picture},
};

}  // namespace footage_targets_cpp

std::span<const Target> footage_targets() {
  return footage_targets_cpp::own;
}

}  // namespace previz::fuzz
