#include "tests/truth/made_phantom.hpp"

#include <fmt/ostream.h>

#include <algorithm>
#include <fstream>
#include <glm/geometric.hpp>
#include <regex>

#include "daemon/core/scene/load.hpp"
#include "daemon/tools/model/model.hpp"
#include "drivers/error.hpp"
#include "tests/support/content_of.hpp"
#include "tests/truth/truth_take.hpp"

namespace previz::truth {
namespace {

namespace fs = std::filesystem;

// The marks name pictures by the set's own numbers; the session counts those that are there.
std::string for_session(const std::string& text, const TruthSet& set) {
  static const std::regex name("\"(\\d{4})\\.png\"");
  std::string result;
  auto from = text.begin();
  for (std::sregex_iterator it(text.begin(), text.end(), name), end; it != end; ++it) {
    result.append(from, text.begin() + it->position());
    result += fmt::format("\"frame {}\"", session_index(set, std::stoi((*it)[1])));
    from = text.begin() + it->position() + it->length();
  }
  return result.append(from, text.end());
}

struct Thing {
  std::string name;
  std::vector<glm::dvec3> vertices;
};

std::vector<Thing> things_of(const fs::path& file) {
  set::Object object;
  object.file = file;
  object.presence = set::Presence::phantom;
  set::Set set;
  set.objects = {object};
  const scene::Scene scene = scene::load_scene(set);
  std::vector<Thing> things;
  for (const scene::Instance& instance : scene.instances) {
    Thing& thing = things.emplace_back();
    thing.name = instance.name;
    for (const glm::vec3& p : scene.meshes[instance.mesh].positions)
      thing.vertices.emplace_back(instance.world_from_object * glm::dvec4(p, 1));
  }
  return things;
}

// A plane's corners are where its margin ends: only what has a height is compared.
void report_corners(const TruthSet& set, const fs::path& made, std::ostream& out) {
  const std::vector<Thing> truth = things_of(set.phantom);
  for (const Thing& thing : things_of(made)) {
    double most = 0;
    glm::dvec3 low(1e9), high(-1e9);
    for (const glm::dvec3& at : thing.vertices) {
      low = glm::min(low, at);
      high = glm::max(high, at);
      double nearest = 1e9;
      for (const Thing& of_truth : truth)
        for (const glm::dvec3& q : of_truth.vertices)
          nearest = std::min(nearest, glm::distance(at, q));
      most = std::max(most, nearest);
    }
    if (high.z - low.z > 0.01)
      fmt::print(out, "    {}: corners at most {:.2f} mm off\n", thing.name, 1000 * most);
  }
}

}  // namespace

fs::path make_phantom(const TruthSet& set, const fs::path& directory, const std::string& device,
                      std::ostream& out) {
  const fs::path marks = fs::path(PREVIZ_TRUTH_PARTS) / (set.name + ".toml");
  if (!fs::exists(marks)) throw Error(marks.string() + ": no marks of this set");
  model::ModelOptions options;
  options.footage = directory / "session";
  options.parts_file = directory / "made.toml";
  options.device.name = device;
  std::ofstream(options.parts_file) << for_session(test::content_of(marks), set);
  model::make_model(options, out);
  fs::path made = directory / "made.glb";
  report_corners(set, made, out);
  return made;
}

}  // namespace previz::truth
