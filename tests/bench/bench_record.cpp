// What a recording keeps: pictures as a camera's at its rate, from replay through the recorder onto
// a disk, and each that is not kept by its cause. Prints a row of a table.
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "daemon/core/output/recorder.hpp"
#include "daemon/core/session/replay_camera.hpp"
#include "daemon/core/session/session.hpp"
#include "drivers/error.hpp"
#include "tests/bench/camera_pictures.hpp"
#include "tests/bench/measure.hpp"
#include "tests/bench/program.hpp"

namespace previz::bench {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct Options {
  fs::path folder;  // takes are recorded in a folder of it that is removed again
  PixelFormat format = PixelFormat::yuv422p8;
  session::VideoCodec codec = session::VideoCodec::ffv1;
  int width = 1920, height = 1080;
  double rate_hz = 60, seconds = 60;
  double reserve_mb = 500;

  std::uint64_t frames() const { return static_cast<std::uint64_t>(rate_hz * seconds); }
};

const std::map<std::string, PixelFormat> formats = {{"yuv422p8", PixelFormat::yuv422p8},
                                                    {"gray8", PixelFormat::gray8}};
const std::map<std::string, session::VideoCodec> codecs = {{"ffv1", session::VideoCodec::ffv1},
                                                           {"raw", session::VideoCodec::raw}};

double seconds_since(Clock::time_point then) {
  return std::chrono::duration<double>(Clock::now() - then).count();
}

// A folder that goes with its content.
struct Folder {
  Folder(const fs::path& parent, const char* purpose)
      : path(parent / ("bench_record_" + std::to_string(getpid()) + "_" + purpose)) {
    fs::create_directories(path);
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  const fs::path path;
};

// A session of a few pictures, to be replayed again and again, that costs little to read.
void write_source(const Options& options, const fs::path& folder) {
  constexpr int pictures = 16;
  const auto frames = camera_pictures("config/demo/session", options.format, options.width,
                                      options.height, pictures);
  session::SessionWriter writer(folder, {}, std::chrono::hours(1), session::VideoCodec::raw);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Frame frame = *frames[i];
    frame.sequence = i;
    frame.timestamp_ns = static_cast<std::int64_t>(1e9 * static_cast<double>(i) / options.rate_hz);
    frame.arrival_ns = frame.timestamp_ns;
    writer.write(frame);
  }
  writer.close();
}

// What a recorder leaves out, by cause.
struct LeftOut {
  std::mutex mutex;
  std::map<std::string, std::uint64_t> causes;
};

output::RecorderOptions settings_of(const Options& options, const fs::path& folder,
                                    LeftOut& left_out) {
  output::RecorderOptions settings;
  settings.take.folders = {folder};
  settings.take.info.take = session::TakeInfo{0, "bench", "", options.rate_hz, "", false};
  settings.take.codec = options.codec;
  settings.preroll_s = 0;
  settings.queue_bytes = output::queue_bytes({});
  settings.reserve_bytes = static_cast<std::uint64_t>(1e6 * options.reserve_mb);
  settings.note = [](const report::Report& report) {
    std::fprintf(stderr, "%s\n", line_of(report).c_str());
  };
  settings.left_out = [&left_out](const std::string& cause, std::uint64_t pictures) {
    const std::lock_guard lock(left_out.mutex);
    left_out.causes[cause] += pictures;
  };
  return settings;
}

struct Outcome {
  std::uint64_t kept = 0;     // in the take
  std::uint64_t offered = 0;  // to the recorder
  std::uint64_t ended = 0;    // not offered, because the take had ended
  double most_behind_s = 0, most_behind_mb = 0;
  double finishing_s = 0;  // from the last frame's offer until it was on the disk
  double cpu_s = 0;
};

// Offers every frame of the replay until the take is long enough or has ended.
void offer(const Options& options, Camera& camera, output::Recorder& recorder, Outcome& outcome) {
  while (outcome.offered < options.frames()) {
    const CameraEvent event = camera.next(std::chrono::seconds(10));
    const auto* frame = std::get_if<FramePtr>(&event);
    if (!frame) throw Error("the replay delivers no frame");
    if (!recorder.status().recording) break;
    recorder.offer(*frame);
    ++outcome.offered;
    const output::Backlog backlog = recorder.status().backlog;
    outcome.most_behind_s = std::max(outcome.most_behind_s, backlog.seconds);
    outcome.most_behind_mb =
        std::max(outcome.most_behind_mb, 1e-6 * static_cast<double>(backlog.bytes));
  }
  outcome.ended = options.frames() - outcome.offered;
}

Outcome record(const Options& options, const fs::path& source, const fs::path& folder,
               LeftOut& left_out) {
  Outcome outcome;
  ReplayOptions replay;
  replay.loop = true;
  const auto camera = open_replay(source, "observer", replay);
  output::Recorder recorder(settings_of(options, folder, left_out));
  const double cpu = cpu_seconds();
  recorder.start();
  camera->start();
  offer(options, *camera, recorder, outcome);
  const auto offered = Clock::now();
  recorder.stop();
  recorder.finish();
  outcome.finishing_s = seconds_since(offered);
  outcome.cpu_s = cpu_seconds() - cpu;
  session::Session take = session::open_session(recorder.status().directory);
  if (const auto stream = session::open_stream(take, "observer"))
    outcome.kept = stream->records().size();
  return outcome;
}

void print(const Options& options, const Outcome& outcome, const LeftOut& left_out) {
  std::string causes;
  for (const auto& [cause, pictures] : left_out.causes)
    causes += (causes.empty() ? "" : ", ") + cause + ' ' + std::to_string(pictures);
  if (outcome.ended > 0)
    causes += (causes.empty() ? "" : ", ") + std::string("after the take's end ") +
              std::to_string(outcome.ended);
  std::printf("| %s %dx%d at %g | %s | %s | %llu of %llu | %s | %.2f, %.0f | %.1f | %.1f |\n",
              to_string(options.format), options.width, options.height, options.rate_hz,
              options.codec == session::VideoCodec::raw ? "raw" : "ffv1", options.folder.c_str(),
              static_cast<unsigned long long>(outcome.kept),
              static_cast<unsigned long long>(options.frames()),
              causes.empty() ? "none" : causes.c_str(), outcome.most_behind_s,
              outcome.most_behind_mb, outcome.finishing_s,
              1e3 * outcome.cpu_s / static_cast<double>(options.frames()));
}

void run(const Options& options) {
  const Folder source("/dev/shm", "source"), takes(options.folder, "takes");
  write_source(options, source.path);
  LeftOut left_out;
  const Outcome outcome = record(options, source.path, takes.path, left_out);
  print(options, outcome, left_out);
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("What a recording keeps of a camera's pictures");
  app.add_option("--folder", options.folder, "A folder on the disk of takes")->required();
  app.add_option("--format", options.format, "Pixel format")
      ->transform(CLI::CheckedTransformer(previz::bench::formats));
  app.add_option("--codec", options.codec, "Form of the pictures")
      ->transform(CLI::CheckedTransformer(previz::bench::codecs));
  app.add_option("--width", options.width);
  app.add_option("--height", options.height);
  app.add_option("--rate", options.rate_hz, "Pictures a second");
  app.add_option("--seconds", options.seconds, "Length of the take");
  app.add_option("--reserve-mb", options.reserve_mb, "A take ends before less than this is free");
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(options); });
}
