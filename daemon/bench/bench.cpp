#include "daemon/bench/bench.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <condition_variable>
#include <ctime>
#include <fstream>
#include <mutex>
#include <optional>
#include <ostream>
#include <stop_token>
#include <string>
#include <thread>

#include "daemon/bench/frames.hpp"
#include "daemon/bench/page.hpp"
#include "daemon/core/output/progress.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/core/timing/path_timer.hpp"
#include "drivers/error.hpp"

namespace previz::bench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int widths[] = {160, 320, 640, 1280, 1920, 3840};  // of pictures of 16:9
constexpr int sample_counts[] = {2, 4, 8};
constexpr std::size_t triangle_counts[] = {100'000, 600'000, 1'000'000};

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("model name"))
      if (const std::size_t at = line.find(": "); at != std::string::npos)
        return line.substr(at + 2);
  return "unknown processor";
}

// Says every few seconds that the machine is busy. Nothing else may write meanwhile.
class Busy {
 public:
  Busy(const char* doing, std::ostream& out)
      : thread_([this, doing, &out](const std::stop_token& stop) {
          std::unique_lock lock(mutex_);
          for (int seconds = 5; !over_.wait_for(lock, stop, std::chrono::seconds(5),
                                                [&] { return stop.stop_requested(); });
               seconds += 5)
            out << "  " << doing << ": " << seconds << " s so far" << std::endl;
        }) {}

 private:
  std::mutex mutex_;
  std::condition_variable_any over_;
  std::jthread thread_;  // the last: it uses the others
};

class Bench {
 public:
  Bench(const BenchOptions& options, std::ostream& out) : options_(options), out_(out) {}

  BenchReport run() {
    begin();
    copies();
    out_ << "preparing the first picture: on a new machine or driver this may take a minute"
         << std::endl;
    std::optional<Frames> first;
    {
      const Busy busy("preparing", out_);
      first.emplace(device_);
    }
    Frames& frames = *first;
    out_ << "the first picture took " << output::duration_words(frames.start_s()) << std::endl;
    report_.start_s = frames.start_s();
    render::keep_programs(*device_);
    for (const int width : widths)
      measure(frames, {.width = width, .height = width * 9 / 16}, report_.by_size);
    // The largest size up to 1280x720 that is quick enough to be measured many times.
    FrameWish wish{.width = widths[0], .height = widths[0] * 9 / 16};
    for (const FrameFigures& size : report_.by_size)
      if (size.width <= 1280 && size.ms < 200) wish = {.width = size.width, .height = size.height};
    for (const int samples : sample_counts) {
      FrameWish more = wish;
      more.samples = samples;
      measure(frames, more, report_.by_samples);
    }
    for (const std::size_t triangles : triangle_counts) {
      FrameWish more = wish;
      more.triangles = triangles;
      measure(frames, more, report_.by_triangles);
    }
    if (!frames.no_display().empty())
      report_.left_out.push_back({"the way to the display", frames.no_display()});
    try {
      measure_set();
    } catch (const render::DeviceLost&) {
      throw;
    } catch (const Error& error) {  // it is too large for the device
      report_.left_out.push_back({options_.set_or_session->string(), error.what()});
    }
    report_.took_s = since_start();
    report_.interrupted = options_.stop.stop_requested();
    return std::move(report_);
  }

 private:
  double since_start() const {
    return std::chrono::duration<double>(Clock::now() - start_).count();
  }

  void begin() {
    // A mistake in the set is said before anything is measured.
    if (options_.set_or_session)
      frame_.emplace(timing::FrameSource{.set_or_session = *options_.set_or_session}, std::nullopt);
    report_.date = fmt::format("{:%Y-%m-%d %H:%M}", fmt::localtime(std::time(nullptr)));
    report_.version = PREVIZ_VERSION;
    report_.processor = processor();
    report_.cores = std::thread::hardware_concurrency();
    const render::DeviceOptions given =
        render::options_for(options_.device, !frame_ || frame_->set().quality.hardware_rays);
    render::DeviceOptions wanted = given;
    wanted.times_passes = true;
    try {
      device_ = render::open_device(wanted);
    } catch (const Error&) {
      device_ = render::open_device(given);  // its passes cannot be timed
      report_.left_out.push_back({"the passes of a frame", "the device has no clock for them"});
    }
    report_.device = render::facts_of(*device_);
    out_ << "measuring " << report_.device.name << ", for at most "
         << static_cast<int>(options_.seconds) << " s" << std::endl;
  }

  void copies() {
    if (const std::optional<render::CopySpeed> speed = render::copy_speed(*device_)) {
      report_.up_bytes_s = speed->up_bytes_s;
      report_.down_bytes_s = speed->down_bytes_s;
    }
  }

  void measure(Frames& frames, const FrameWish& wish, std::vector<FrameFigures>& to) {
    if (options_.stop.stop_requested()) return;
    const std::string what =
        fmt::format("{}x{}, {}, {} triangles", wish.width, wish.height,
                    set::plural(std::uint64_t(wish.samples), "sample"), wish.triangles);
    const double expected_s = frames.expected_s(wish);
    // Every page has a figure, also where the first picture took all the time.
    const bool is_first = to.empty() && wish.width == widths[0] && &to == &report_.by_size;
    if (!is_first && since_start() + expected_s > options_.seconds) {
      report_.left_out.push_back({what, fmt::format("it would take about {:.0f} s", expected_s)});
      return;
    }
    out_ << what << ": about " << output::duration_words(expected_s) << std::endl;
    try {
      {
        const Busy busy("measuring", out_);
        to.push_back(frames.measure(wish));
      }
      out_ << fmt::format("{}: {:.1f} ms a frame", what, to.back().ms) << std::endl;
    } catch (const render::DeviceLost&) {
      throw;
    } catch (const Error& error) {  // it is too large for the device
      report_.left_out.push_back({what, error.what()});
    }
  }

  void measure_set() {
    if (!frame_ || options_.stop.stop_requested()) return;
    if (since_start() > options_.seconds) {
      report_.left_out.push_back({options_.set_or_session->string(), "there is no time left"});
      return;
    }
    timing::TimedFrame& frame = *frame_;
    const set::Set& set = frame.set();
    const scene::Scene scene = scene::load_scene(set);
    timing::FrameSettings settings;
    settings.estimation = set.estimation;
    settings.lighting = set.lighting;
    settings.lens = frame.calibration().lens;
    settings.denoise = set.quality.denoise;
    timing::PathTimer timer(device_, frame, scene, settings, /*is_live=*/true);
    const PinholeIntrinsics& lens = frame.calibration().intrinsics;
    const double scale = set.quality.scale;
    report_.set = {.set = options_.set_or_session->string(),
                   .width = static_cast<int>(lens.width * scale),
                   .height = static_cast<int>(lens.height * scale),
                   .samples = set.quality.samples,
                   .ms = 1e3 * timer.live({.samples = set.quality.samples,
                                           .scale = scale,
                                           .denoise = set.quality.denoise}),
                   .fps = set.quality.fps,
                   .camera_fps = frame.take_fps()};
  }

  const BenchOptions& options_;
  std::ostream& out_;
  const Clock::time_point start_ = Clock::now();
  std::shared_ptr<render::Device> device_;
  std::optional<timing::TimedFrame> frame_;
  BenchReport report_{};
};

}  // namespace

BenchReport run_bench(const BenchOptions& options, std::ostream& out) {
  BenchReport report = Bench(options, out).run();
  out << "\n" << bench_table(report) << std::flush;
  if (options.json) session::replace_file(*options.json, bench_json(report));
  if (options.page) session::replace_file(*options.page, bench_page(report));
  return report;
}

}  // namespace previz::bench
