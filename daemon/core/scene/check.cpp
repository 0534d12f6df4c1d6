#include "daemon/core/scene/check.hpp"

#include <algorithm>
#include <numbers>
#include <ostream>
#include <set>
#include <string>
#include <vector>

#include "daemon/core/scene/lamp_strength.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/set/names.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {

using set::plural;
using set::words;

std::optional<Scene> check(const set::CheckedSet& checked, set::Findings& findings) {
  const set::Set& set = checked.set;
  try {
    return load_scene(set);
  } catch (const Error& whole) {
    const auto before = findings.problems.size();
    for (const auto& object : set.objects) {
      auto alone = set;
      alone.objects = {object};
      alone.surfaces.clear();  // clears the other objects' too
      findings.attempt([&] { load_scene(alone); });
    }
    if (findings.problems.size() == before)
      findings.problems.push_back(whole.what());  // too much only together
    return std::nullopt;
  }
}

namespace {

// Lists numbers as "0, 1 and 2".
std::string listed(const std::set<int>& ids) {
  std::string text;
  for (const int id : ids)
    text += (text.empty() ? "" : id == *ids.rbegin() ? " and " : ", ") + std::to_string(id);
  return text;
}

}  // namespace

std::vector<std::string> remarks_on_hidden_tags(const Scene& scene, const set::Set& set) {
  std::set<int> missing, bare;
  for (const set::Tag& tag : set.tracking.tags) missing.insert(tag.id);
  for (const set::Carrier& carrier : set.tracking.carriers)
    for (const set::Tag& tag : carrier.tags) missing.insert(tag.id);
  for (const Instance& instance : scene.instances)
    if (instance.tag == TagPart::printed) {
      missing.erase(instance.tag_id);
      bare.insert(instance.tag_id);
    }
  for (const Instance& instance : scene.instances)
    if (instance.tag == TagPart::under) bare.erase(instance.tag_id);
  std::vector<std::string> remarks;
  if (!missing.empty())
    remarks.push_back(
        "tags are hidden, but these are in no phantom and stay in the picture: " + listed(missing) +
        "; `previz model` makes a phantom of them, beside another one with "
        "--tags-only");
  if (!bare.empty())
    remarks.push_back(
        "tags are hidden, but no phantom has what is under these, so that their "
        "outlines may be seen: " +
        listed(bare) + "; `previz model` makes it, beside another phantom with --tags-only");
  return remarks;
}

void remark_on(const Scene& scene, const set::CheckedSet& checked, set::Findings& findings) {
  const set::Set& set = checked.set;
  if (set.hides_tags)
    for (const std::string& remark : remarks_on_hidden_tags(scene, set))
      findings.remarks.push_back(remark);
  for (const auto& note : scene.notes) findings.remarks.push_back(note);
  // What a radiance of 1 is to a live camera that exposes by itself, only its frames say.
  if (checked.exposure || !set.observer.is_live())
    for (const auto& remark : remarks_on_bright_lamps(scene, set, checked.exposure))
      findings.remarks.push_back(remark);
  const auto has = [&](set::Presence presence) {
    return std::ranges::find(set.objects, presence, &set::Object::presence) != set.objects.end();
  };
  const bool relit = std::ranges::any_of(scene.lights, &set::Light::is_relit);
  const bool hides = std::ranges::any_of(scene.instances, [&](const Instance& instance) {
    return instance.tag == TagPart::printed && set.hides_tags;
  });
  if (!has(set::Presence::virtual_object) && !has(set::Presence::removed) && !relit && !hides)
    findings.remarks.push_back(
        "nothing is virtual, removed or relit: the composite will equal the plate");
  else if (!has(set::Presence::phantom))
    findings.remarks.push_back(
        "no phantom: nothing real can catch shadows or hide a virtual object");
}

void describe_objects(const set::Set& set, const Scene& scene, std::ostream& out) {
  if (set.objects.empty()) return;
  std::vector<std::uint64_t> triangles(set.objects.size()), instances(set.objects.size());
  for (const auto& instance : scene.instances) {
    ++instances[instance.object];
    triangles[instance.object] += scene.meshes[instance.mesh].triangles.size();
  }
  out << "\nobjects\n";
  for (std::size_t i = 0; i < set.objects.size(); ++i) {
    const auto& object = set.objects[i];
    out << "  " << object.name << ": " << set::name_of(object.presence) << ", "
        << plural(triangles[i], "triangle") << " in " << plural(instances[i], "instance")
        << ", from " << object.file_as_written;
    if (!object.variant.empty()) out << ", variant \"" << set::one_line(object.variant) << '"';
    out << '\n';
    const Variants* variants = variants_of(scene, i);
    if (!variants) continue;
    out << "    its variants, for the buttons:";
    const char* separator = " ";
    for (const std::string& name : variants->names) {
      out << separator << '"' << set::one_line(name) << '"';
      separator = ", ";
    }
    out << '\n';
  }
}

void describe_lamps(const set::CheckedSet& checked, const Scene& scene, std::ostream& out) {
  const auto print = [&](const std::string& name, const std::string& kind, double mixed,
                         double real, const glm::dvec3& tint, const std::string& more) {
    const char* change = real == 0                          ? "added"
                         : mixed * tint == glm::dvec3(real) ? "as it is"
                         : mixed == 0                       ? "switched off"
                         : mixed < real                     ? "dimmed"
                         : mixed > real                     ? "brightened"
                                                            : "tinted";
    out << "  " << (name.empty() ? "(no name)" : name) << ": " << kind << ", " << change
        << words(", gain ", mixed, " in the composite, ", real, " on the real set");
    if (tint != glm::dvec3(1)) out << words(", tint ", tint.r, ' ', tint.g, ' ', tint.b);
    out << more << '\n';
  };
  for (std::size_t i = 0; i < scene.lights.size(); ++i) {
    const set::Light& light = scene.lights[i];
    std::string more;
    if (light.captured) more = "; subtracted from the environment light";
    more += light.measured ? ", which gives its brightness"
                           : "; " + strength_words(scene, i, checked.exposure);
    print(light.name, set::name_of(light.type), light.gain_mixed, light.gain_real, light.tint,
          more);
  }
  for (const auto& lamp : checked.set.captured_lamps)
    print(lamp.name,
          words("within ", lamp.cone_rad * 180 / std::numbers::pi,
                " degrees of its direction in the environment light"),
          lamp.gain_mixed, 1, lamp.tint, "; subtracted from it");
}

}  // namespace previz::scene
