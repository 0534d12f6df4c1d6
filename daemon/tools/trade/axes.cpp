#include "daemon/tools/trade/axes.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "daemon/core/render/world/feature.hpp"
#include "daemon/core/set/names.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::trade {
namespace {

std::string number_words(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

// Returns an axis over every value of an enumeration of the set file; `field` maps
// timing::FrameSettings& to it.
template <class Field>
TradeAxis spelled(std::string name, std::string what, Field field) {
  TradeAxis axis{std::move(name), std::move(what), {}, ""};
  timing::FrameSettings blank;
  for (const auto& [word, value] : set::names(field(blank)))
    axis.variants.push_back(
        {word, [=, value = value](timing::FrameSettings& s) { field(s) = value; }});
  return axis;
}

// Returns an axis over a few numbers; `field` maps timing::FrameSettings& to the number.
template <class Field, class Number>
TradeAxis numbered(std::string name, std::string what, timing::FrameSettings own,
                   std::initializer_list<Number> values, Field field) {
  TradeAxis axis{std::move(name), std::move(what), {}, number_words(field(own))};
  for (const Number value : values)
    axis.variants.push_back(
        {number_words(value), [=](timing::FrameSettings& s) { field(s) = value; }});
  return axis;
}

// Light that no light camera sees has no variants: of that from a recording only the sources are
// known, and no image.
TradeAxis light_modes(const set::Lighting& own) {
  if (own.from != set::LightFrom::camera) return {"light_mode", "", {}, set::name_of(own.mode)};
  return spelled(
      "light_mode", "how the light camera's picture lights the set",
      [](timing::FrameSettings & s) -> auto& { return s.lighting.mode; });
}

TradeAxis left_out(std::uint32_t needed) {
  TradeAxis axis{
      parts_axis, "features that this set does not need: off, or switched on", {}, "off"};
  for (const render::Feature& feature : render::features())
    if (feature.can_be_carried && (feature.bit & needed) == 0)
      axis.variants.push_back(
          {feature.name, [bit = feature.bit](timing::FrameSettings& s) { s.carried |= bit; }});
  return axis;
}

void drop(std::vector<TradeAxis>& axes, const std::string& name) {
  std::erase_if(axes, [&](const TradeAxis& axis) { return axis.name == name; });
}

void keep_wanted(std::vector<TradeAxis>& axes, const std::vector<std::string>& wanted) {
  if (wanted.empty()) return;
  for (const std::string& name : wanted) {
    if (std::ranges::find(axes, name, &TradeAxis::name) != axes.end()) continue;
    std::string allowed;
    for (const TradeAxis& axis : axes) add_to_list(allowed, axis.name);
    throw Error("--axes " + name + ": unknown axis; " + allowed + " are allowed");
  }
  std::erase_if(axes, [&](const TradeAxis& axis) {
    return std::ranges::find(wanted, axis.name) == wanted.end();
  });
}

}  // namespace

std::vector<TradeAxis> trade_axes(const timing::FrameSettings& own, std::uint32_t needed) {
  std::vector<TradeAxis> axes{
      spelled(
          "estimator", "tracing both worlds in full, or only how they differ",
          [](timing::FrameSettings & s) -> auto& { return s.estimation.estimator; }),
      numbered(
          "difference_sampling",
          "largest fraction of directions aimed at virtual and removed objects", own,
          {0.0, 0.25, 0.5, 0.75},
          [](timing::FrameSettings & s) -> auto& { return s.estimation.difference_sampling; }),
      numbered(
          "depth", "largest number of bounces", own, {1, 2, 4, 8},
          [](timing::FrameSettings & s) -> auto& { return s.estimation.max_depth; }),
      spelled(
          "caustics", "how light reaching surfaces via mirrors and glass is found",
          [](timing::FrameSettings & s) -> auto& { return s.estimation.caustics; }),
      spelled(
          "composite", "how shadows and light are put onto the plate",
          [](timing::FrameSettings & s) -> auto& { return s.estimation.composite; }),
      spelled(
          "real_radiance", "real surfaces in reflections: simulated, or read from the plate",
          [](timing::FrameSettings & s) -> auto& { return s.estimation.real_radiance; }),
      light_modes(own.lighting),
      spelled(
          "light_sampling", "how directions towards the light are chosen",
          [](timing::FrameSettings & s) -> auto& { return s.lighting.sampling; }),
      {"light_resolution",
       "resolution of the light map, texels per side",
       {{"16", [](timing::FrameSettings& s) { s.lighting.resolution = 16; }},
        {"64", [](timing::FrameSettings& s) { s.lighting.resolution = 64; }}},
       own.lighting.resolution > 0 ? number_words(own.lighting.resolution) : "as captured"},
      {"resolution",
       "size of what is rendered, which is put onto the whole plate",
       {{"half", [](timing::FrameSettings& s) { s.scale = 0.5; }},
        {"quarter", [](timing::FrameSettings& s) { s.scale = 0.25; }}},
       "full"},
      {"spread",
       "the same number of samples for every pixel, or, from 32 on, more where it is noisy",
       {{"even", [](timing::FrameSettings& s) { s.adaptive = false; }},
        {"adaptive", [](timing::FrameSettings& s) { s.adaptive = true; }}},
       ""},
      {"denoise",
       "noise left in the picture, or removed where the variance shows it",
       {{"off", [](timing::FrameSettings& s) { s.denoise = false; }},
        {"on", [](timing::FrameSettings& s) { s.denoise = true; }}},
       ""},
      {"lens",
       "the lens with its aperture, or a pinhole that keeps everything in focus",
       {{"pinhole", [](timing::FrameSettings& s) { s.lens.reset(); }}},
       "aperture"},
      left_out(needed),
  };
  // Without what an axis is about, all its variants are one.
  if ((needed & gpu::FEATURE_PHOTONS) == 0) drop(axes, "caustics");
  if ((needed & gpu::FEATURE_FORKS) == 0) drop(axes, "difference_sampling");
  if (own.lighting.from == set::LightFrom::set && !own.lighting.environment)
    for (const char* of_the_light_around : {"light_sampling", "light_resolution"})
      drop(axes, of_the_light_around);
  return axes;
}

std::vector<std::string> axis_names() {
  std::vector<std::string> names;
  for (const TradeAxis& axis : trade_axes({}, ~0u)) names.push_back(axis.name);
  return names;
}

TradePlan plan_trade(const timing::FrameSettings& own, std::vector<TradeAxis> axes,
                     const std::vector<std::string>& wanted) {
  keep_wanted(axes, wanted);
  TradePlan plan;
  plan.methods.push_back({"the set's own settings", own});
  for (const TradeAxis& axis : axes) {
    TradePlan::Axis planned{axis.name, axis.what, {}};
    for (const TradeVariant& variant : axis.variants) {
      timing::FrameSettings settings = own;
      variant.change(settings);
      auto known = std::ranges::find(plan.methods, settings, &TradePlan::Method::settings);
      if (known == plan.methods.end())
        known = plan.methods.insert(known, {axis.name + " " + variant.name, std::move(settings)});
      planned.entries.push_back(
          {variant.name, static_cast<std::size_t>(known - plan.methods.begin())});
    }
    if (std::ranges::find(planned.entries, 0u, &TradePlan::Entry::method) == planned.entries.end())
      planned.entries.insert(planned.entries.begin(), {axis.own, 0});
    if (planned.entries.size() > 1) plan.axes.push_back(std::move(planned));
  }
  return plan;
}

}  // namespace previz::trade
