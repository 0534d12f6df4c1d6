#include "daemon/tools/trade/report.hpp"

#include <algorithm>

namespace previz::trade {

std::vector<TradeFrontPoint> front_of(const TradeReport& report) {
  std::vector<TradeFrontPoint> front;
  for (std::size_t m = 0; m < report.methods.size(); ++m)
    for (std::size_t i = 0; i < report.methods[m].points.size(); ++i)
      if (report.methods[m].points[i].pareto) front.push_back({m, i});
  std::ranges::stable_sort(front, {}, [&](const auto& at) { return report.point(at).seconds; });
  return front;
}

std::vector<TradeFrontPoint> listed_front_of(const TradeReport& report) {
  std::vector<TradeFrontPoint> listed;
  const auto error = [&](const TradeFrontPoint& at) {
    return report.point(at).errors.picture.value_or(0);
  };
  const auto is_corner = [&](const TradeFrontPoint& at) {
    return std::ranges::find(report.corners, at, &TradeCorner::at) != report.corners.end();
  };
  for (const TradeFrontPoint& at : front_of(report))
    if (listed.empty() || is_corner(at) || error(at) < 0.9 * error(listed.back()))
      listed.push_back(at);
  return listed;
}

}  // namespace previz::trade
