#include "daemon/tools/trade/cache.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <span>
#include <sstream>
#include <utility>

#include "daemon/core/scene/assets.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/print.hpp"
#include "drivers/error.hpp"

namespace previz::trade {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int version = 2;

fs::path rows_file(const fs::path& directory) {
  return directory / "trade.json";
}

fs::path reference_file(const fs::path& directory) {
  return directory / "reference.bin";
}

json of(const std::optional<double>& value) {
  return value ? json(*value) : json(nullptr);
}

std::optional<double> optional_of(const json& value) {
  return value.is_null() ? std::nullopt : std::optional(value.get<double>());
}

json of(const TradeErrors& errors) {
  return json::array({of(errors.difference), of(errors.virtual_part), of(errors.picture)});
}

TradeErrors errors_of(const json& value) {
  return {optional_of(value.at(0)), optional_of(value.at(1)), optional_of(value.at(2))};
}

json of(const SquaredError& squared) {
  return json::array({squared.value, squared.deviation});
}

SquaredError squared_of(const json& value) {
  return {value.at(0).get<double>(), value.at(1).get<double>()};
}

template <class Values>
json list_of(const Values& values) {
  json list = json::array();
  for (const auto& value : values) list.push_back(of(value));
  return list;
}

template <class Value>
std::vector<Value> list(const json& values, Value (*read)(const json&)) {
  std::vector<Value> result;
  for (const json& value : values) result.push_back(read(value));
  return result;
}

json of(const ErrorCurve& curve) {
  json points = json::array();
  for (const ErrorCurve::Point& point : curve.points())
    points.push_back({point.samples, point.squared.value, point.squared.deviation});
  return points;
}

ErrorCurve curve_of(const json& value) {
  ErrorCurve curve;
  double before = 0;
  for (const json& point : value) {
    const auto samples = point.at(0).get<double>();
    if (!(samples > before)) throw Error("samples that do not rise");
    curve.add(samples, {point.at(1).get<double>(), point.at(2).get<double>()});
    before = samples;
  }
  return curve;
}

json of(const StillCurves& curves) {
  return {{"noisy", of(curves.noisy)}, {"denoised", of(curves.denoised)}};
}

StillCurves curves_of(const json& value) {
  return {curve_of(value.at("noisy")), curve_of(value.at("denoised"))};
}

json rows_of(const TradeCache& cache) {
  json rows;
  rows["noise"] = of(cache.noise);
  rows["reference"] = of(cache.reference.curves);
  for (const char* kind : {"points", "methods", "costs", "curves"}) rows[kind] = json::array();
  for (const KeptPoint& point : cache.points)
    rows["points"].push_back({{"settings", point.settings},
                              {"samples", point.samples},
                              {"squared", list_of(point.squared)},
                              {"errors", list_of(point.errors)},
                              {"seconds", point.seconds}});
  for (const KeptMethod& method : cache.methods) {
    json one{{"settings", method.settings}};
    if (method.bias) one["bias"] = {method.bias->value, method.bias->least};
    if (method.changed_pixels) one["changed_pixels"] = *method.changed_pixels;
    rows["methods"].push_back(std::move(one));
  }
  for (const KeptCost& cost : cache.costs)
    rows["costs"].push_back(
        {{"settings", cost.settings}, {"live", cost.is_live}, {"parts", cost.cost.parts()}});
  for (const KeptCurves& curves : cache.curves) {
    json one = of(curves.curves);
    one["settings"] = curves.settings;
    rows["curves"].push_back(std::move(one));
  }
  return rows;
}

KeptPoint point_of(const json& value) {
  KeptPoint point{value.at("settings").get<std::string>(), value.at("samples").get<int>(),
                  list(value.at("squared"), squared_of), list(value.at("errors"), errors_of),
                  value.at("seconds").get<std::vector<double>>()};
  if (point.errors.size() != point.seconds.size() || point.squared.size() < point.errors.size())
    throw Error("rounds that do not match");
  return point;
}

KeptMethod method_of(const json& value) {
  KeptMethod method{value.at("settings").get<std::string>(), {}, {}};
  if (value.contains("bias"))
    method.bias = {value.at("bias").at(0).get<double>(), value.at("bias").at(1).get<double>()};
  if (value.contains("changed_pixels"))
    method.changed_pixels = value.at("changed_pixels").get<std::size_t>();
  return method;
}

void read_rows(const json& rows, TradeCache& cache) {
  cache.noise = errors_of(rows.at("noise"));
  cache.reference.curves = curves_of(rows.at("reference"));
  cache.points = list(rows.at("points"), point_of);
  cache.methods = list(rows.at("methods"), method_of);
  for (const json& cost : rows.at("costs"))
    cache.costs.push_back({cost.at("settings").get<std::string>(), cost.at("live").get<bool>(),
                           timing::PathCost(cost.at("parts").get<timing::PathCost::Parts>())});
  for (const json& curves : rows.at("curves"))
    cache.curves.push_back({curves.at("settings").get<std::string>(), curves_of(curves)});
}

// A line with the key, one with width, height and samples, then composite and mask of each half as
// floats of this machine.
std::string reference_bytes(const std::string& key, const KeptReference& reference) {
  std::string bytes = fmt::format("{}\n{} {} {}\n", key, reference.halves[0].width,
                                  reference.halves[0].height, reference.samples);
  for (const render::Layers& half : reference.halves) {
    bytes.append(reinterpret_cast<const char*>(half.composite.data()),
                 half.composite.size() * sizeof half.composite[0]);
    bytes.append(reinterpret_cast<const char*>(half.mask.data()),
                 half.mask.size() * sizeof half.mask[0]);
  }
  return bytes;
}

template <class Value>
void take(std::string_view& bytes, render::Sheet<Value>& values, std::size_t count) {
  if (bytes.size() < count * sizeof(Value)) throw Error("it ends early");
  values.resize(count);
  std::memcpy(static_cast<void*>(values.data()), bytes.data(), count * sizeof(Value));
  bytes.remove_prefix(count * sizeof(Value));
}

void read_reference(const std::string& text, const std::string& key, KeptReference& reference) {
  std::istringstream head(text.substr(0, text.size() < 512 ? text.size() : 512));
  std::string key_line, size_line;
  std::getline(head, key_line);
  if (key_line != key) throw Error("it belongs to another table");
  std::getline(head, size_line);
  int width = 0, height = 0, samples = 0;
  if (!(std::istringstream(size_line) >> width >> height >> samples) || width < 1 || height < 1 ||
      width > 65536 || height > 65536 || samples < 1)
    throw Error("its second line is not a size");
  std::string_view bytes(text);
  bytes.remove_prefix(key_line.size() + size_line.size() + 2);
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  for (render::Layers& half : reference.halves) {
    half.width = width;
    half.height = height;
    take(bytes, half.composite, pixels);
    take(bytes, half.mask, pixels);
  }
  reference.samples = samples;
}

template <class Value>
void add_bytes(session::Sha256& hash, const std::vector<Value>& values) {
  hash.add({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value)});
}

}  // namespace

void KeptReference::add(int more, const std::array<const render::Layers*, 2>& layers) {
  const float share = static_cast<float>(more) / static_cast<float>(samples + more);
  for (std::size_t half = 0; half < 2; ++half) {
    const render::Layers& from = *layers[half];
    render::Layers& to = halves[half];
    if (samples == 0) {
      to.width = from.width;
      to.height = from.height;
      to.composite = from.composite;
      to.mask = from.mask;
      continue;
    }
    for (std::size_t i = 0; i < to.composite.size(); ++i) {
      to.composite[i] += share * (from.composite[i] - to.composite[i]);
      // Where both are whole, the mean is exactly that.
      if (to.mask[i] != from.mask[i]) to.mask[i] += share * (from.mask[i] - to.mask[i]);
    }
  }
  samples += more;
}

KeptPoint& TradeCache::point(const std::string& settings, int samples) {
  for (KeptPoint& point : points)
    if (point.samples == samples && point.settings == settings) return point;
  return points.emplace_back(KeptPoint{settings, samples, {}, {}, {}});
}

const KeptMethod* TradeCache::method(const std::string& settings) const {
  const auto found = std::ranges::find(methods, settings, &KeptMethod::settings);
  return found == methods.end() ? nullptr : &*found;
}

void TradeCache::change_noise(const TradeErrors& to) {
  const auto change = [&](TradeErrors& errors, std::optional<double> TradeErrors::*measure) {
    std::optional<double>& error = errors.*measure;
    const double before = (noise.*measure).value_or(0), after = (to.*measure).value_or(0);
    if (error) error = std::sqrt(std::max(*error * *error - before * before, 0.0) + after * after);
  };
  for (KeptPoint& point : points)
    for (TradeErrors& errors : point.errors) {
      change(errors, &TradeErrors::difference);
      change(errors, &TradeErrors::virtual_part);
      change(errors, &TradeErrors::picture);
    }
  noise = to;
}

std::string settings_words(const set::Set& set, const timing::FrameSettings& settings) {
  set::Set wanted = set;
  wanted.quality.steps.clear();
  wanted.estimation = settings.estimation;
  wanted.lighting = settings.lighting;
  std::string lens = "pinhole";
  if (settings.lens)
    lens = fmt::format("{} {} {}", settings.lens->focal_length_m, settings.lens->f_number,
                       settings.lens->focus_distance_m);
  return set::overlay_toml(set, wanted) +
         fmt::format("adaptive {} denoise {} scale {} carried {} lens {}", settings.adaptive,
                     settings.denoise, settings.scale, settings.carried, lens);
}

std::string memory_key(timing::TimedFrame& frame, const scene::Scene& scene, double scale,
                       const render::DeviceFacts& device) {
  session::Sha256 hash;
  hash.add(fmt::format("{} previzd {} {} {} {} {} {} {}\n", version, PREVIZ_VERSION, device.name,
                       device.driver, device.traces_in_hardware, scale, frame.index(),
                       frame.exposure()));
  hash.add(frame.set_text());
  hash.add(set::intrinsics_toml(frame.calibration()) + set::response_toml(frame.calibration()));
  for (const auto& [name, path] : scene::assets_of(frame.set()))
    hash.add("\n" + name + " " + session::sha256_of(path));
  const glm::dmat4& pose = frame.world_from_camera();
  hash.add({reinterpret_cast<const char*>(&pose), sizeof pose});
  add_bytes(hash, frame.plate(1)->samples);
  add_bytes(hash, frame.light(frame.set().lighting, scene)->encoded.radiance);
  return hash.text();
}

TradeCache load_cache(const fs::path& directory, const std::string& key, std::string& why_not) {
  why_not.clear();
  if (!fs::exists(rows_file(directory))) return {};
  try {
    TradeCache cache;
    const json rows =
        json::parse(session::read_file(rows_file(directory), {"a table of a trade", 1 << 27}));
    if (rows.at("key").get<std::string>() != key) {
      why_not = "it is of another frame, set, size, device, driver or version";
      return {};
    }
    read_rows(rows, cache);
    read_reference(
        session::read_file(reference_file(directory), {"a reference of a trade", 1ull << 34}), key,
        cache.reference);
    return cache;
  } catch (const std::exception& error) {
    why_not = error.what();
    return {};
  }
}

void save_cache(const fs::path& directory, const std::string& key, const TradeCache& cache) {
  json rows = rows_of(cache);
  rows["key"] = key;
  session::replace_file(reference_file(directory), reference_bytes(key, cache.reference));
  session::replace_file(rows_file(directory), rows.dump(1) + "\n");
}

}  // namespace previz::trade
