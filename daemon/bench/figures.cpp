#include "daemon/bench/figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace previz::bench {
namespace {

using Json = nlohmann::ordered_json;

std::string gigabytes(double bytes) {
  return fmt::format("{:.1f} GB", bytes / 1e9);
}

std::string size_words(const FrameFigures& frame) {
  return fmt::format("{}x{}", frame.width, frame.height);
}

double rays_a_second(std::uint64_t rays, double ms) {
  return ms > 0 ? 1e3 * static_cast<double>(rays) / ms : 0;
}

std::string head_of(const BenchReport& report) {
  const render::DeviceFacts& device = report.device;
  std::string text = fmt::format(
      "previzd {}, {}\n{}{}, driver {}, {} of memory\n{}, {} cores\n", report.version, report.date,
      device.name, device.is_gpu ? "" : " (a CPU: no graphics card)", device.driver,
      gigabytes(static_cast<double>(device.memory_bytes)), report.processor, report.cores);
  text += "rays are traced by " + report.tracing_units() + "\n";
  text += fmt::format("first picture after {:.1f} s\n", report.start_s);
  if (report.up_bytes_s && report.down_bytes_s)
    text += fmt::format("copies: {}/s up, {}/s down\n", gigabytes(*report.up_bytes_s),
                        gigabytes(*report.down_bytes_s));
  return text;
}

std::string row_of(const FrameFigures& frame) {
  return fmt::format("{:>12}{:>9}{:>11}{:>10.1f}{:>9.1f}{:>10.1f}{:>10.1f}\n", size_words(frame),
                     frame.samples, frame.triangles, frame.ms, frame.rate(), frame.passes_ms(),
                     frame.cpu_ms);
}

std::string rows_of(const char* title, const std::vector<FrameFigures>& frames) {
  if (frames.empty()) return {};
  std::string text = fmt::format("\n{}\n{:>12}{:>9}{:>11}{:>10}{:>9}{:>10}{:>10}\n", title,
                                 "picture", "samples", "triangles", "ms", "per s", "device", "CPU");
  for (const FrameFigures& frame : frames) text += row_of(frame);
  return text;
}

std::string passes_of(const FrameFigures& frame) {
  std::string text = fmt::format("\nA frame of {} with one sample, in ms\n", size_words(frame));
  for (const render::DeviceTimes::Pass& pass : frame.passes)
    text += fmt::format("  {:<20}{:>8.2f}  in {}\n", pass.name, pass.ms, pass.count);
  text += fmt::format(
      "  {:<20}{:>8.2f}\n  {:<20}{:>8.2f}\n  {:<20}{:>8.2f}\n  {:<20}{:>8.2f}  of it waiting: "
      "{:.2f}\n",
      "all passes", frame.passes_ms(), "placing the frame", frame.begin_ms, "recording commands",
      frame.record_ms, "having the picture", frame.show_ms, frame.waited_ms);
  const render::DeviceWork& work = frame.work;
  text += fmt::format(
      "  submissions {}, waits {}, allocations {}, barriers {}, {:.1f} MB up, {:.1f} MB down\n",
      work.submissions, work.waits, work.allocations, work.barriers,
      static_cast<double>(work.bytes_up) / 1e6, static_cast<double>(work.bytes_down) / 1e6);
  if (frame.screen_ms > 0)
    text += fmt::format(
        "  {:.1f} ms from a frame's arrival to the display, for which the picture {}\n"
        "  (camera readout, tracking and the screen's refresh come on top)\n",
        frame.latency_ms(), frame.comes_down ? "comes down" : "stays on the card");
  const double rays = rays_a_second(frame.rays, frame.ms_of("extend"));
  const double shadow_rays = rays_a_second(frame.shadow_rays, frame.ms_of("shadow"));
  if (rays > 0)
    text += fmt::format("  {:.1f} million rays per second, {:.1f} million shadow rays per second\n",
                        rays / 1e6, shadow_rays / 1e6);
  return text;
}

Json json_of(const FrameFigures& frame) {
  Json passes = Json::array();
  for (const render::DeviceTimes::Pass& pass : frame.passes)
    passes.push_back({{"pass", pass.name}, {"runs", pass.count}, {"ms", pass.ms}});
  const render::DeviceWork& work = frame.work;
  return {{"width", frame.width},
          {"height", frame.height},
          {"samples", frame.samples},
          {"triangles", frame.triangles},
          {"frames", frame.frames},
          {"ms", frame.ms},
          {"interval_ms", frame.interval_ms},
          {"frames_per_s", frame.rate()},
          {"begin_ms", frame.begin_ms},
          {"record_ms", frame.record_ms},
          {"show_ms", frame.show_ms},
          {"waited_ms", frame.waited_ms},
          {"cpu_ms", frame.cpu_ms},
          {"device_ms", frame.passes_ms()},
          {"screen_ms", frame.screen_ms},
          {"latency_ms", frame.latency_ms()},
          {"comes_down", frame.comes_down},
          {"rays", frame.rays},
          {"rays_per_s", rays_a_second(frame.rays, frame.ms_of("extend"))},
          {"shadow_rays", frame.shadow_rays},
          {"shadow_rays_per_s", rays_a_second(frame.shadow_rays, frame.ms_of("shadow"))},
          {"submissions", work.submissions},
          {"waits", work.waits},
          {"allocations", work.allocations},
          {"barriers", work.barriers},
          {"bytes_up", work.bytes_up},
          {"bytes_down", work.bytes_down},
          {"passes", passes}};
}

Json json_of(const std::vector<FrameFigures>& frames) {
  Json result = Json::array();
  for (const FrameFigures& frame : frames) result.push_back(json_of(frame));
  return result;
}

}  // namespace

double FrameFigures::passes_ms() const {
  double all = 0;
  for (const render::DeviceTimes::Pass& pass : passes) all += pass.ms;
  return all;
}

double FrameFigures::ms_of(const std::string& pass) const {
  const auto found = std::ranges::find(passes, pass, &render::DeviceTimes::Pass::name);
  return found == passes.end() ? 0 : found->ms;
}

const FrameFigures* BenchReport::typical() const {
  const FrameFigures* best = nullptr;
  for (const FrameFigures& frame : by_size)
    if (!best || frame.width <= 1920) best = &frame;
  return best;
}

std::string BenchReport::tracing_units() const {
  return device.traces_in_hardware ? "its hardware for rays" : "compute shaders";
}

std::string bench_table(const BenchReport& report) {
  std::string text = head_of(report);
  text += rows_of("Live frames over the size of the picture", report.by_size);
  text += rows_of("over the samples of a pixel", report.by_samples);
  text += rows_of("over the triangles of the scene", report.by_triangles);
  if (const FrameFigures* frame = report.typical()) text += passes_of(*frame);
  if (report.set) {
    const SetFigures& set = *report.set;
    text +=
        fmt::format("\n{}: {:.1f} ms a frame of {}x{} with {} samples, {:.1f} frames per second",
                    set.set, set.ms, set.width, set.height, set.samples, 1000 / set.ms);
    if (set.fps > 0)
      text += fmt::format(
          "; the set asks for {:g}{}", set.fps,
          1000 / set.ms >= set.fps ? "" : ", so previzd will draw smaller pictures to hold it");
    text += "\n";
  }
  for (const LeftOut& left : report.left_out)
    text += fmt::format("not measured: {}, {}\n", left.what, left.why);
  return text;
}

std::string bench_json(const BenchReport& report) {
  const auto number_or_null = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json(nullptr);
  };
  Json json = {{"date", report.date},
               {"version", report.version},
               {"device",
                {{"name", report.device.name},
                 {"driver", report.device.driver},
                 {"is_gpu", report.device.is_gpu},
                 {"memory_bytes", report.device.memory_bytes},
                 {"shares_host_memory", report.device.shares_host_memory},
                 {"traces_in_hardware", report.device.traces_in_hardware}}},
               {"processor", report.processor},
               {"cores", report.cores},
               {"start_s", report.start_s},
               {"up_bytes_per_s", number_or_null(report.up_bytes_s)},
               {"down_bytes_per_s", number_or_null(report.down_bytes_s)},
               {"by_size", json_of(report.by_size)},
               {"by_samples", json_of(report.by_samples)},
               {"by_triangles", json_of(report.by_triangles)}};
  if (report.set)
    json["set"] = {{"set", report.set->set},       {"width", report.set->width},
                   {"height", report.set->height}, {"samples", report.set->samples},
                   {"ms", report.set->ms},         {"frames_per_s", 1000 / report.set->ms},
                   {"asked_fps", report.set->fps}, {"camera_fps", report.set->camera_fps}};
  json["left_out"] = Json::array();
  for (const LeftOut& left : report.left_out)
    json["left_out"].push_back({{"what", left.what}, {"why", left.why}});
  json["took_s"] = report.took_s;
  json["interrupted"] = report.interrupted;
  // A path or a device's name need not be UTF-8.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace previz::bench
