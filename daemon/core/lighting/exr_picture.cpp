#include "daemon/core/lighting/exr_picture.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfInputFile.h>
#include <ImfMultiPartInputFile.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <exception>
#include <optional>
#include <string_view>

#include "daemon/core/lighting/exr_color.hpp"
#include "daemon/core/lighting/exr_header.hpp"
#include "daemon/core/lighting/picture_rows.hpp"
#include "drivers/box/reading.hpp"
#include "drivers/error.hpp"
#include "drivers/letters.hpp"

namespace previz::lighting {
namespace {

struct Chosen {
  std::array<std::string, 3> names;  // one that is there twice is read once
  ExrChannels kind = ExrChannels::rgb;
  std::string layer{};
};

std::string channel_names(const Imf::ChannelList& channels) {
  std::string names;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel)
    add_to_list(names, channel.name());
  return names.empty() ? "none" : names;
}

bool has_all(const Imf::ChannelList& channels, const std::array<std::string, 3>& names) {
  return std::ranges::all_of(names, [&](const std::string& name) {
    const Imf::Channel* channel = channels.findChannel(name);
    return channel != nullptr && channel->xSampling == 1 && channel->ySampling == 1;
  });
}

// Returns whether a layer or a part of this name holds numbers that are no light.
bool names_data(std::string_view name) {
  const std::string lower = lower_case(name);
  if (lower == "p" || lower == "n" || lower == "pref" || lower == "st") return true;
  return std::ranges::any_of(
      std::array{"position", "normal", "motion", "vector", "velocity", "depth", "uv", "crypto"},
      [&](const char* word) { return lower.find(word) != std::string::npos; });
}

// Returns the layers that have red, green and blue, and are light by their names.
std::vector<Chosen> layers_of(const Imf::ChannelList& channels) {
  std::vector<Chosen> layers;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel) {
    const std::string name = channel.name();
    const std::string layer = name.substr(0, name.rfind('.') + 1);
    for (const auto& [red, green, blue] : {std::array{"R", "G", "B"}, std::array{"r", "g", "b"}})
      if (const std::array<std::string, 3> names{layer + red, layer + green, layer + blue};
          !layer.empty() && name == names[0] && has_all(channels, names) &&
          !names_data(layer.substr(0, layer.size() - 1)))
        layers.push_back({names, ExrChannels::rgb, layer.substr(0, layer.size() - 1)});
  }
  return layers;
}

// What to do where the first part has no colours.
std::string remedy(const std::filesystem::path& path, const std::vector<Chosen>& layers) {
  if (!layers.empty()) {
    const auto& names = layers.front().names;
    return fmt::format("; choose a layer: oiiotool IN --ch R={},G={},B={} -o OUT.exr", names[0],
                       names[1], names[2]);
  }
  const Imf::MultiPartInputFile file(path.c_str());
  for (int part = 1; part < file.parts(); ++part)
    if (has_all(file.header(part).channels(), {"R", "G", "B"}))
      return fmt::format(
          "; its part {}{} has R, G and B: oiiotool IN --subimage {} -o OUT.exr", part + 1,
          file.header(part).hasName() ? " (" + file.header(part).name() + ")" : std::string(),
          part);
  return "";
}

// Returns the channels that give red, green and blue.
Chosen choose_channels(const Imf::ChannelList& channels, const std::filesystem::path& path,
                       std::vector<std::string>& notes) {
  const auto has = [&](const char* name) { return channels.findChannel(name) != nullptr; };
  for (const std::array<std::string, 3>& names :
       {std::array<std::string, 3>{"R", "G", "B"}, {"r", "g", "b"}})
    if (has_all(channels, names)) return {names};
  if (has_all(channels, {"X", "Y", "Z"})) return {{"X", "Y", "Z"}, ExrChannels::xyz};
  // Y may be luminance beside chroma, or a place beside X.
  if (has_all(channels, {"Y", "Y", "Y"}) && !has("RY") && !has("X"))
    return {{"Y", "Y", "Y"}, ExrChannels::luminance};
  const std::vector<Chosen> layers = layers_of(channels);
  if (layers.size() == 1) {
    notes.push_back(fmt::format("{}: the layer \"{}\" is used", path.string(), layers[0].layer));
    return layers[0];
  }
  throw Error(path.string() + ": channels R, G and B (or Y alone) are needed at full size; found " +
              channel_names(channels) + remedy(path, layers));
}

// Throws where X, Y and Z are places or directions: by the name of the part, or because many of
// them are no light. No light has a negative value, or is outside of AP0 (SMPTE ST 2065-1), whose
// green is 1.3733 Y + 0.0982 Z - 0.4959 X.
void insist_on_light(const Imf::Header& header, const std::vector<glm::vec3>& pixels,
                     const std::filesystem::path& path) {
  constexpr std::size_t most_impossible = 20;  // one of these many pixels
  const auto impossible = static_cast<std::size_t>(std::ranges::count_if(pixels, [](glm::vec3 p) {
    return p.x < 0 || p.y < 0 || p.z < 0 || 1.3733f * p.y + 0.0982f * p.z < 0.4959f * p.x;
  }));
  const bool is_named = header.hasName() && names_data(header.name());
  if (is_named || impossible * most_impossible > pixels.size())
    throw Error(fmt::format(
        "{}: its channels X, Y and Z look like positions or directions, not like CIE XYZ: {}; "
        "export the picture of the light instead, with channels R, G and B",
        path.string(),
        is_named ? fmt::format("its name is \"{}\"", header.name())
                 : fmt::format("{} of {} pixels are no light", impossible, pixels.size())));
}

// The rectangles of the pixels that the file has, of the picture that it shows, and of both.
struct Windows {
  Imath::Box2i data, shown, common;
};

std::int64_t side(const Imath::Box2i& box, unsigned axis) {
  return std::int64_t{box.max[axis]} - box.min[axis] + 1;
}
std::int64_t area(const Imath::Box2i& box) {
  return side(box, 0) * side(box, 1);
}

Windows windows_of(const Imf::Header& header, const std::filesystem::path& path, bool is_plate,
                   std::vector<std::string>& notes) {
  const Imath::Box2i &data = header.dataWindow(), &shown = header.displayWindow();
  check_size(path, side(data, 0), side(data, 1));
  check_size(path, side(shown, 0), side(shown, 1));
  const Imath::Box2i common{{std::max(data.min.x, shown.min.x), std::max(data.min.y, shown.min.y)},
                            {std::min(data.max.x, shown.max.x), std::min(data.max.y, shown.max.y)}};
  // A file may claim any window. A light may lack three quarters of its picture, because its nadir
  // and sides often do; a plate an eighth of its rows and of its columns, as thin margins are.
  constexpr std::int64_t parts_of_light = 4, parts_of_side = 8;
  const auto lacks_more = [&](unsigned axis) {
    return side(common, axis) * parts_of_side < side(shown, axis) * (parts_of_side - 1);
  };
  if (common.isEmpty() || area(common) * parts_of_light < area(shown) ||
      (is_plate && (lacks_more(0) || lacks_more(1))))
    throw Error(fmt::format(
        "{}: its pixels are a part of {}x{} at ({}, {}) of a picture of {}x{}; a full picture is "
        "needed: export it whole,{} or use the part alone: oiiotool IN --fullpixels -o OUT.exr",
        path.string(), side(data, 0), side(data, 1), data.min.x, data.min.y, side(shown, 0),
        side(shown, 1),
        is_plate ? " fill it with black (oiiotool IN --croptofull -o OUT.exr)," : ""));
  if (area(common) < area(shown) && is_plate)  // the same words for every frame
    notes.push_back(
        path.string() +
        ": lacks at most an eighth of its rows and columns; they are filled with black");
  else if (area(common) < area(shown))
    notes.push_back(fmt::format(
        "{}: has {}x{} of its {}x{} pixels; the others are filled with black (left {}, right {}, "
        "above {}, below {})",
        path.string(), side(common, 0), side(common, 1), side(shown, 0), side(shown, 1),
        common.min.x - shown.min.x, shown.max.x - common.max.x, common.min.y - shown.min.y,
        shown.max.y - common.max.y));
  if (area(common) < area(data))
    notes.push_back(fmt::format("{}: has pixels outside of the {}x{} that it shows; they are cut",
                                path.string(), side(shown, 0), side(shown, 1)));
  return {data, shown, common};
}

// Reads the pixels that are shown, and black for those that the file lacks.
LinearPicture pixels_of(Imf::InputFile& file, const Chosen& chosen, const Windows& windows,
                        const std::filesystem::path& path, const ExrReading& reading,
                        std::vector<std::string>& notes) {
  const auto& [data, shown, common] = windows;
  const auto width = static_cast<std::size_t>(side(data, 0));
  const auto shown_width = static_cast<std::size_t>(side(shown, 0));
  PictureRows rows(path, static_cast<int>(shown_width), static_cast<int>(side(shown, 1)),
                   reading.most_kept);
  const std::vector<glm::vec3> black(shown_width, glm::vec3(0));
  std::vector<glm::vec3> row = black;

  // Memory grows with the rows that are met: a file may claim more of them than it has.
  constexpr std::size_t pixels_at_once = 1 << 18;
  const int rows_at_once = static_cast<int>(std::max<std::size_t>(1, pixels_at_once / width));
  const bool is_once = chosen.names[0] == chosen.names[1];  // one slice for each name
  std::vector<glm::vec3> band;
  for (int first = common.min.y; first <= common.max.y; first += rows_at_once) {
    const int last = std::min(first + rows_at_once - 1, common.max.y);
    band.resize(width * static_cast<std::size_t>(last - first + 1));
    const Imath::Box2i window{{data.min.x, first}, {data.max.x, last}};
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < (is_once ? 1u : 3u); ++c)
      buffer.insert(chosen.names[c],
                    Imf::Slice::Make(Imf::FLOAT, &band[0][static_cast<int>(c)], window,
                                     sizeof(glm::vec3), sizeof(glm::vec3) * width));
    file.setFrameBuffer(buffer);
    file.readPixels(first, last);
    if (is_once)
      for (glm::vec3& radiance : band) radiance = glm::vec3(radiance.r);
    for (int y = shown.min.y; first == common.min.y && y < first; ++y) rows.append(black);
    for (std::size_t begin = static_cast<std::size_t>(common.min.x - data.min.x);
         begin < band.size(); begin += width) {
      std::copy_n(band.begin() + static_cast<std::ptrdiff_t>(begin), side(common, 0),
                  row.begin() + (common.min.x - shown.min.x));
      rows.append(row);
    }
  }
  for (int y = common.max.y; y < shown.max.y; ++y) rows.append(black);
  return std::move(rows).picture(notes);
}

LinearPicture read(const std::filesystem::path& path, std::vector<std::string>& notes,
                   const ExrReading& reading) {
  const box::Reading at(path);
  check_exr_header(path);
  Imf::InputFile file(path.c_str());
  const Imf::Header& header = file.header();
  const Windows windows = windows_of(header, path, reading.is_plate, notes);
  const Chosen chosen = choose_channels(header.channels(), path, notes);
  const std::optional<ColorMatrix> matrix =
      reading.keeps_primaries && chosen.kind != ExrChannels::xyz
          ? std::nullopt
          : rec709_from(header, chosen.kind, path, notes);
  LinearPicture picture = pixels_of(file, chosen, windows, path, reading, notes);
  if (chosen.kind == ExrChannels::xyz) insist_on_light(header, picture.radiance, path);
  if (matrix && reading.is_plate)
    convert(picture.radiance, *matrix);
  else if (matrix)
    convert_light(picture.radiance, *matrix, path, notes);
  picture.pixel_aspect = header.pixelAspectRatio();
  return picture;
}

}  // namespace

LinearPicture read_exr_picture(const std::filesystem::path& path, std::vector<std::string>& notes,
                               const ExrReading& reading) {
  try {
    return read(path, notes, reading);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(path.string() + ": cannot be read as OpenEXR: " + error.what());
  }
}

}  // namespace previz::lighting
