// Measures what the lines of the action `guides` cost for each shown picture, and one figure of how
// far the model is from it, on frames of a take and a headless screen.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/core/fit/figure.hpp"
#include "daemon/core/output/guide_painter.hpp"
#include "daemon/core/output/png.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/pipeline/track_stage.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/rig/guides.hpp"
#include "drivers/display_drivers.hpp"
#include "tests/bench/measure.hpp"
#include "tests/bench/program.hpp"

namespace previz::bench {
namespace {

struct Options {
  std::filesystem::path session, set, picture;
  std::string mode = "1920x1080";
};

// CPU ms, of each frame.
struct Spent {
  std::vector<double> lines, paint, show_plain, show_lines, figure, tiles, kilobytes;
};

void row(const char* what, const std::vector<double>& values, const char* unit) {
  std::printf("| %s | %.2f %s |\n", what, median(values), unit);
}

void print(double model_ms, const Spent& spent) {
  std::printf("| what | median |\n| --- | --- |\n");
  row("making the model, once", {model_ms}, "ms");
  row("computing the lines", spent.lines, "ms");
  row("drawing them as tiles", spent.paint, "ms");
  row("showing the picture alone", spent.show_plain, "ms");
  row("showing it with the tiles", spent.show_lines, "ms");
  row("tiles", spent.tiles, "");
  row("in them", spent.kilobytes, "kB");
  row("a figure", spent.figure, "ms");
}

void run(const Options& options) {
  const pipeline::Take take = pipeline::open_take(options.session, options.set, true);
  const scene::Scene scene = scene::load_scene(take.set);
  std::optional<rig::GuideModel> model;
  const double model_ms = time_of([&] { model.emplace(scene, take.set, take.observer); }).cpu_ms;
  const DisplayMode mode = parse_display_mode(options.mode).value();
  const auto display = display_driver("headless").open({.connector = {}, .mode = mode});
  const output::GuidePainter painter(mode.width, mode.height, DisplayScale::letterbox);
  pipeline::TrackStage track(take);
  Spent spent;
  fit::Parts things;
  std::size_t found = 0;
  for (std::size_t i = 0; i < take.observer_stream->records().size(); ++i) {
    pipeline::Shot shot;
    shot.index = i;
    shot.frame = take.observer_stream->read(i);
    track(shot);
    if (!shot.track.pose) continue;
    const PlatePtr plate = plate_of(shot);
    output::GuidePage page;
    std::vector<Overlay> tiles;
    spent.lines.push_back(
        time_of([&] {
          page = model->guides_of({shot.track.pose->world_from_camera, shot.scene, {}});
        }).cpu_ms);
    spent.paint.push_back(
        time_of([&] { tiles = painter.paint(page, plate->width, plate->height); }).cpu_ms);
    spent.tiles.push_back(double(tiles.size()));
    spent.kilobytes.push_back(0);
    for (const Overlay& tile : tiles) spent.kilobytes.back() += 1e-3 * double(tile.rgba.size());
    // Each picture is shown once, because its upload is a part of the work.
    (i % 2 == 0 ? spent.show_lines : spent.show_plain)
        .push_back(time_of([&] {
                     display->show({plate, i % 2 == 0 ? tiles : std::vector<Overlay>()});
                   }).cpu_ms);
    spent.figure.push_back(time_of([&] {
                             fit::Measurement measurement(model->real(), take.observer, things);
                             measurement.look(*shot.frame, shot.track.pose->world_from_camera);
                             found += measurement.figure().found;
                             things = measurement.parts();
                           }).cpu_ms);
  }
  if (found == 0) std::printf("no edge of light was found\n");
  print(model_ms, spent);
  if (!options.picture.empty()) output::write_png(options.picture, display->read_back());
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("CPU milliseconds of the lines over a picture");
  app.add_option("SESSION", options.session, "a take")->required();
  app.add_option("SET", options.set, "its set file")->required();
  app.add_option("--mode", options.mode, "of the screen");
  app.add_option("--picture", options.picture, "PNG of the last screen");
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(options); });
}
