#include "daemon/core/output/exr.hpp"

#include <ImathMatrix.h>
#include <ImfChannelList.h>
#include <ImfChromaticitiesAttribute.h>
#include <ImfDoubleAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfIntAttribute.h>
#include <ImfMatrixAttribute.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>

#include <algorithm>
#include <array>
#include <glm/matrix.hpp>
#include <limits>
#include <string>
#include <utility>

#include "daemon/core/output/exr_file.hpp"
#include "daemon/core/session/nominal_rate.hpp"
#include "drivers/box/reading.hpp"
#include "drivers/error.hpp"

namespace previz::output {
namespace {

// Layers of three channels and of one channel, with their names in the file.
struct ColorLayer {
  std::array<const char*, 3> channels;
  render::Sheet<glm::vec3> render::Layers::*values;
};
struct ScalarLayer {
  const char* channel;
  render::Sheet<float> render::Layers::*values;
};

constexpr std::array color_layers{
    ColorLayer{{"R", "G", "B"}, &render::Layers::composite},
    ColorLayer{{"mixed.R", "mixed.G", "mixed.B"}, &render::Layers::mixed},
    ColorLayer{{"real.R", "real.G", "real.B"}, &render::Layers::real},
    ColorLayer{{"diff.R", "diff.G", "diff.B"}, &render::Layers::diff},
    ColorLayer{{"normal.X", "normal.Y", "normal.Z"}, &render::Layers::normal},
    ColorLayer{{"variance.R", "variance.G", "variance.B"}, &render::Layers::variance},
};
constexpr std::array scalar_layers{
    ScalarLayer{"mask.Y", &render::Layers::mask},
    ScalarLayer{"depth.Z", &render::Layers::depth},
};

// `before_composite` stands before the names of the composite's channels.
Imf::FrameBuffer frame_buffer(const render::Layers& layers, const std::string& before_composite) {
  Imf::FrameBuffer buffer;
  for (const ColorLayer& layer : color_layers)
    for (std::size_t i = 0; i < 3; ++i)
      buffer.insert(
          (layer.values == &render::Layers::composite ? before_composite : "") + layer.channels[i],
          exr_slice(&(layers.*layer.values)[0][static_cast<int>(i)], 3, layers.width));
  for (const ScalarLayer& layer : scalar_layers)
    buffer.insert(layer.channel, exr_slice((layers.*layer.values).data(), 1, layers.width));
  return buffer;
}

// Imath's matrices multiply row vectors.
Imath::M44f row_vector_matrix(const glm::dmat4& matrix) {
  Imath::M44f result;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) result[i][j] = static_cast<float>(matrix[i][j]);
  return result;
}

void add_camera(Imf::Header& header, const ExrMetadata& metadata) {
  const glm::dmat4 camera_from_world = glm::inverse(metadata.world_from_camera);
  const glm::dmat4 y_up{{1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  Imf::addWorldToCamera(header, row_vector_matrix(y_up * camera_from_world));
  if (!metadata.intrinsics) return;
  const PinholeIntrinsics& i = *metadata.intrinsics;
  const glm::dmat4 ndc_from_camera{{i.fx / i.width, 0, 0, 0},
                                   {0, i.fy / i.height, 0, 0},
                                   {(i.cx + 0.5) / i.width, (i.cy + 0.5) / i.height, 1, 1},
                                   {0, 0, 0, 0}};
  Imf::addWorldToNDC(header, row_vector_matrix(ndc_from_camera * camera_from_world));
}

void add_time(Imf::Header& header, const ExrMetadata& metadata) {
  if (metadata.fps <= 0) return;
  const session::RateFraction rate = session::fraction_of(metadata.fps);
  Imf::addFramesPerSecond(header,
                          Imf::Rational(rate.frames, static_cast<unsigned int>(rate.seconds)));
  if (!metadata.timecode || metadata.timecode->fps > 60) return;
  const session::TimecodeDigits& time = *metadata.timecode;
  const int in_a_count = time.fps > 30 ? 2 : 1;
  Imf::TimeCode code(time.hours, time.minutes, time.seconds, time.frames / in_a_count, time.drops);
  code.setFieldPhase(time.frames % in_a_count == 1);
  Imf::addTimeCode(header, code);
}

Imf::Header header(const render::Layers& layers, const ExrMetadata& metadata) {
  Imf::Header header(layers.width, layers.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  for (const ColorLayer& layer : color_layers)
    for (const char* channel : layer.channels)
      header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
  for (const ScalarLayer& layer : scalar_layers)
    header.channels().insert(layer.channel, Imf::Channel(Imf::FLOAT));
  header.channels().insert("A", Imf::Channel(Imf::FLOAT));

  // The defaults of Imf::Chromaticities are Rec. 709 with D65.
  Imf::addChromaticities(header, Imf::Chromaticities());
  header.insert("software", Imf::StringAttribute("previzd " PREVIZ_VERSION));
  header.insert("previz.set", Imf::StringAttribute(metadata.set_name));
  header.insert("previz.pose", Imf::StringAttribute(metadata.pose));
  header.insert("previz.denoised", Imf::IntAttribute(layers.denoised ? 1 : 0));
  header.insert("previz.exposure", Imf::DoubleAttribute(metadata.exposure));
  header.insert("previz.timestamp_ns", Imf::StringAttribute(std::to_string(metadata.timestamp_ns)));
  header.insert("previz.samples", Imf::IntAttribute(static_cast<int>(std::min<std::int64_t>(
                                      layers.samples, std::numeric_limits<int>::max()))));
  if (metadata.pose == "tracked" || metadata.pose == "held") {
    Imath::M44d matrix;
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 4; ++column)
        matrix[row][column] = metadata.world_from_camera[column][row];
    header.insert("previz.world_from_camera", Imf::M44dAttribute(matrix));
    add_camera(header, metadata);
  }
  add_time(header, metadata);
  if (metadata.exposure_s > 0) Imf::addExpTime(header, static_cast<float>(metadata.exposure_s));
  if (metadata.lens) {
    Imf::addAperture(header, static_cast<float>(metadata.lens->f_number));
    Imf::addFocus(header, static_cast<float>(metadata.lens->focus_distance_m));
  }
  return header;
}

void require_whole(const std::filesystem::path& path, const render::Layers& layers) {
  const std::size_t pixels = std::size_t(layers.width) * std::size_t(layers.height);
  for (const ColorLayer& layer : color_layers)
    if (pixels == 0 || (layers.*layer.values).size() != pixels)
      throw Error(path.string() + ": layer " + layer.channels[0] + " does not fill the picture");
  for (const ScalarLayer& layer : scalar_layers)
    if ((layers.*layer.values).size() != pixels)
      throw Error(path.string() + ": layer " + layer.channel + " does not fill the picture");
}

}  // namespace

ExrMetadata exr_metadata(const render::Layers& layers, const Frame& frame,
                         const tracking::Track& track, const set::Set& set) {
  ExrMetadata metadata;
  metadata.exposure = set.observer.exposure.value_or(frame.exposure);
  metadata.timestamp_ns = frame.timestamp_ns;
  metadata.set_name = set.name;
  metadata.pose = to_string(track.status);
  if (track.pose) metadata.world_from_camera = track.pose->world_from_camera;
  metadata.exposure_s = frame.exposure_s;
  if (const auto& calibration = set.observer.calibration) {
    metadata.lens = calibration->lens;
    if (calibration->intrinsics.width == layers.width &&
        calibration->intrinsics.height == layers.height)
      metadata.intrinsics = calibration->intrinsics;
  }
  return metadata;
}

session::Draft exr_draft(const std::filesystem::path& path, const render::Layers& layers,
                         const ExrMetadata& metadata) {
  require_whole(path, layers);
  render::Sheet<glm::vec3> diff = layers.diff;
  for (std::size_t i = 0; i < diff.size(); ++i) diff[i] *= 1.0f - layers.mask[i];
  Imf::FrameBuffer channels = frame_buffer(layers, "");
  for (const auto& [name, channel] : {std::pair("diff.R", 0), {"diff.G", 1}, {"diff.B", 2}})
    channels.insert(name, exr_slice(&diff[0][channel], 3, layers.width));
  std::vector<float> opaque(static_cast<std::size_t>(layers.width), 1.0f);  // a row for all
  channels.insert("A",
                  Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(opaque.data()), sizeof(float), 0));
  return exr_draft(path, header(layers, metadata), channels);
}

void write_exr(const std::filesystem::path& path, const render::Layers& layers,
               const ExrMetadata& metadata) {
  exr_draft(path, layers, metadata).put();
}

render::Layers read_exr(const std::filesystem::path& path) {
  const box::Reading reading(path);
  try {
    require_exr(path);
    Imf::InputFile file(path.c_str());
    const std::size_t pixels = exr_pixels(path, file.header().dataWindow());
    render::Layers layers;
    layers.width = file.header().dataWindow().max.x + 1;
    layers.height = file.header().dataWindow().max.y + 1;
    for (const ColorLayer& layer : color_layers) (layers.*layer.values).resize(pixels);
    for (const ScalarLayer& layer : scalar_layers) (layers.*layer.values).resize(pixels);

    const bool is_of_today = file.header().channels().findChannel("R") != nullptr;
    const Imf::FrameBuffer buffer = frame_buffer(layers, is_of_today ? "" : "composite.");
    if (const auto* samples = file.header().findTypedAttribute<Imf::IntAttribute>("previz.samples"))
      layers.samples = samples->value();
    if (const auto* denoised =
            file.header().findTypedAttribute<Imf::IntAttribute>("previz.denoised"))
      layers.denoised = denoised->value() != 0;
    read_channels(path, file, buffer);
    return layers;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(path.string() + ": cannot be read: " + error.what());
  }
}

}  // namespace previz::output
