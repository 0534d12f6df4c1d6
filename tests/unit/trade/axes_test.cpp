// What `previz trade` makes of its table of axes.
#include "daemon/tools/trade/axes.hpp"

#include "daemon/core/render/world/feature.hpp"
#include "shaders/lib/render_shared.h"
#include "tests/support/test.hpp"

namespace previz::trade::axes_test {

TradePlan plan_of(const timing::FrameSettings& own, const std::vector<std::string>& wanted = {}) {
  return plan_trade(own, trade_axes(own, ~gpu::FEATURE_TEXTURES), wanted);
}

// Points into the plan.
const TradePlan::Axis* axis_named(const TradePlan& plan, const std::string& name) {
  const auto axis = std::ranges::find(plan.axes, name, &TradePlan::Axis::name);
  return axis == plan.axes.end() ? nullptr : &*axis;
}

TEST(TradeAxes, EachHasTheSetsOwnSettingsOnceAndSomethingElse) {
  const TradePlan plan = plan_of({});
  EXPECT_EQ(plan.methods.front().settings, timing::FrameSettings());
  for (const TradePlan::Axis& axis : plan.axes) {
    EXPECT_EQ(std::ranges::count(axis.entries, 0u, &TradePlan::Entry::method), 1) << axis.name;
    EXPECT_GT(axis.entries.size(), 1u) << axis.name;
    EXPECT_FALSE(axis.what.empty()) << axis.name;
  }
}

TEST(TradeAxes, NothingIsMeasuredTwice) {
  const TradePlan plan = plan_of({});
  for (std::size_t i = 0; i < plan.methods.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_FALSE(plan.methods[i].settings == plan.methods[j].settings)
          << plan.methods[i].name << " is " << plan.methods[j].name;
}

TEST(TradeAxes, AnOwnValueOutsideTheListIsNamedByItself) {
  timing::FrameSettings own;
  own.estimation.max_depth = 12;
  const TradePlan outside = plan_of(own);
  EXPECT_EQ(axis_named(outside, "depth")->entries.front().variant, "12");
  own.estimation.max_depth = 4;
  const TradePlan inside = plan_of(own);
  const auto& entries = axis_named(inside, "depth")->entries;
  EXPECT_EQ(std::ranges::find(entries, 0u, &TradePlan::Entry::method)->variant, "4");
  EXPECT_EQ(entries.size(), 4u);
}

TEST(TradeAxes, WhereThereIsNothingToTradeThereIsNoAxis) {
  timing::FrameSettings own;
  const TradePlan pinhole = plan_of(own);
  EXPECT_FALSE(axis_named(pinhole, "lens"));
  EXPECT_TRUE(axis_named(pinhole, "light_mode"));
  own.lighting.from = set::LightFrom::recording;
  EXPECT_FALSE(axis_named(plan_of(own), "light_mode"));
  own.lens = ThinLens{0.05, 2.8, 1.0};
  const TradePlan with_lens = plan_of(own);
  EXPECT_TRUE(axis_named(with_lens, "lens"));
}

TEST(TradeAxes, TheFeaturesOfTheSceneDecideWhichThereAre) {
  const auto names = [](const timing::FrameSettings& own, std::uint32_t needed) {
    std::vector<std::string> all;
    for (const TradeAxis& axis : trade_axes(own, needed)) all.push_back(axis.name);
    return all;
  };
  const auto has = [](const std::vector<std::string>& all, const char* name) {
    return std::ranges::count(all, name) > 0;
  };
  timing::FrameSettings own;
  EXPECT_TRUE(has(names(own, gpu::FEATURE_PHOTONS), "caustics"));
  EXPECT_FALSE(has(names(own, gpu::FEATURE_FORKS), "caustics")) << "no mirror, no glass";
  EXPECT_TRUE(has(names(own, gpu::FEATURE_FORKS), "difference_sampling"));
  EXPECT_FALSE(has(names(own, gpu::FEATURE_PHOTONS), "difference_sampling")) << "nothing virtual";
  EXPECT_TRUE(has(names(own, 0), "light_resolution"));
  own.lighting.from = set::LightFrom::set;
  EXPECT_FALSE(has(names(own, 0), "light_resolution")) << "lamps of the set alone";
  EXPECT_FALSE(has(names(own, 0), "light_sampling"));
}

TEST(TradeAxes, CarriesEachFeatureThatIsNotNeededAndChangesNoPicture) {
  const std::uint32_t needed = gpu::FEATURE_GLOSSY | gpu::FEATURE_PHOTONS;
  const TradePlan plan = plan_trade({}, trade_axes({}, needed), {parts_axis});
  const auto& entries = plan.axes.at(0).entries;
  EXPECT_EQ(entries.front().variant, "off");
  std::size_t carried = 0;
  for (const render::Feature& feature : render::features()) {
    const auto entry = std::ranges::find(entries, feature.name, &TradePlan::Entry::variant);
    const bool expected = feature.can_be_carried && feature.bit != gpu::FEATURE_GLOSSY;
    EXPECT_EQ(entry != entries.end(), expected) << feature.name;
    if (!expected || entry == entries.end()) continue;
    ++carried;
    EXPECT_EQ(plan.methods[entry->method].settings.carried, feature.bit) << feature.name;
  }
  EXPECT_EQ(entries.size(), carried + 1);
}

TEST(TradeAxes, OnlyThoseWantedAreSwept) {
  const TradePlan plan = plan_of({}, {"estimator"});
  EXPECT_EQ(plan.axes.size(), 1u);
  EXPECT_EQ(plan.methods.size(), 2u);
  EXPECT_THROW(plan_of({}, {"estimators"}), Error);
}

}  // namespace previz::trade::axes_test
