#include "daemon/tools/model/scan_colours.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "daemon/core/scene/named_file.hpp"
#include "daemon/core/scene/picture_bytes.hpp"
#include "daemon/tools/model/scan_text.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"

namespace previz::model {
namespace {

// All pictures of a scan together: 64 of 4096 x 4096.
constexpr std::size_t most_texels = std::size_t{1} << 30;
constexpr std::uintmax_t most_texture_bytes = std::uintmax_t{1} << 30;

}  // namespace

std::optional<std::filesystem::path> ScanTextures::find(const std::string& written) {
  const auto found = scene::find_named_file(file_, written, scene::names_in_scans);
  if (!found) return {};
  if (const std::string other = scene::note_of_other_name(*found, "file", written); !other.empty())
    note(other);
  return found->path;
}

void ScanTextures::note(const std::string& text) {
  if (std::ranges::find(notes_, text) == notes_.end()) notes_.push_back(text);
}

int ScanTextures::named(const std::string& written) {
  if (const auto known = used_.find(written); known != used_.end()) return known->second;
  const auto file = find(written);
  if (!file)
    throw Error(
        fmt::format("{}: its texture \"{}\" is missing; put it beside the scan, or place the "
                    "scan by three or more points, under [scan.points]",
                    file_.string(), printable(written)));
  if (std::filesystem::file_size(*file) > most_texture_bytes)
    throw Error(file->string() + ": is larger than 1 GiB; export the scan with smaller textures");
  const std::string bytes = scan_bytes(*file);
  return used_[written] =
             encoded({reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()}, written);
}

int ScanTextures::encoded(std::span<const unsigned char> bytes, const std::string& name) {
  const std::string where = fmt::format("{}: its texture \"{}\"", file_.string(), printable(name));
  const scene::PictureSize size = scene::checked_picture_size(bytes, where);
  texels_ += static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height);
  if (texels_ > most_texels)
    throw Error(
        fmt::format("{}: its textures have more than {} pixels together; export the scan "
                    "with smaller ones",
                    file_.string(), most_texels));
  pictures_.push_back({name, size.width, size.height, scene::decoded_luma(bytes, size, where)});
  return static_cast<int>(pictures_.size() - 1);
}

}  // namespace previz::model
