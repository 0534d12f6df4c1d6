#include "daemon/tools/trade/page.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <span>
#include <utility>
#include <vector>

#include "daemon/core/output/chart.hpp"
#include "daemon/core/output/page.hpp"
#include "daemon/core/session/files.hpp"
#include "drivers/error.hpp"

namespace previz::trade {
namespace {

using output::ChartCurve, output::ChartPoint, output::escaped, output::Table;
using output::samples_words, output::share_words, output::time_words;
using Measure = std::optional<double> TradeErrors::*;

std::string plain_words(std::string name) {
  std::ranges::replace(name, '_', ' ');
  return name;
}

// Begins the words with a capital letter.
std::string sentence(std::string words) {
  words.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(words.front())));
  return words;
}

std::string share_or_none(const std::optional<double>& share) {
  return share ? share_words(*share) : "none there";
}

std::string setting_words(const TradeReport& report, const TradeFrontPoint& at) {
  return plain_words(report.methods[at.method].name) + ", " +
         samples_words(report.point(at).samples);
}

std::string png_uri(const Plate& plate) {
  cv::Mat3b picture(plate.height, plate.width);
  std::ranges::transform(plate.samples, picture.ptr<std::uint8_t>(),
                         [](std::uint16_t sample) { return static_cast<std::uint8_t>(sample); });
  cv::cvtColor(picture, picture, cv::COLOR_RGB2BGR);  // OpenCV's order
  std::vector<unsigned char> bytes;
  cv::imencode(".png", picture, bytes);
  return "data:image/png;base64," + session::base64(std::as_bytes(std::span(bytes)));
}

std::string figure(const Plate& picture, const std::string& caption) {
  return "<figure><img alt=\"\" src=\"" + png_uri(picture) + "\"><figcaption>" + caption +
         "</figcaption></figure>\n";
}

std::string rate_words(double fps) {
  char text[48];
  std::snprintf(text, sizeof text, "%g frames per second", fps);
  return text;
}

// Returns a ratio of 1 or more with two digits at least: "1.8", "12", "157".
std::string times_words(double ratio) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), ratio < 9.95 ? "%.1f" : "%.0f", ratio);
  return text.data();
}

std::string opening(const TradeReport& report) {
  const double share = 1.0 * report.width * report.height / report.full_width / report.full_height;
  std::string sizes = std::to_string(report.width) + " × " + std::to_string(report.height);
  if (share < 1)
    sizes += "; at the full " + std::to_string(report.full_width) + " × " +
             std::to_string(report.full_height) + " everything would take about " +
             times_words(1 / share) + " times as long";
  return "<h1>What time buys on “" + escaped(report.set) + "”</h1>\n<p>Frame " +
         std::to_string(report.frame) +
         " of the take was rendered with the set's own settings, and then "
         "with one setting changed at a time, on " +
         escaped(report.device) + ", at " + sizes +
         ". An <b>error</b> says how far a picture is from the converged one: the rms of the "
         "difference over the rms of the picture, as for <code>previz render "
         "--error</code>.</p>\n";
}

ChartPoint chart_point(const TradeReport& report, std::size_t method, const TradePoint& point,
                       Measure measure) {
  const double error = (point.errors.*measure).value_or(0);
  return {point.seconds, error, point.pareto,
          plain_words(report.methods[method].name) + ", " + samples_words(point.samples) + ": " +
              time_words(point.seconds) + ", error " + share_words(error)};
}

std::string front_chart(const TradeReport& report) {
  output::LogChart chart{"", "time to render", "error of the picture", {}, {}, 940, 430};
  ChartCurve cloud{"", "cloud", {}}, front{"", "front", {}};
  for (std::size_t m = 0; m < report.methods.size(); ++m) {
    if (report.methods[m].changed_pixels) continue;
    for (const TradePoint& point : report.methods[m].points)
      cloud.points.push_back(chart_point(report, m, point, &TradeErrors::picture));
  }
  for (const auto& [method, index] : front_of(report))
    front.points.push_back(
        chart_point(report, method, report.methods[method].points[index], &TradeErrors::picture));
  chart.curves = {std::move(cloud), std::move(front)};
  for (const TradeCorner& corner : report.corners)
    chart.curves.push_back(
        {corner.name,
         "front",
         {chart_point(report, corner.at.method, report.point(corner.at), &TradeErrors::picture)}});
  if (report.noise.picture) chart.doubtful_below = 10 * *report.noise.picture;
  return to_svg(chart);
}

// Returns "4 %", or "≈ 4 %" if the reference's own error is more than a tenth of it.
std::string error_words(const TradeReport& report, const TradePoint& point, Measure measure) {
  TradeErrors alone, noise;
  alone.*measure = point.errors.*measure;
  noise.*measure = report.noise.*measure;
  return (within_noise(alone, noise).empty() ? "" : "≈ ") + share_or_none(point.errors.*measure);
}

std::string corner_name(const TradeReport& report, const TradeFrontPoint& at) {
  const auto corner = std::ranges::find(report.corners, at, &TradeCorner::at);
  return corner == report.corners.end() ? "" : corner->name;
}

std::string front_section(const TradeReport& report) {
  std::string html =
      "<h2>The best choices</h2>\n<p>Every dot is one setting at one number of samples. The dots "
      "on "
      "the line are the best choices: every other setting is slower or has a larger error. In the "
      "shaded part the reference itself is too noisy to decide.</p>\n<div class=\"scroll\">" +
      front_chart(report) + "</div>\n";
  Table table({{"time", true},
               {"what"},
               {"error", true},
               {"of light on the real set", true},
               {"of virtual objects", true},
               {""}});
  for (const TradeFrontPoint& at : listed_front_of(report)) {
    const TradePoint& point = report.point(at);
    const std::string corner = corner_name(report, at);
    table.row({time_words(point.seconds), setting_words(report, at),
               error_words(report, point, &TradeErrors::picture),
               error_words(report, point, &TradeErrors::difference),
               error_words(report, point, &TradeErrors::virtual_part), corner},
              corner == "knee" ? "bend" : "");
  }
  return html + table.html() +
         "<p class=\"soft\">Among settings whose errors differ by less than a tenth, "
         "only "
         "the fastest is listed. ≈ marks errors that are too close to the noise of the "
         "reference.</p>\n";
}

// What the set would get for what was asked, first of all: the answer is a file.
std::string answers_section(const TradeReport& report) {
  if (report.answers.empty()) return "";
  std::string html =
      "<h2>What you get</h2>\n<p>Asked for: " + escaped(rate_words(report.question.fps)) +
      " live, and an error of " + share_words(report.question.error) +
      " for a frozen or rendered frame. Live, the take was played for some seconds with all that "
      "runs beside the renderer; the time is that of its part. Refine and post: a full-size frame "
      "and all its layers, with nothing beside. Errors are from the converged picture, without its "
      "own noise.</p>\n";
  Table table({{"for"}, {"what you get"}, {"a frame", true}, {"error", true}, {"file"}}, "answers");
  for (const TradeAnswer& answer : report.answers)
    table.row({answer.use, answer.words, time_words(answer.seconds), share_words(answer.error),
               answer.is_met ? answer.use + ".toml" : "none"},
              answer.is_met ? "" : "bend");
  html += table.html();
  for (const TradeAnswer& answer : report.answers)
    if (answer.is_met)
      html += "<details><summary>" + escaped(answer.use) + ".toml</summary>\n<pre>" +
              escaped(answer.toml) + "</pre></details>\n";
  return html +
         "<p class=\"soft\">Use a file with <code>previzd run SET --with live.toml</code> or "
         "<code>previz render SESSION --with post.toml</code>; a frozen frame that is refined has "
         "the "
         "same settings as the live picture.</p>\n";
}

std::string corners_section(const TradeReport& report) {
  std::string html =
      "<h2>The fastest, the best, and the knee between them</h2>\n<p>Left: the picture. Right: "
      "five "
      "times its difference from the converged picture; grey means none.</p>\n<div "
      "class=\"pictures\">\n";
  for (const TradeCorner& corner : report.corners) {
    html += figure(corner.picture,
                   "<b>" + corner.name + "</b> " + escaped(front_words(report, corner.at))) +
            figure(corner.difference, "five times the difference");
  }
  return html +
         figure(report.reference, "<b>converged</b> the set's own settings, " +
                                      samples_words(report.reference_samples)) +
         "</div>\n";
}

std::string axis_chart(const TradeReport& report, const TradePlan::Axis& axis, const char* title,
                       Measure measure) {
  constexpr std::array colours = {"s1", "s2", "s3", "s4", "s5", "s6"};
  output::LogChart chart{title, "time to render", "error", {}, {}};
  std::size_t colour = 0;
  for (const TradePlan::Entry& entry : axis.entries) {
    ChartCurve curve{entry.variant + (entry.method == 0 ? " (own)" : ""),
                     entry.method == 0 ? "own" : colours[colour++ % colours.size()],
                     {}};
    for (const TradePoint& point : report.methods[entry.method].points)
      curve.points.push_back(chart_point(report, entry.method, point, measure));
    chart.curves.push_back(std::move(curve));
  }
  if (const auto& noise = report.noise.*measure) chart.doubtful_below = 10 * *noise;
  return to_svg(chart);
}

// Returns a sentence that names the variants with a detected bias against the set's own settings.
std::string bias_sentence(const TradeReport& report, const TradePlan::Axis& axis) {
  std::string biased;
  for (const TradePlan::Entry& entry : axis.entries) {
    const auto& bias = report.methods[entry.method].bias;
    if (bias && bias->value > 0)
      biased +=
          (biased.empty() ? "" : "; ") + escaped(entry.variant) + ", " + share_words(bias->value);
  }
  return biased.empty()
             ? ""
             : "<p class=\"soft\">With any number of samples, these differ from the set's own "
               "picture by: " +
                   biased + ".</p>\n";
}

std::string axis_section(const TradeReport& report, const TradePlan::Axis& axis) {
  return "<h2>" + sentence(plain_words(axis.name)) + "</h2>\n<p>" + escaped(sentence(axis.what)) +
         ".</p>\n<div class=\"charts\">\n" +
         axis_chart(report, axis, "The picture", &TradeErrors::picture) +
         axis_chart(report, axis, "Light and shadow on the real set", &TradeErrors::difference) +
         "</div>\n" + bias_sentence(report, axis);
}

// The time of a method at its most samples.
std::string measured_words(const TradeMethod& method) {
  const bool is_measured = !method.points.empty() && method.points.back().seconds > 0;
  return is_measured ? time_words(method.points.back().seconds) : "not measured";
}

// Photons are a part that this set may need: they are switched off to see what they cost.
void add_photons(const TradeReport& report, Table& table) {
  const auto axis = std::ranges::find(report.plan.axes, "caustics", &TradePlan::Axis::name);
  if (axis == report.plan.axes.end()) return;
  const auto time_of = [&](const char* variant) -> std::string {
    const auto entry = std::ranges::find(axis->entries, variant, &TradePlan::Entry::variant);
    return entry == axis->entries.end() ? "not measured"
                                        : measured_words(report.methods[entry->method]);
  };
  table.row({"photons, which caustics need", time_of("none"), time_of("photons"), "caustics"});
}

std::string parts_section(const TradeReport& report, const TradePlan::Axis& axis) {
  const TradePoint& own = report.methods.front().points.back();
  std::string html =
      "<h2>What is switched off</h2>\n<p>This set does not need these parts of the renderer, so "
      "they "
      "are "
      "switched off. For this table they were switched on, to see what that would cost; the "
      "picture "
      "must stay the same, bit for bit.</p>\n";
  Table table({{"part"}, {"without it", true}, {"with it", true}, {"pixels changed", true}});
  for (const TradePlan::Entry& entry : axis.entries) {
    const TradeMethod& method = report.methods[entry.method];
    if (!method.changed_pixels) continue;
    table.row({entry.variant, time_words(own.seconds), measured_words(method),
               std::to_string(*method.changed_pixels)});
  }
  add_photons(report, table);
  return html + table.html() + "<p class=\"soft\">" + samples_words(own.samples) + ".</p>\n";
}

// Names what there was no time for, so that nobody takes its absence for a result.
std::string unmeasured_section(const TradeReport& report) {
  std::string names;
  for (const std::string& name : report.unmeasured) add_to_list(names, plain_words(name));
  std::string text;
  if (report.interrupted) text += "<p><b>It was stopped before it had ended.</b></p>\n";
  if (!names.empty())
    text += "<p>There was no time to measure: " + escaped(names) +
            ". Run again, it continues from here; with more <code>--minutes</code> it gets "
            "further at once.</p>\n";
  return text;
}

std::string reading_section(const TradeReport& report) {
  return "<h2>How to read this</h2>\n<p>The reference was rendered with the set's own settings "
         "at " +
         samples_words(report.reference_samples) +
         ", in two independent halves. Half the difference between them is its own error: " +
         share_or_none(report.noise.picture) + " of the picture, " +
         share_or_none(report.noise.difference) + " of the light on the real set, " +
         share_or_none(report.noise.virtual_part) +
         " of the virtual objects. Do not trust an error below ten times that: it is shaded in the "
         "charts and marked in the tables.</p>\n<p>Every setting was rendered " +
         (report.rounds == 1 ? std::string("once")
                             : std::to_string(report.rounds) +
                                   " times, with new random numbers and in a new order each time") +
         ". Times are medians of rendering alone, after a warm-up. A setting that "
         "leaves "
         "something out (fewer bounces, no caustics, a pinhole lens) never reaches the picture of "
         "the set's own settings: its curve levels out. Radiance is clipped where the sensor "
         "clips.</p>\n";
}

std::string csv_share(const std::optional<double>& share) {
  if (!share) return "";
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", *share);
  return text;
}

// A field with a comma or a quote is quoted (RFC 4180).
std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

std::string csv_errors(const TradeErrors& errors) {
  return csv_share(errors.difference) + "," + csv_share(errors.virtual_part) + "," +
         csv_share(errors.picture);
}

}  // namespace

std::string trade_csv(const TradeReport& report) {
  std::string csv =
      "axis,variant,samples,seconds,e_diff,e_virtual,e_picture,reference_noise,pareto,within_noise,"
      "bias\n";
  const std::string noise = csv_share(report.noise.picture);
  csv += "reference,own," + std::to_string(report.reference_samples) + ",," +
         csv_errors(report.noise) + "," + noise + ",0,,\n";
  for (const TradePlan::Axis& axis : report.plan.axes) {
    for (const TradePlan::Entry& entry : axis.entries) {
      const TradeMethod& method = report.methods[entry.method];
      for (const TradePoint& point : method.points)
        csv += csv_field(axis.name) + "," + csv_field(entry.variant) + "," +
               std::to_string(point.samples) + "," + csv_share(point.seconds) + "," +
               csv_errors(point.errors) + "," + noise + "," + (point.pareto ? "1" : "0") + "," +
               point.within_noise + "," +
               (method.bias ? csv_share(method.bias->value) : std::string()) + "\n";
    }
  }
  return csv;
}

std::string front_words(const TradeReport& report, const TradeFrontPoint& at) {
  const TradePoint& point = report.point(at);
  return time_words(point.seconds) + ": " + setting_words(report, at) + ", error " +
         share_or_none(point.errors.picture);
}

std::string trade_page(const TradeReport& report) {
  const bool is_any_measured = !report.methods.front().points.empty();
  std::string body = opening(report) + unmeasured_section(report) + answers_section(report) +
                     (is_any_measured ? front_section(report) : std::string()) +
                     corners_section(report);
  for (const TradePlan::Axis& axis : report.plan.axes)
    if (is_any_measured)
      body += axis.name == parts_axis ? parts_section(report, axis) : axis_section(report, axis);
  return output::page(report.set + ": what time buys", body + reading_section(report));
}

}  // namespace previz::trade
