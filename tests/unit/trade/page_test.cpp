// The table and the page of `previz trade`, of a made-up sweep.
#include "daemon/tools/trade/page.hpp"

#include "daemon/core/output/chart.hpp"
#include "drivers/plate.hpp"
#include "tests/support/test.hpp"

namespace previz::trade::page_test {

Plate grey(int width, int height) {
  return {width, height, 8, std::vector<std::uint16_t>(3 * std::size_t(width) * height, 128)};
}

TradePoint made_point(int samples, double seconds, double error, bool pareto) {
  return {samples, seconds, {error, std::nullopt, error / 2}, "", pareto};
}

// Two methods on an axis and a part carried along, at two numbers of samples.
TradeReport made_report() {
  TradeReport report;
  report.set = "desk <1> & \"2\"";
  report.device = "a device";
  report.width = report.full_width = 8;
  report.height = report.full_height = 6;
  report.rounds = 2;
  report.reference_samples = 512;
  report.noise = {0.01, std::nullopt, 0.005};
  report.plan.methods = {{"the set's own settings", {}}, {"depth 1", {}}, {"parts lens", {}}};
  report.plan.axes = {{"depth", "bounces", {{"1", 1}, {"16, all", 0}}},
                      {parts_axis, "parts", {{"left out", 0}, {"lens", 2}}}};
  report.methods = {
      {"the set's own settings",
       {made_point(1, 0.05, 0.4, false), made_point(4, 0.2, 0.2, true)},
       TradeReference::Bias{},
       {}},
      {"depth 1",
       {made_point(1, 0.02, 0.5, true), made_point(4, 0.08, 0.45, true)},
       TradeReference::Bias{0.13, 0.01},
       {}},
      {"parts lens", {made_point(1, 0.06, 0.4, false), made_point(4, 0.24, 0.2, false)}, {}, 0u}};
  report.methods[0].points[1].within_noise = "e_diff";
  report.reference = grey(8, 6);
  report.corners = {{"fastest", {1, 0}, grey(8, 6), grey(8, 6)},
                    {"best", {0, 1}, grey(8, 6), grey(8, 6)}};
  return report;
}

TEST(TradeCsv, HasALineForEveryVariantAndNumberOfSamples) {
  std::istringstream csv(trade_csv(made_report()));
  std::vector<std::string> lines;
  for (std::string line; std::getline(csv, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 2u + 2 * 2 + 2 * 2);
  EXPECT_EQ(lines[0],
            "axis,variant,samples,seconds,e_diff,e_virtual,e_picture,reference_noise,pareto,"
            "within_noise,bias");
  EXPECT_EQ(lines[1], "reference,own,512,,0.01,,0.005,0.005,0,,");
  EXPECT_EQ(lines[2], "depth,1,1,0.02,0.5,,0.25,0.005,1,,0.13");
  EXPECT_EQ(lines[5], "depth,\"16, all\",4,0.2,0.2,,0.1,0.005,1,e_diff,0");
  EXPECT_EQ(lines[9], "parts,lens,4,0.24,0.2,,0.1,0.005,0,,");
}

TEST(TradePage, NeedsNothingBesidesItself) {
  const std::string html = trade_page(made_report());
  for (const char* outside : {"http:", "https:", "<script", "<link", "@import", "url("})
    EXPECT_THAT(html, Not(HasSubstr(outside))) << outside;
  const std::regex reference("(src|href)=\"([^\"]{0,22})");
  int pictures = 0;
  for (auto it = std::sregex_iterator(html.begin(), html.end(), reference);
       it != std::sregex_iterator(); ++it, ++pictures)
    EXPECT_EQ((*it)[2], "data:image/png;base64,");
  EXPECT_EQ(pictures, 5);  // two corners with their differences, and the reference
}

// On a telephone a table that is too wide is moved within its own box.
TEST(TradePage, ShowsEveryValueHoweverNarrowItIs) {
  const std::string html = trade_page(made_report());
  EXPECT_THAT(html, Not(HasSubstr("td.n { display: none")));
  EXPECT_THAT(html, HasSubstr("table, .scroll { display: block; overflow-x: auto; }"));
  EXPECT_THAT(html, HasSubstr("pre { overflow-x: auto; }"));
}

TEST(TradePage, TellsTheFrontInWords) {
  const TradeReport report = made_report();
  EXPECT_EQ(front_words(report, {1, 0}), "20 ms: depth 1, 1 sample, error 25 %");
  EXPECT_EQ(front_words(report, {0, 1}), "0.2 s: the set's own settings, 4 samples, error 10 %");
  // (1, 1) is on the front, nearer than the one before it by just a tenth: not worth a line.
  EXPECT_EQ(front_of(report).size(), 3u);
  EXPECT_EQ(listed_front_of(report), (std::vector<TradeFrontPoint>{{1, 0}, {0, 1}}));
  EXPECT_THAT(trade_page(report), HasSubstr("set's own picture by: 1, 13 %"));
}

// 103 x 73 pixels are 156.6 times 8 x 6: a ratio, and no minutes and seconds.
TEST(TradePage, SaysHowMuchLongerTheFullSizeTakes) {
  TradeReport report = made_report();
  report.full_width = 103;
  report.full_height = 73;
  EXPECT_THAT(trade_page(report), HasSubstr("would take about 157 times as long"));
  report.full_width = 12;
  report.full_height = 7;
  EXPECT_THAT(trade_page(report), HasSubstr("would take about 1.8 times as long"));
}

TEST(TradePage, WhatPeopleNamedCannotBreakIt) {
  EXPECT_THAT(trade_page(made_report()), HasSubstr("desk &lt;1&gt; &amp; &quot;2&quot;"));
}

TEST(TradeChart, NumbersReadWell) {
  EXPECT_EQ(output::share_words(std::numeric_limits<double>::infinity()), "unknown");
  EXPECT_EQ(output::time_words(0.0321), "32 ms");
  EXPECT_EQ(output::time_words(0.1), "0.1 s");
  EXPECT_EQ(output::time_words(3.24), "3.2 s");
  EXPECT_EQ(output::time_words(80), "1:20");
  EXPECT_EQ(output::share_words(0.00351), "0.35 %");
  EXPECT_EQ(output::share_words(0.04), "4 %");
  EXPECT_EQ(output::share_words(1.2), "120 %");
  EXPECT_EQ(output::share_words(0), "0 %");
}

TEST(TradeChart, WithNothingAboveZeroThereIsNoChart) {
  output::LogChart chart;
  chart.curves = {{"none", "own", {{1, 0, false, ""}, {0, 1, false, ""}}}};
  EXPECT_EQ(output::to_svg(chart), "");
}

// Whatever the data, nothing is drawn outside the picture.
TEST(TradeChart, EveryDotIsInside) {
  output::LogChart chart;
  for (int i = 0; i < 9; ++i)
    chart.curves.push_back(
        {"curve", "s1", {{1e-6, 1e-9 * (i + 1), false, ""}, {1e6, 1e3, true, ""}}});
  const std::string svg = output::to_svg(chart);
  const std::regex place("(cx|cy|x|y)=\"([-0-9.]+)\"");
  for (auto it = std::sregex_iterator(svg.begin(), svg.end(), place); it != std::sregex_iterator();
       ++it) {
    const double value = std::stod((*it)[2]);
    EXPECT_GE(value, 0);
    EXPECT_LE(value, (*it)[1].str().find('x') == std::string::npos ? chart.height : chart.width);
  }
}

}  // namespace previz::trade::page_test
