#include "daemon/bench/page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "daemon/core/output/page.hpp"
#include "daemon/core/set/check.hpp"

namespace previz::bench {
namespace {

using output::escaped, output::Table;

constexpr const char* bar_style =
    R"(\ntd.bar { width: 55%; } td.bar div { height: .8rem; min-width: 1px; background: var(--s1); border-radius: 2px; }\n.host td.bar div { background: var(--s2); }\n)";

std::string number(double value) {
  if (value >= 100) return fmt::format("{:.0f}", value);
  return value >= 10 ? fmt::format("{:.1f}", value) : fmt::format("{:.2f}", value);
}

std::string bar(const std::string& name, double ms, double longest, const char* kind) {
  return fmt::format(
      "<tr class=\"{}\"><td>{}</td><td class=\"n\">{} ms</td><td class=\"bar\"><div "
      "style=\"width:{:.1f}%\"></div></td></tr>\n",
      kind, escaped(name), number(ms), longest > 0 ? 100 * ms / longest : 0);
}

std::string milliseconds(double ms) {
  return number(ms) + " ms";
}

std::string section(const char* title, const std::vector<FrameFigures>& frames) {
  if (frames.empty()) return {};
  Table table({{"picture"},
               {"samples", true},
               {"triangles", true},
               {"a frame", true},
               {"frames per second", true},
               {"graphics card", true},
               {"all cores", true}});
  for (const FrameFigures& frame : frames)
    table.row({fmt::format("{}x{}", frame.width, frame.height), std::to_string(frame.samples),
               std::to_string(frame.triangles), milliseconds(frame.ms), number(frame.rate()),
               milliseconds(frame.passes_ms()), milliseconds(frame.cpu_ms)});
  return std::string("<h2>") + title + "</h2>\n" + table.html();
}

// Where the time of the frame goes: the device's passes, longest first, then the computer's part.
std::string parts(const FrameFigures& frame) {
  constexpr double least_share = 0.01;  // of the device's time; what is shorter is summed up
  const double all = frame.passes_ms();
  std::vector<std::pair<std::string, double>> passes;
  double rest = 0;
  for (const render::DeviceTimes::Pass& pass : frame.passes)
    if (pass.ms >= least_share * all)
      passes.emplace_back(pass.name, pass.ms);
    else
      rest += pass.ms;
  if (rest > 0) passes.emplace_back("all others", rest);
  const std::pair<const char*, double> host[] = {
      {"placing the frame", frame.begin_ms},
      {"recording commands", frame.record_ms},
      {"having the picture, without waiting", std::max(frame.show_ms - frame.waited_ms, 0.0)},
      {"giving it to the display", frame.screen_ms}};
  double longest = 0;
  for (const auto& [name, ms] : passes) longest = std::max(longest, ms);
  for (const auto& [name, ms] : host) longest = std::max(longest, ms);
  std::string html =
      fmt::format("<h2>Where a frame of {}x{} goes</h2>\n<table>\n", frame.width, frame.height);
  for (const auto& [name, ms] : passes) html += bar(name, ms, longest, "device");
  for (const auto& [name, ms] : host) html += bar(name, ms, longest, "host");
  const render::DeviceWork& work = frame.work;
  return html + "</table>\n" +
         fmt::format(
             "<p class=\"soft\">Blue: passes of the graphics card, by its own clock{}. Brown: "
             "the computer, which then waits for the card for {} ms. Submissions: {}; waits: {}; "
             "allocations: {}; barriers: {}. {:.1f} MB go up, and {:.1f} MB come down. From a "
             "frame's arrival to the display it takes {} ms; camera readout, tracking and the "
             "screen's refresh come on top.</p>\n",
             frame.passes.empty() ? " (it has none)" : "", number(frame.waited_ms),
             work.submissions, work.waits, work.allocations, work.barriers,
             static_cast<double>(work.bytes_up) / 1e6, static_cast<double>(work.bytes_down) / 1e6,
             number(frame.latency_ms()));
}

std::string machine(const BenchReport& report) {
  const auto speed = [](double bytes_s) { return fmt::format("{:.1f} GB/s", bytes_s / 1e9); };
  Table table({{""}, {"", true}});
  table.row({"graphics card", report.device.name + (report.device.is_gpu ? "" : " (a CPU)")});
  table.row({"driver", report.device.driver});
  table.row({"rays", "traced by " + report.tracing_units()});
  table.row({"its memory",
             fmt::format("{:.1f} GB", static_cast<double>(report.device.memory_bytes) / 1e9)});
  table.row({"processor", fmt::format("{}, {} cores", report.processor, report.cores)});
  table.row({"first picture", fmt::format("after {:.1f} s", report.start_s)});
  if (report.up_bytes_s) table.row({"copies up", speed(*report.up_bytes_s)});
  if (report.down_bytes_s) table.row({"copies down", speed(*report.down_bytes_s)});
  if (const FrameFigures* frame = report.typical()) {
    const auto rays = [](std::uint64_t count, double ms) {
      return fmt::format("{:.1f} million per second", 1e-3 * static_cast<double>(count) / ms);
    };
    if (const double ms = frame->ms_of("extend"); ms > 0)
      table.row({"rays", rays(frame->rays, ms)});
    if (const double ms = frame->ms_of("shadow"); ms > 0)
      table.row({"shadow rays", rays(frame->shadow_rays, ms)});
  }
  return "<h2>The machine</h2>\n" + table.html();
}

std::string verdict(const BenchReport& report) {
  std::string html;
  if (!report.device.is_gpu)
    html +=
        "<p>There is no graphics card, or none that Vulkan finds: the processor draws, slowly. "
        "previzd(8) says which drivers a card needs.</p>\n";
  if (report.set) {
    const SetFigures& set = *report.set;
    html += fmt::format(
        "<p>{} takes {} ms a frame of {}x{} with {}: {} frames per second{}"
        "</p>\n",
        escaped(set.set), number(set.ms), set.width, set.height,
        set::plural(std::uint64_t(set.samples), "sample"), number(1000 / set.ms),
        set.fps > 0 ? fmt::format(", and it asks for {:g}.", set.fps) : ".");
  }
  return html;
}

}  // namespace

std::string bench_page(const BenchReport& report) {
  const FrameFigures* typical = report.typical();
  std::string title = "Nothing was measured";
  if (typical)
    title = fmt::format("{} frames per second at {}x{}", number(typical->rate()), typical->width,
                        typical->height);
  std::string html = fmt::format(
      "<h1>{1}</h1>\n<p class=\"soft\">{0}, measured by previzd {2} on {3}. A live frame has one "
      "sample a pixel, is averaged with those before it and denoised; it shows a glass ball among "
      "solid ones under a sky. A frame lasts from the camera's picture to its own; where frames "
      "follow at once, the next one is begun before that, so that more of them come per second."
      "</p>\n",
      escaped(report.device.name), title, report.version, report.date);
  html += verdict(report);
  html += section("Over the size of the picture", report.by_size);
  if (typical) html += parts(*typical);
  html += section("Over the samples of a pixel", report.by_samples);
  html += section("Over the triangles of the scene", report.by_triangles);
  html += machine(report);
  if (!report.left_out.empty()) {
    Table table({{""}, {""}});
    for (const LeftOut& left : report.left_out) table.row({left.what, left.why});
    html += "<h2>Not measured</h2>\n" + table.html();
  }
  return output::page(report.device.name + ": " + title, html, bar_style);
}

}  // namespace previz::bench
