#include "daemon/tools/trade/trade.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <ostream>

#include "daemon/core/scene/load.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/problems.hpp"
#include "daemon/core/timing/frame.hpp"
#include "daemon/tools/trade/cache.hpp"
#include "daemon/tools/trade/page.hpp"
#include "daemon/tools/trade/sweep.hpp"
#include "drivers/error.hpp"

namespace previz::trade {
namespace {

namespace fs = std::filesystem;

// With so many times the samples of the best row, the reference's error is a sixteenth of that
// row's.
constexpr int reference_over_most = 256;
constexpr int most_samples = 1'000'000;

// Checks the options before anything is rendered.
TradeOptions checked(TradeOptions options) {
  if (!(options.scale > 0 && options.scale <= 1))
    throw Error("--scale " + std::to_string(options.scale) + ": must be above 0 and at most 1");
  const auto check_positive = [](const char* name, const std::optional<double>& value) {
    if (value && !(*value > 0 && std::isfinite(*value)))
      throw Error(std::string(name) + " " + std::to_string(*value) + ": must be above 0");
  };
  check_positive("--fps", options.fps);
  check_positive("--error", options.error);
  check_positive("--minutes", options.minutes);
  if (options.rounds < 1)
    throw Error("--rounds " + std::to_string(options.rounds) + ": must be at least 1");
  if (options.samples.empty()) throw Error("--samples: is empty; give at least one number");
  std::ranges::sort(options.samples);
  options.samples.erase(std::unique(options.samples.begin(), options.samples.end()),
                        options.samples.end());
  for (const int samples : options.samples)
    if (samples < 1 || samples > most_samples)
      throw Error("--samples " + std::to_string(samples) + ": must be from 1 to " +
                  std::to_string(most_samples));
  if (!options.reference_samples)
    options.reference_samples = reference_over_most * options.samples.back();
  if (*options.reference_samples < least_reference_samples)
    throw Error("--reference-samples " + std::to_string(*options.reference_samples) +
                ": must be at least " + std::to_string(least_reference_samples) +
                ", as errors are measured against it");
  return options;
}

// The text of an answer's file, as it is also printed on the page.
std::string answer_file(const TradeReport& report, const TradeAnswer& answer) {
  return "# " + set::printable(report.set) + ", " + answer.use + ": " + answer.words +
         ".\n# Found by `previz trade` on " + report.device +
         ". It overrides the set file's keys with --with " + answer.file.filename().string() +
         "\n\n" + answer.toml;
}

// Returns what the last trade in the directory measured, if it was of the same.
TradeCache remembered(const TradeOptions& options, const fs::path& directory,
                      const std::string& key, std::ostream& out) {
  if (options.anew) return {};
  std::string why_not;
  TradeCache cache = load_cache(directory, key, why_not);
  if (!why_not.empty())
    out << (directory / "trade.json").string() << ": " << why_not << "; measuring everything again"
        << std::endl;
  else if (cache.reference.samples > 0)
    out << "continuing the last table in " << directory.string() << " (--anew: start over)"
        << std::endl;
  return cache;
}

fs::path made_directory(const fs::path& directory) {
  std::error_code code;
  fs::create_directories(directory, code);
  if (code || !fs::is_directory(directory))
    throw Error("--out " + directory.string() + ": is not a folder and cannot be created" +
                (code ? ": " + code.message() : ""));
  return directory;
}

}  // namespace

double parse_share(const std::string& text) {
  const bool is_percent = text.ends_with('%');
  const std::string digits = text.substr(0, text.size() - (is_percent ? 1 : 0));
  double value = 0;
  const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (digits.empty() || code != std::errc() || end != digits.data() + digits.size() ||
      !(value > 0 && std::isfinite(value)))
    throw Error("--error " + text + ": write a fraction above 0, as 2% or 0.02");
  return is_percent ? value / 100 : value;
}

TradeReport run_trade(const TradeOptions& given, std::ostream& out) {
  const TradeOptions options = checked(given);
  timing::TimedFrame frame(options.source, options.frame);
  const timing::FrameSource& source = options.source;
  if (!options.directory && !source.set_file && !source.any_paths &&
      fs::is_directory(source.set_or_session))
    pipeline::refuse_output_elsewhere(source.set_or_session, frame.set());
  const fs::path directory =
      made_directory(options.directory.value_or(frame.set().output.directory / "trade"));
  const scene::Scene scene = scene::load_scene(frame.set());
  for (const std::string& note : scene.notes) out << "scene: " << note << std::endl;
  const std::shared_ptr<render::Device> device =
      render::open_device(render::options_for(options.device, frame.set().quality.hardware_rays));
  const std::string key = memory_key(frame, scene, options.scale, render::facts_of(*device));
  TradeCache cache = remembered(options, directory, key, out);
  const auto save = [&](const TradeReport& report) {
    session::replace_file(directory / "trade.csv", trade_csv(report));
    session::replace_file(directory / "trade.html", trade_page(report));
    save_cache(directory, key, cache);
  };
  TradeReport report = Sweep(options, frame, scene, device, cache).run(out, save);
  if (report.reference.samples.empty()) return report;  // it was stopped before anything was known
  report.csv = directory / "trade.csv";
  report.page = directory / "trade.html";
  for (TradeAnswer& answer : report.answers) {
    const fs::path file = directory / (answer.use + ".toml");
    if (!answer.is_met) {
      fs::remove(file);  // an earlier one, of another question
      continue;
    }
    answer.file = file;
    session::replace_file(file, answer_file(report, answer));
  }
  save(report);
  return report;
}

}  // namespace previz::trade
