#include "daemon/core/check/check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include "daemon/core/check/check_model.hpp"
#include "daemon/core/check/check_tracking.hpp"
#include "daemon/core/check/light_judgement.hpp"
#include "daemon/core/lighting/check.hpp"
#include "daemon/core/output/check.hpp"
#include "daemon/core/pipeline/check.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/render/check.hpp"
#include "daemon/core/scene/check.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/tracking/check.hpp"
#include "drivers/error.hpp"

namespace previz::check {
namespace {

namespace fs = std::filesystem;

// `take_opened` becomes the take, if it is one.
set::CheckedSet open(const CheckOptions& options, set::Findings& findings,
                     std::optional<pipeline::Take>& take_opened) {
  set::CheckedSet checked;
  if (fs::is_directory(options.set_or_session)) {
    const auto& take =
        take_opened.emplace(pipeline::open_take(options.set_or_session, options.set_file));
    checked.set = take.set;
    checked.set.observer.calibration = take.observer;
    checked.set.light_camera.calibration = take.light;
    checked.has_track = !take.session.track.empty();
    checked.is_take = true;
    checked.exposure = pipeline::first_exposure(take);
    findings.remarks = take.session.missing;
    if (!take.light_stream) checked.set.light_camera.driver = set::no_driver;
    return checked;
  }
  checked.set = set::load_set(options.set_or_session);
  auto& observer = checked.set.observer;
  auto& light = checked.set.light_camera;
  const auto replayed = [&](const std::string& camera, const std::string& driver,
                            const fs::path& device) {
    if (driver != set::replay_driver || device.empty()) return session::SessionInfo{};
    if (!fs::exists(device)) {
      findings.remarks.push_back(camera + ".device: no such session: " + device.string());
      return session::SessionInfo{};
    }
    const auto session = session::open_session(device);
    if (camera == "observer") checked.has_track = !session.track.empty();
    return session.info;
  };
  const auto observer_session = replayed("observer", observer.driver, observer.device);
  const auto light_session = replayed("light_camera", light.driver, light.device);
  if (!observer.calibration) observer.calibration = observer_session.observer;
  if (!light.calibration) light.calibration = light_session.light;
  checked.exposure = set::stated_exposure(checked.set);
  return checked;
}

int refuse(const std::vector<std::string>& problems, std::ostream& out) {
  std::string all;
  for (const auto& problem : problems) all += problem + '\n';
  const auto count = static_cast<std::uint64_t>(std::ranges::count(all, '\n'));
  out << all << set::plural(count, "problem") << '\n';
  return 1;
}

void describe(const set::CheckedSet& checked, const scene::Scene& scene, std::ostream& out) {
  const set::Set& set = checked.set;
  set::describe_cameras(set, out);
  tracking::describe(set.tracking, out);
  scene::describe_objects(set, scene, out);
  lighting::describe(set, out);
  scene::describe_lamps(checked, scene, out);
  set::describe_estimator(set, out);
  if (!checked.is_take) output::describe(set, out);
  render::describe(set, scene, out);
  render::describe_computer(out);
}

// Says how bright the model comes out beside the pictures, or why nobody knows.
void describe_light(const pipeline::Take& take, const scene::Scene& scene, set::Findings& findings,
                    std::ostream& out) {
  try {
    const auto device =
        render::open_device(render::options_for({}, take.set.quality.hardware_rays));
    const auto figure = light_of_take(take, scene, device);
    if (!figure) return;
    out << fmt::format(
        "\nlight: the model is {:.2f} {:.2f} {:.2f} times as bright as the picture "
        "(red, green, blue)\n",
        figure->ratio.r, figure->ratio.g, figure->ratio.b);
    if (const std::string remark = pipeline::light_remark(*figure); !remark.empty())
      findings.remarks.push_back("light: " + remark);
  } catch (const Error& error) {
    findings.remarks.push_back(std::string("the light was not compared with the pictures: ") +
                               error.what());
  }
}

}  // namespace

int check_set(const CheckOptions& options, std::ostream& out) {
  if (options.set_file && !fs::is_directory(options.set_or_session))
    throw Error(options.set_or_session.string() +
                ": is not a session; --set names the set file to check a session with");
  set::Findings findings;
  set::CheckedSet checked;
  std::optional<pipeline::Take> take;
  findings.attempt([&] { checked = open(options, findings, take); });
  if (!findings.problems.empty()) return refuse(findings.problems, out);

  const std::optional<scene::Scene> scene = scene::check(checked, findings);
  lighting::check(checked, findings);
  pipeline::check(checked, findings);
  set::check_cameras(checked, findings);
  tracking::check(checked, findings);
  output::check(checked, findings);
  if (!findings.problems.empty()) return refuse(findings.problems, out);

  set::remark_on_cameras(checked, findings);
  scene::remark_on(*scene, checked, findings);
  std::ostringstream details;
  describe(checked, *scene, details);
  if (take) {
    const fit::Figure figure = fit_of_model(*take, *scene);
    describe_fit(figure, take->set, details);
    remark_on_fit(figure, take->set, findings);
    remark_on_tracking(*take, findings);
    describe_light(*take, *scene, findings, details);
  }
  out << checked.set.name << " ("
      << (checked.is_take && !options.set_file ? "the set recorded with the take"
                                               : checked.set.file.string())
      << ") is valid\n";
  if (!findings.remarks.empty()) out << "\nworth checking\n";
  for (const std::string& remark : findings.remarks) out << "  " << remark << '\n';
  out << details.str();
  return 0;
}

}  // namespace previz::check
