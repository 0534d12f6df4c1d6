#include "daemon/core/output/sums_exr.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfStringAttribute.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <string>
#include <string_view>

#include "daemon/core/output/exr_file.hpp"
#include "drivers/box/reading.hpp"
#include "drivers/error.hpp"

namespace previz::output {
namespace {

// A member of the sums of a pixel, with the names of its four components in the file.
struct SumLayer {
  const char* name;
  std::array<const char*, 4> components;
  glm::vec4 gpu::GpuPixel::*values;
};

constexpr std::array<const char*, 4> of_mixed{"R", "G", "B", "mask"},
    of_difference{"R", "G", "B", "depth"}, of_uncovered{"R", "G", "B", "differences"},
    of_square{"R", "G", "B", "samples"}, of_normal{"X", "Y", "Z", "hits"},
    of_albedo{"R", "G", "B", "A"}, of_caustics{"R", "G", "B", "variance"};

constexpr std::array sum_layers{
    SumLayer{"mixed.high", of_mixed, &gpu::GpuPixel::mixed_high},
    SumLayer{"mixed.low", of_mixed, &gpu::GpuPixel::mixed_low},
    SumLayer{"difference.high", of_difference, &gpu::GpuPixel::diff_high},
    SumLayer{"difference.low", of_difference, &gpu::GpuPixel::diff_low},
    SumLayer{"uncovered.high", of_uncovered, &gpu::GpuPixel::uncovered_high},
    SumLayer{"uncovered.low", of_uncovered, &gpu::GpuPixel::uncovered_low},
    SumLayer{"square.high", of_square, &gpu::GpuPixel::square_high},
    SumLayer{"square.low", of_square, &gpu::GpuPixel::square_low},
    SumLayer{"normal", of_normal, &gpu::GpuPixel::normal},
    SumLayer{"albedo", of_albedo, &gpu::GpuPixel::albedo},
};
constexpr std::size_t floats_a_pixel = sizeof(gpu::GpuPixel) / sizeof(float);
static_assert(floats_a_pixel == 4 * sum_layers.size());

std::string channel_name(const char* layer, const char* component) {
  return std::string(layer) + "." + component;
}

Imf::FrameBuffer channels_of(const render::SampleSums& sums) {
  Imf::FrameBuffer buffer;
  for (const SumLayer& layer : sum_layers)
    for (int c = 0; c < 4; ++c)
      buffer.insert(channel_name(layer.name, layer.components[static_cast<std::size_t>(c)]),
                    exr_slice(&(sums.sums.pixels[0].*layer.values)[c], floats_a_pixel, sums.width));
  if (!sums.sums.caustics.empty())
    for (int c = 0; c < 4; ++c)
      buffer.insert(channel_name("caustics", of_caustics[static_cast<std::size_t>(c)]),
                    exr_slice(&sums.sums.caustics[0][c], 4, sums.width));
  return buffer;
}

struct NamedCounter {
  const char* name;
  std::uint64_t render::Counters::*count;
};
constexpr std::array sample_counters{
    NamedCounter{"rays", &render::Counters::rays},
    NamedCounter{"shadow_rays", &render::Counters::shadow_rays},
    NamedCounter{"dropped_not_finite", &render::Counters::dropped_not_finite},
    NamedCounter{"dropped_negative", &render::Counters::dropped_negative},
    NamedCounter{"stopped_in_layers", &render::Counters::stopped_in_layers},
    NamedCounter{"unfinished", &render::Counters::unfinished},
    NamedCounter{"measured", &render::Counters::measured},
    NamedCounter{"unmeasured", &render::Counters::unmeasured},
};

std::string attribute(const std::filesystem::path& path, const Imf::Header& header,
                      const char* name) {
  const auto* found = header.findTypedAttribute<Imf::StringAttribute>(name);
  if (!found) throw Error(path.string() + ": has no attribute " + name);
  return found->value();
}

// Throws previz::Error unless the text is a whole number that fits.
template <class Number>
Number number_of(const std::filesystem::path& path, const char* name, std::string_view text) {
  Number number = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (code != std::errc() || end != text.data() + text.size() || number < 0)
    throw Error(path.string() + ": its attribute " + name + " is \"" + std::string(text) +
                "\", and not a whole number");
  return number;
}

void read_attributes(const std::filesystem::path& path, const Imf::Header& header,
                     RangeSums& sums) {
  const auto number = [&](const char* name) {
    return number_of<std::int64_t>(path, name, attribute(path, header, name));
  };
  sums.frame = static_cast<std::uint64_t>(number("previz.frame"));
  sums.sums.samples = number("previz.samples");
  const char* name = "previz.sample_range";
  const std::string range = attribute(path, header, name);
  const std::size_t slash = std::min(range.find('/'), range.size() - 1);
  sums.range.index = number_of<int>(path, name, std::string_view(range).substr(0, slash));
  sums.range.count = number_of<int>(path, name, std::string_view(range).substr(slash + 1));
  for (const NamedCounter& counter : sample_counters)
    sums.sums.counters.*counter.count =
        static_cast<std::uint64_t>(number((std::string("previz.") + counter.name).c_str()));
}

// Throws previz::Error where the file cannot hold so many pixels, before there is memory for them.
void refuse_too_small(const std::filesystem::path& path, const Imf::Header& header,
                      std::size_t pixels) {
  constexpr std::uintmax_t most_deflated = 1032;  // bytes of one (zlib, Technical Details)
  if (header.compression() == Imf::ZIP_COMPRESSION &&
      pixels * sizeof(gpu::GpuPixel) / most_deflated <= std::filesystem::file_size(path))
    return;
  throw Error(path.string() + ": is too small for its " + std::to_string(pixels) +
              " pixels, or not ZIP compressed as previzd writes it");
}

}  // namespace

void write_sums_exr(const std::filesystem::path& path, const RangeSums& sums) {
  Imf::Header header(sums.sums.width, sums.sums.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  const Imf::FrameBuffer channels = channels_of(sums.sums);
  for (auto channel = channels.begin(); channel != channels.end(); ++channel)
    header.channels().insert(channel.name(), Imf::Channel(Imf::FLOAT));
  header.insert("software", Imf::StringAttribute("previzd " PREVIZ_VERSION));
  header.insert("previz.frame", Imf::StringAttribute(std::to_string(sums.frame)));
  header.insert("previz.sample_range", Imf::StringAttribute(std::to_string(sums.range.index) + "/" +
                                                            std::to_string(sums.range.count)));
  header.insert("previz.samples", Imf::StringAttribute(std::to_string(sums.sums.samples)));
  for (const NamedCounter& counter : sample_counters)
    header.insert(std::string("previz.") + counter.name,
                  Imf::StringAttribute(std::to_string(sums.sums.counters.*counter.count)));
  exr_draft(path, header, channels).put();
}

RangeSums read_sums_exr(const std::filesystem::path& path,
                        const std::shared_ptr<render::Scratch>& scratch) {
  const box::Reading reading(path);
  try {
    require_exr(path);
    Imf::InputFile file(path.c_str());
    const std::size_t pixels = exr_pixels(path, file.header().dataWindow());
    refuse_too_small(path, file.header(), pixels);
    RangeSums result;
    read_attributes(path, file.header(), result);
    render::SampleSums& sums = result.sums;
    sums.sums = render::PixelSums(scratch);
    sums.width = file.header().dataWindow().max.x + 1;
    sums.height = file.header().dataWindow().max.y + 1;
    sums.sums.pixels.resize(pixels);
    if (file.header().channels().findChannel("caustics.R")) sums.sums.caustics.resize(pixels);
    const Imf::FrameBuffer channels = channels_of(sums);
    read_channels(path, file, channels);
    return result;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(path.string() + ": cannot be read: " + error.what());
  }
}

}  // namespace previz::output
