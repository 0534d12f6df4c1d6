#include "daemon/core/lighting/check.hpp"

#include <ostream>

#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/set/names.hpp"

namespace previz::lighting {

void check(const set::CheckedSet& checked, set::Findings& findings) {
  if (!checked.set.lighting.environment) return;
  auto coarse = checked.set.lighting;
  coarse.resolution = 16;  // only the file is checked
  if (coarse.environment_rotation_rad == 0)
    findings.remarks.emplace_back(
        "lighting.environment is not turned, as if it had been taken on the set: previz calibrate "
        "light TAKE --rotation finds how it is to be turned, and calibrate balance how bright it "
        "is");
  findings.attempt([&] {
    for (const auto& note : load_environment(coarse).report.notes) findings.remarks.push_back(note);
  });
}

void describe(const set::Set& set, std::ostream& out) {
  const auto& lighting = set.lighting;
  out << "\nlight\n  environment: "
      << (lighting.environment                   ? "the file " + lighting.environment_as_written
          : lighting.from == set::LightFrom::set ? std::string("none")
          : lighting.from == set::LightFrom::recording ? std::string("as the session recorded it")
          : set.light_camera.driver == set::no_driver
              ? std::string("from the session's light camera, if it has one; this set has none")
              : set::words("from the light camera; outside its view: ",
                           set::name_of(lighting.unseen)))
      << '\n';
  if (lighting.mode == set::LightMode::sources)
    out << "    its lamps light the set; the rest is " << set::name_of(lighting.sources.residual)
        << '\n';
  if (lighting.mode == set::LightMode::hybrid)
    out << "    its lamps light the set, and the rest as a picture\n";
}

}  // namespace previz::lighting
