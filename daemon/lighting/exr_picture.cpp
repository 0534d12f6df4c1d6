#include "daemon/lighting/exr_picture.hpp"

#include <ImfChannelList.h>
#include <ImfChromaticities.h>
#include <ImfFrameBuffer.h>
#include <ImfInputFile.h>
#include <ImfStandardAttributes.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <exception>

#include "daemon/lighting/exr_header.hpp"
#include "drivers/error.hpp"

namespace previz::lighting {
namespace {

std::string channel_names(const Imf::ChannelList& channels) {
  std::string names;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel)
    add_to_list(names, channel.name());
  return names.empty() ? "none" : names;
}

bool has_all(const Imf::ChannelList& channels, const std::array<const char*, 3>& names) {
  for (const char* name : names) {
    const Imf::Channel* channel = channels.findChannel(name);
    if (channel == nullptr || channel->xSampling != 1 || channel->ySampling != 1) return false;
  }
  return true;
}

// Returns the channels that give red, green and blue.
std::array<const char*, 3> choose_channels(const Imf::ChannelList& channels,
                                           const std::filesystem::path& path) {
  for (const std::array<const char*, 3>& names :
       {std::array{"R", "G", "B"}, std::array{"Y", "Y", "Y"}}) {
    const bool luminance_and_chroma = names[0][0] == 'Y' && channels.findChannel("RY") != nullptr;
    if (has_all(channels, names) && !luminance_and_chroma) return names;
  }
  throw Error(path.string() + ": channels R, G and B (or Y alone) are needed at full size; found " +
              channel_names(channels));
}

bool same(const Imath::V2f& a, const Imath::V2f& b) {
  return std::abs(a.x - b.x) < 1e-3f && std::abs(a.y - b.y) < 1e-3f;
}

void note_primaries(const Imf::Header& header, std::vector<std::string>& notes) {
  if (!Imf::hasChromaticities(header)) return;
  const Imf::Chromaticities rec709, found = Imf::chromaticities(header);
  if (!same(found.red, rec709.red) || !same(found.green, rec709.green) ||
      !same(found.blue, rec709.blue))
    notes.push_back("the file's primaries are not Rec. 709; its values are used unconverted");
}

LinearPicture read(const std::filesystem::path& path, std::vector<std::string>& notes) {
  check_exr_header(path);
  Imf::InputFile file(path.c_str());
  const Imath::Box2i window = file.header().dataWindow();
  check_size(path, std::int64_t{window.max.x} - window.min.x + 1,
             std::int64_t{window.max.y} - window.min.y + 1);
  if (window != file.header().displayWindow())
    throw Error(path.string() +
                ": the data window is not the display window; a full picture is "
                "needed");
  const auto names = choose_channels(file.header().channels(), path);
  LinearPicture picture;
  picture.width = window.max.x - window.min.x + 1;
  picture.height = window.max.y - window.min.y + 1;
  const auto width = static_cast<std::size_t>(picture.width);
  reserve_pixels(picture, std::filesystem::file_size(path));

  // Memory grows with the rows that are met: a file may claim more of them than it has.
  constexpr int pixels_at_once = 1 << 18;
  const int rows_at_once = std::max(1, pixels_at_once / picture.width);
  // There is one frame-buffer slice per channel name; Y is read once and copied to all three.
  const bool luminance = names[0] == names[1];
  for (int row = 0; row < picture.height; row += rows_at_once) {
    const int end = std::min(row + rows_at_once, picture.height);
    picture.radiance.resize(width * static_cast<std::size_t>(end));
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < (luminance ? 1u : 3u); ++c)
      buffer.insert(names[c],
                    Imf::Slice::Make(Imf::FLOAT, &picture.radiance[0][static_cast<int>(c)], window,
                                     sizeof(glm::vec3), sizeof(glm::vec3) * width));
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y + row, window.min.y + end - 1);
  }
  if (luminance)
    for (glm::vec3& radiance : picture.radiance) radiance = glm::vec3(radiance.r);
  note_primaries(file.header(), notes);
  return picture;
}

}  // namespace

LinearPicture read_exr_picture(const std::filesystem::path& path, std::vector<std::string>& notes) {
  try {
    return read(path, notes);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(path.string() + ": cannot be read as OpenEXR: " + error.what());
  }
}

}  // namespace previz::lighting
