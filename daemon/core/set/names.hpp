// Lists how the set file spells the values of its enumerations; a new spelling is added here alone.
#pragma once

#include <array>

#include "daemon/core/set/actions.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/keys/value.hpp"

namespace previz {

constexpr auto names(DisplayScale) {
  return std::to_array<Name<DisplayScale>>(
      {{"letterbox", DisplayScale::letterbox}, {"1:1", DisplayScale::one_to_one}});
}
constexpr auto names(ContactWiring::Bias) {
  return std::to_array<Name<ContactWiring::Bias>>({{"as_is", ContactWiring::Bias::as_is},
                                                   {"none", ContactWiring::Bias::none},
                                                   {"pull_up", ContactWiring::Bias::pull_up},
                                                   {"pull_down", ContactWiring::Bias::pull_down}});
}

namespace session {

constexpr auto names(VideoCodec) {
  return std::to_array<Name<VideoCodec>>({{"ffv1", VideoCodec::ffv1}, {"raw", VideoCodec::raw}});
}

}  // namespace session

namespace set {

using previz::name_of;

constexpr auto names(Presence) {
  return std::to_array<Name<Presence>>({{"phantom", Presence::phantom},
                                        {"virtual", Presence::virtual_object},
                                        {"removed", Presence::removed}});
}
constexpr auto names(LightType) {
  return std::to_array<Name<LightType>>({{"point", LightType::point},
                                         {"spot", LightType::spot},
                                         {"directional", LightType::directional},
                                         {"rectangle", LightType::rectangle},
                                         {"sphere", LightType::sphere}});
}
constexpr auto names(UnseenRule) {
  return std::to_array<Name<UnseenRule>>({{"horizon", UnseenRule::horizon},
                                          {"mirror", UnseenRule::mirror},
                                          {"observer", UnseenRule::observer},
                                          {"constant", UnseenRule::constant}});
}
constexpr auto names(LightFrom) {
  return std::to_array<Name<LightFrom>>({{"camera", LightFrom::camera},
                                         {"recording", LightFrom::recording},
                                         {"set", LightFrom::set}});
}
constexpr auto names(LightMode) {
  return std::to_array<Name<LightMode>>({{"image", LightMode::image},
                                         {"sources", LightMode::sources},
                                         {"hybrid", LightMode::hybrid}});
}
constexpr auto names(Residual) {
  return std::to_array<Name<Residual>>(
      {{"blurred", Residual::blurred}, {"dropped", Residual::dropped}});
}
constexpr auto names(LightSampling) {
  return std::to_array<Name<LightSampling>>(
      {{"importance", LightSampling::importance}, {"bsdf", LightSampling::bsdf}});
}
constexpr auto names(Estimator) {
  return std::to_array<Name<Estimator>>(
      {{"paired", Estimator::paired}, {"difference", Estimator::difference}});
}
constexpr auto names(Composite) {
  return std::to_array<Name<Composite>>({{"additive", Composite::additive},
                                         {"ratio", Composite::ratio},
                                         {"hybrid", Composite::hybrid}});
}
constexpr auto names(RealRadiance) {
  return std::to_array<Name<RealRadiance>>(
      {{"traced", RealRadiance::traced}, {"camera", RealRadiance::camera}});
}
constexpr auto names(Caustics) {
  return std::to_array<Name<Caustics>>(
      {{"photons", Caustics::photons}, {"traced", Caustics::traced}, {"none", Caustics::none}});
}
constexpr auto names(PressKind) {
  return std::to_array<Name<PressKind>>({{"short", PressKind::short_press},
                                         {"long", PressKind::long_press},
                                         {"double", PressKind::double_press}});
}
constexpr auto names(Mode) {
  return std::to_array<Name<Mode>>({{"standby", Mode::standby},
                                    {"live", Mode::live},
                                    {"refine", Mode::refine},
                                    {"review", Mode::review}});
}

}  // namespace set
}  // namespace previz
