// Renders the truth frames of ground truth sets as `previz render` would, or plays their sequences
// as live would show them, and says how far off they are. tests/truth/run builds and calls it.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <glm/geometric.hpp>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "daemon/core/output/png.hpp"
#include "drivers/error.hpp"
#include "tests/truth/compare.hpp"
#include "tests/truth/comparison_sheet.hpp"
#include "tests/truth/live_play.hpp"
#include "tests/truth/made_phantom.hpp"
#include "tests/truth/truth_render.hpp"
#include "tests/truth/truth_set.hpp"
#include "tests/truth/truth_take.hpp"
#include "tests/truth/untagged.hpp"

namespace previz::truth {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Arguments {
  std::vector<fs::path> sets;
  TakeOptions take;
  RenderSettings render;
  fs::path out;
  std::optional<std::string> bounds;
  std::vector<int> frames;  // empty: every truth frame
  double expose = 1;        // how many times as long the camera exposes
  bool live = false, history = true;
  double scale = 1;
  int still = 0;  // frames with the camera at rest; 0: it moves as the set says
  std::optional<int> samples;
  bool made = false;  // the phantom is made of the set's own pictures
  fs::path phantom;   // a file in place of the set's own; empty: that
};

struct JudgedFrame {
  Measures measures;
  post::FinishedFrame record;
  std::vector<std::string> violations;
  std::optional<Chance> chance;
  std::optional<UntaggedMeasures> untagged;
};

// A set with tags may be played without them, to look at the pictures.
TruthFrame truth_of(const TruthSet& set, int frame, const Arguments& arguments) {
  return arguments.take.hides_tags && has_untagged(set, frame) ? load_untagged_frame(set, frame)
                                                               : load_truth_frame(set, frame);
}

JudgedFrame judge_frame(const TruthSet& set, int frame, const Arguments& arguments,
                        const fs::path& directory) {
  RenderedFrame rendered = arguments.render.reference
                               ? trace_truth_frame(set, frame, arguments.render.samples)
                               : render_truth_frame(set, frame, arguments.render, directory);
  JudgedFrame out;
  out.record = std::move(rendered.record);
  out.chance = rendered.chance;
  EstimatedFrame estimate = std::move(rendered.estimate);

  const bool without_tags = arguments.take.hides_tags;
  const TruthFrame truth = truth_of(set, frame, arguments);
  if (without_tags) out.untagged = compare_untagged(set, frame, estimate.composite);
  if (arguments.render.denoise) estimate = as_composited(truth.plate, std::move(estimate));
  out.measures = compare(truth, estimate);
  output::write_png(directory / (frame_name(frame) + "_compare.png"),
                    comparison_sheet(truth, estimate));
  if (arguments.bounds) out.violations = violations(out.measures, bounds_named(*arguments.bounds));
  if (out.untagged && arguments.bounds) {
    // The mask's bounds are of virtual objects: what is under a tag goes beyond its paper.
    std::erase_if(out.violations, [](const std::string& v) { return v.starts_with("e_mask"); });
    for (std::string& line : violations(*out.untagged)) out.violations.push_back(std::move(line));
  }
  return out;
}

ordered_json to_json(const TruthSet& set, int frame, const JudgedFrame& judged) {
  const Measures& m = judged.measures;
  const auto optional = [](const std::optional<double>& value) {
    return value ? ordered_json(*value) : ordered_json(nullptr);
  };
  ordered_json json;
  json["e_diff"] = m.e_diff;
  json["e_virtual"] = m.e_virtual;
  json["e_mask"] = m.e_mask;
  json["psnr"] = m.psnr;
  json["ssim"] = m.ssim;
  json["noise_diff"] = optional(m.noise_diff);
  json["noise_virtual"] = optional(m.noise_virtual);
  json["e_mask_edge"] = m.e_mask_edge;
  json["e_edge"] = m.e_edge;
  json["e_real"] = m.e_real;
  json["bias_diff"] = m.bias_diff;
  json["bias_virtual"] = m.bias_virtual;
  json["bias_real"] = m.bias_real;
  json["diff_blocks"] = m.diff_blocks;
  json["virtual_blocks"] = m.virtual_blocks;
  json["edge_blocks"] = m.edge_blocks;
  if (judged.untagged) {
    json["e_tags"] = judged.untagged->e_tags;
    json["outline"] = judged.untagged->outline;
  }
  json["samples"] = judged.record.samples;
  json["seconds"] = judged.record.render_s;
  json["dropped_samples"] =
      judged.record.counters.dropped_not_finite + judged.record.counters.dropped_negative;
  if (judged.record.status == post::FrameStatus::untouched)
    json["untouched"] = judged.record.reason;
  if (judged.record.pose) {
    const glm::dmat4& pose = judged.record.pose->world_from_camera;
    const glm::dmat4& truth = observer_frame(set, frame).world_from_camera;
    const glm::dmat3 turned = glm::transpose(glm::dmat3(truth)) * glm::dmat3(pose);
    const glm::dvec3 axis(turned[1][2] - turned[2][1], turned[2][0] - turned[0][2],
                          turned[0][1] - turned[1][0]);
    json["pose_error_m"] = glm::length(glm::dvec3(pose[3] - truth[3]));
    json["pose_error_rad"] = std::asin(std::min(1.0, glm::length(axis) / 2));
  }
  if (!judged.violations.empty()) json["violations"] = judged.violations;
  return json;
}

void print_header() {
  std::printf("%-12s %5s  %7s %7s %7s %7s %8s %8s %6s %7s  %7s %7s %7s\n", "set", "frame", "e_diff",
              "noise", "e_virt", "noise", "e_mask", "m_edge", "psnr", "ssim", "e_edge", "e_real",
              "seconds");
}

void print_row(const std::string& set, int frame, const JudgedFrame& judged) {
  const Measures& m = judged.measures;
  std::printf("%-12s %5s  %7.4f %7.4f %7.4f %7.4f %8.5f %8.5f %6.2f %7.4f  %7.4f %7.4f %7.1f\n",
              set.c_str(), frame_name(frame).c_str(), m.e_diff, m.noise_diff.value_or(0),
              m.e_virtual, m.noise_virtual.value_or(0), m.e_mask, m.e_mask_edge, m.psnr, m.ssim,
              m.e_edge, m.e_real, judged.record.render_s);
  if (!judged.record.reason.empty()) std::printf("    %s\n", judged.record.reason.c_str());
  // The mean of two halves is off by a half of what they are off each other.
  if (judged.chance)
    std::printf("    by chance: e_diff %.4f, e_virt %.4f; biases: diff %+.5f, virt %+.5f\n",
                judged.chance->e_diff / std::sqrt(2), judged.chance->e_virtual / std::sqrt(2),
                m.bias_diff, m.bias_virtual);
  if (judged.untagged)
    std::printf("    hidden tags: e_tags %.4f over %d pixels of %d tags; outline at most %.4f\n",
                judged.untagged->e_tags, judged.untagged->pixels, judged.untagged->tags,
                judged.untagged->outline);
  for (const std::string& line : judged.violations) std::printf("    BOUND %s\n", line.c_str());
  std::fflush(stdout);
}

void write_metrics(const ordered_json& metrics, const fs::path& directory) {
  std::ofstream file(directory / "metrics.json");
  file << metrics.dump(2) << std::endl;
  if (!file) throw Error((directory / "metrics.json").string() + ": cannot be written");
}

// Plays the set's sequence from its first frame to the last of `frames`, and judges what is shown.
ordered_json play(const TruthSet& set, const std::vector<int>& frames, const Arguments& arguments,
                  const fs::path& directory) {
  LiveSettings settings;
  settings.samples = arguments.samples.value_or(1);
  settings.accumulates = arguments.history;
  settings.device = arguments.render.device;
  std::map<std::uint64_t, int> truths;
  for (const int frame : frames) truths[session_index(set, frame)] = frame;
  settings.last = truths.rbegin()->first;
  settings.still = arguments.still;
  settings.scale = arguments.scale;

  ordered_json metrics;
  metrics["frames"] = ordered_json::object();
  std::optional<Flicker> flicker;
  double square = 0, seconds = 0;
  int count = 0, judged_frames = 0;
  const auto begin = [&](const scene::Scene& scene, const ObserverCalibration& calibration) {
    flicker.emplace(scene, calibration);
  };
  play_live(directory, settings, begin, [&](const LiveFrame& shown) {
    flicker->add(shown);
    seconds += shown.seconds;
    ++count;
    const auto found = truths.find(shown.index);
    if (found == truths.end() || !shown.is_last) return;
    const int frame = found->second;
    const TruthFrame truth = truth_of(set, frame, arguments);
    const EstimatedFrame estimate = as_shown(truth, shown.picture);
    JudgedFrame judged;
    judged.measures = compare(truth, estimate);
    judged.record.samples = settings.samples;
    judged.record.render_s = shown.seconds;
    output::write_png(directory / (frame_name(frame) + ".png"), shown.picture);
    output::write_png(directory / (frame_name(frame) + "_compare.png"),
                      comparison_sheet(truth, estimate));
    print_row(set.name, frame, judged);
    metrics["frames"][frame_name(frame)] = to_json(set, frame, judged);
    square += std::pow(rms_of_difference(truth), 2);
    ++judged_frames;
  });
  const double rms = std::sqrt(square / std::max(judged_frames, 1));
  metrics["flicker"] = rms > 0 ? flicker->rms() / rms : 0.0;
  metrics["seconds"] = seconds;
  metrics["samples"] = settings.samples;
  metrics["history"] = settings.accumulates;
  std::printf("    flicker %.4f, %.2f s a frame\n", metrics["flicker"].get<double>(),
              seconds / std::max(count, 1));
  return metrics;
}

// True where every bound holds.
bool run_set(const fs::path& path, const Arguments& arguments) {
  TruthSet set = load_truth_set(path);
  for (const std::string& note : set.notes) std::cerr << "note: " << note << std::endl;
  std::vector<int> frames = arguments.frames.empty() ? set.truth_frames : arguments.frames;
  for (const int frame : frames) {
    if (std::find(set.truth_frames.begin(), set.truth_frames.end(), frame) ==
        set.truth_frames.end()) {
      throw Error(path.string() + ": has no truth of frame " + std::to_string(frame));
    }
  }
  const fs::path directory = arguments.out / set.name;
  fs::remove_all(directory / "session");
  fs::remove_all(directory / "render");
  fs::create_directories(directory);
  if (arguments.expose != 1) expose_longer(set, arguments.expose, directory / "plates");
  if (!arguments.phantom.empty()) set.phantom = arguments.phantom;
  write_take(set, arguments.take, directory / "session");
  if (arguments.made) {
    set.phantom = make_phantom(set, directory, arguments.render.device, std::cout);
    fs::remove_all(directory / "session");
    write_take(set, arguments.take, directory / "session");
  }

  const auto add_take = [&](ordered_json& metrics) {
    metrics["light"] = arguments.take.light == LightFrom::truth ? "truth" : "captured";
    metrics["phantom"] = arguments.made              ? "made"
                         : arguments.phantom.empty() ? "truth"
                                                     : arguments.phantom.filename().string();
    metrics["pose"] = arguments.take.pose == PoseFrom::truth ? "truth" : "tracked";
  };
  if (arguments.live) {
    ordered_json metrics = play(set, frames, arguments, directory);
    add_take(metrics);
    write_metrics(metrics, directory);
    return true;
  }
  ordered_json metrics;
  metrics["frames"] = ordered_json::object();
  double seconds = 0;
  bool held = true;
  for (const int frame : frames) {
    if (arguments.take.hides_tags && !has_untagged(set, frame))
      throw Error(path.string() + ": has no truth without tags of frame " + std::to_string(frame));
    const JudgedFrame judged = judge_frame(set, frame, arguments, directory);
    print_row(set.name, frame, judged);
    metrics["frames"][frame_name(frame)] = to_json(set, frame, judged);
    seconds += judged.record.render_s;
    held = held && judged.violations.empty();
  }
  metrics["seconds"] = seconds;
  metrics["samples"] = arguments.render.samples;
  add_take(metrics);
  write_metrics(metrics, directory);
  return held;
}

}  // namespace
}  // namespace previz::truth

int main(int argc, char** argv) {
  using namespace previz::truth;
  Arguments arguments;
  CLI::App app(
      "Renders the truth frames of ground truth sets and compares. Exit status: 0 it ran "
      "(and every bound held, with --bounds), 1 a bound did not hold, 2 it could not run.");
  app.name("tests/truth/run");
  app.add_option("SETDIR", arguments.sets, "directories in the format of README.md")->required();
  const std::map<std::string, LightFrom> lights{{"truth", LightFrom::truth},
                                                {"captured", LightFrom::captured}};
  const std::map<std::string, PoseFrom> poses{{"truth", PoseFrom::truth},
                                              {"tracked", PoseFrom::tracked}};
  app.add_option("--light", arguments.take.light, "truth: env.exr; captured: the fisheye frames")
      ->transform(CLI::Transformer(lights, CLI::ignore_case))
      ->type_name("truth|captured");
  app.add_option("--pose", arguments.take.pose, "truth: the set's poses; tracked: by its tags")
      ->transform(CLI::Transformer(poses, CLI::ignore_case))
      ->type_name("truth|tracked");
  app.add_option_function<std::string>(
         "--phantom",
         [&](const std::string& from) {
           arguments.made = from == "made";
           if (from != "made" && from != "truth") arguments.phantom = from;
         },
         "truth: the set's own; made: by previz model from marks in its pictures; or a .glb file "
         "in place of the set's own")
      ->check(CLI::IsMember({"truth", "made"}) | CLI::ExistingFile);
  app.add_option("--spp", arguments.samples, "samples per pixel [256; with --live 1]")
      ->check(CLI::Range(1, 1000000));
  CLI::Option* const live =
      app.add_flag("--live", arguments.live,
                   "play the sequence from its first frame as live would show it, and judge the "
                   "pictures at the truth frames, denoised");
  app.add_flag("--hide-tags", arguments.take.hides_tags,
               "hide the printed tags, compare with the truth without them, and judge that alone");
  app.add_flag("!--no-history", arguments.history, "every frame stands alone")->needs(live);
  app.add_option("--still", arguments.still,
                 "with --live, show the last of the frames so many times, the camera at rest")
      ->needs(live)
      ->check(CLI::Range(1, 10000));
  app.add_option("--scale", arguments.scale,
                 "with --live, render so much smaller than the pictures are [1]")
      ->needs(live)
      ->check(CLI::Range(0.01, 1.0));
  app.add_flag("--adaptive", arguments.render.adaptive,
               "so many on average, where they bring most");
  app.add_flag("--denoise", arguments.render.denoise, "take noise out of the composite");
  app.add_option("--neighbours", arguments.render.neighbours,
                 "with --denoise, average with this many frames on each side [0]")
      ->check(CLI::Range(0, 4));
  app.add_flag("--reference", arguments.render.reference, "by the reference CPU tracer")
      ->excludes(live);
  app.add_option("--out", arguments.out, "directory for the pictures and figures")->required();
  app.add_option("--bounds", arguments.bounds, "judge by this row of bounds")
      ->check(CLI::IsMember({"paired", "full", "captured"}));
  app.add_option("--expose", arguments.expose,
                 "expose the plate this many times as long as the set did, and clip it [1]")
      ->check(CLI::Range(1.0, 1000.0));
  app.add_option("--frames", arguments.frames, "only these truth frames, as 0,12 [all]")
      ->delimiter(',');
  app.add_option("--lighting", arguments.take.lighting,
                 "a line for the set file's [lighting], as 'mode = \"sources\"'; repeatable")
      ->allow_extra_args(false);
  app.add_option("--estimator", arguments.take.estimator,
                 "a line for the set file's [estimator], as 'caustics = \"traced\"'; repeatable")
      ->allow_extra_args(false);
  app.add_option("--device", arguments.render.device, "Vulkan device by a part of its name");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  arguments.render.samples = arguments.samples.value_or(arguments.render.samples);
  try {
    print_header();
    bool held = true;
    for (const auto& set : arguments.sets) held = run_set(set, arguments) && held;
    return held ? 0 : 1;
  } catch (const std::exception& e) {
    std::cerr << "truth runner: " << e.what() << std::endl;
    return 2;
  }
}
