#include "daemon/core/set/resolve.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>
#include <set>

#include "daemon/core/session/files.hpp"
#include "daemon/core/set/pose.hpp"
#include "drivers/button_drivers.hpp"
#include "drivers/calibration/read.hpp"
#include "drivers/display_drivers.hpp"
#include "drivers/error.hpp"

namespace previz::set {
namespace {

namespace fs = std::filesystem;

class Resolver {
 public:
  Resolver(Draft& draft, const fs::path& file, const Assets& assets, Origin origin,
           Problems& problems)
      : draft_(draft),
        set_(draft.set),
        folder_(file.parent_path()),
        assets_(assets),
        origin_(origin),
        problems_(problems) {
    set_.file = file;
  }

  void run() {
    if (set_.name.empty()) set_.name = set_.file.stem().string();
    observer();
    light_camera();
    tags();
    objects();
    surfaces();
    lights();
    captured_lamps();
    lighting();
    room();
    for (const auto& [table, step] : draft_.preview_steps) set_.quality.steps.push_back(step);
    buttons();
    contacts();
    display();
    recording();
    set_.output.directory = folder_at("output", "directory", set_.output.directory);
  }

 private:
  const Given& given(const std::string& table) {
    auto& given = draft_.given[table];
    given.path = table;
    return given;
  }

  void problem(const Given& table, const std::string& key, const std::string& what) {
    problems_.add(table.where(key), table.path + '.' + key, what);
  }

  fs::path located(const fs::path& as_written) const {
    return (folder_ / as_written).lexically_normal();
  }

  // Returns the path of a folder, without the slash that it may end in. No disk is asked.
  fs::path folder_at(const char* table, const char* key, const fs::path& as_written) {
    const fs::path folder = located(as_written);
    const std::string path = folder.string(), below = path + '/';
    if (below.starts_with("/proc/") || below.starts_with("/sys/"))
      problem(given(table), key, path + " holds no files of anybody; allowed: a folder on a disk");
    return folder.has_filename() || folder == folder.root_path() ? folder : folder.parent_path();
  }

  void recording() {
    set_.recording.directory = folder_at("recording", "directory", set_.recording.directory);
    auto& second = set_.recording.second_directory;
    if (second) second = folder_at("recording", "second_directory", *second);
    if (second == set_.recording.directory)
      problem(given("recording"), "second_directory",
              "is the folder of recording.directory; allowed: a folder on another disk");
  }

  // Returns the path of a file that must exist. An asset replaces the file that the set names.
  fs::path existing(const Given& table, const std::string& key, const fs::path& as_written) {
    if (!table.good(key)) return {};
    auto path = located(as_written);
    bool may_be_elsewhere = origin_ == Origin::crew || origin_ == Origin::trusted_session;
    for (const auto& [name, stand_in] : assets_) {
      if (name != as_written.string()) continue;
      path = located(stand_in);
      may_be_elsewhere |= origin_ == Origin::job;
    }
    const std::string whole = origin_ == Origin::job ? "job" : "take";
    std::error_code error;
    if (!may_be_elsewhere && !session::lies_within(folder_, path))
      problem(table, key,
              "lies outside the " + whole + "'s folder, and is not read; allowed: files of the " +
                  whole + ", or --any-paths for a " + whole + " that you trust");
    else if (!fs::is_regular_file(path, error))
      problem(table, key,
              "no such file: " + path.string() +
                  "; allowed: a file that exists, its path relative to the folder of this file");
    return path;
  }

  // Adds a problem for every key of `keys` that is given although `reason` excludes it.
  void exclude(const Given& table, std::initializer_list<const char*> keys,
               const std::string& reason) {
    for (const auto* key : keys)
      if (table.has(key)) problem(table, key, reason);
  }

  // Adds a problem if a part of a calibration is given without its intrinsics.
  void needs_intrinsics(const std::string& camera, const std::string& part) {
    const auto& table = given(camera + '.' + part);
    if (table.at && !given(camera + ".intrinsics").at)
      problems_.add(*table.at, table.path,
                    '[' + camera + ".intrinsics]" +
                        " is missing; a calibration given here replaces all of the session's");
  }

  void device(const std::string& table, const std::string& driver, std::string& device) {
    if (driver == no_driver)
      exclude(given(table), {"device"}, "driver \"none\" has no device; remove one of the two");
    if (driver == replay_driver && !device.empty()) device = located(device).string();
    const bool recorded = driver == replay_driver || driver == no_driver;
    if (!recorded && device.empty())
      problem(given(table), "device",
              "is missing for driver \"" + driver +
                  "\"; allowed: a name that `previzd devices` prints");
    const Given& camera = given(table + ".camera");
    if (recorded && camera.at)
      problems_.add(*camera.at, camera.path,
                    "cannot be used with driver \"" + driver + "\", which drives no camera");
    if (camera.has("width") != camera.has("height"))
      problem(camera, camera.has("width") ? "height" : "width",
              "is missing; width and height go together");
    if (camera.has("exposure_s") && camera.has("bracket_s"))
      problem(camera, "exposure_s", "conflicts with bracket_s; remove one of the two");
  }

  // Reports what is wrong with a calibration, and completes it.
  template <class CalibrationDraft>
  void check(const std::string& camera, CalibrationDraft& draft) {
    std::map<std::string, const Given*> tables;  // by key
    GivenKeys keys;
    for (const calibration::Key& key : calibration::keys(draft)) {
      const Given& table = *(tables[key.name] = &given(camera + '.' + key.table));
      if (table.has(key.name)) keys[key.name] = table.good(key.name);
    }
    for (const auto& [key, what] : calibration::check(draft, keys, calibration::Format::authored)) {
      const Given& table = *tables[key];
      if (table.at || table.path != "light_camera.pose") problem(table, key, what);
    }
  }

  void observer() {
    device("observer", set_.observer.driver, set_.observer.device);
    needs_intrinsics("observer", "lens");
    needs_intrinsics("observer", "response");
    needs_intrinsics("observer", "lens_fit");
    lens_fit();
    check("observer", draft_.observer);
    if (given("observer.intrinsics").at) set_.observer.calibration = draft_.observer.calibration;
  }

  void lens_fit() {
    constexpr std::size_t values = 9, triangle = values * (values + 1) / 2;
    const auto& table = given("observer.lens_fit");
    const LensFit& fit = set_.observer.lens_fit;
    if (table.good("values") && fit.values.size() != values)
      problem(table, "values", "has " + std::to_string(fit.values.size()) + " numbers; allowed: 9");
    if (!table.good("covariance_root")) return;
    bool is_root = fit.covariance_root.size() == triangle;
    for (std::size_t row = 0; is_root && row < values; ++row)
      is_root = fit.covariance_root[row * (row + 3) / 2] > 0;
    if (!is_root)
      problem(
          table, "covariance_root",
          "is not the root of a covariance; allowed: the 45 numbers of a lower triangle, row by "
          "row, whose diagonal is above 0, as `previz calibrate observer` prints them");
  }

  void light_camera() {
    device("light_camera", set_.light_camera.driver, set_.light_camera.device);
    needs_intrinsics("light_camera", "response");
    needs_intrinsics("light_camera", "pose");
    check("light_camera", draft_.light_camera);
    const auto& intrinsics = given("light_camera.intrinsics");
    if (!intrinsics.at) return;
    if (!given("light_camera.pose").at)
      problems_.add(*intrinsics.at, "light_camera.pose",
                    "is missing; a calibrated light camera needs its pose: "
                    "[light_camera.pose] with position_m, rotation_deg or world_from_camera");
    set_.light_camera.calibration = draft_.light_camera.calibration;
  }

  // Returns a tag's pose, which must be given in one of the two forms that every pose has.
  glm::dmat4 rigid(const TagDraft& draft) {
    GivenKeys keys;
    for (const auto& [name, key] : draft.given.keys) keys[name] = key.good;
    const auto all = faults(draft.pose, keys, "world_from_tag");
    for (const auto& [key, what] : all) problem(draft.given, key, what);
    return all.empty() ? rigid_transform(draft.pose) : glm::dmat4{1};
  }

  void tags() {
    std::map<int, Position> first;
    std::set<std::string> frames;  // carriers whose frame is that of a tag
    for (const auto& draft : draft_.tags) {
      const auto& table = draft.given;
      if (table.good("id")) {
        const auto [other, fresh] = first.emplace(draft.id, table.where("id"));
        if (!fresh)
          problem(table, "id",
                  "tag " + std::to_string(draft.id) + " is already on line " +
                      std::to_string(other->second.line) + "; allowed: each id once");
      }
      Tag tag{.id = draft.id, .size_m = draft.size.value_or(0)};
      if (table.has("corners_m")) {
        measured(draft, tag);
      } else {
        if (!table.has("size_m"))
          problem(table, "size_m",
                  "is missing; allowed: the outer edge of the black border in m, or corners_m");
        const bool is_frame = is_carrier_itself(draft);
        if (is_frame && !frames.insert(draft.carrier).second)
          problem(table, "carrier",
                  "another tag of " + codec::quote(draft.carrier) +
                      " already defines its frame; allowed: position_m relative to that tag");
        tag.world_from_tag = is_frame ? glm::dmat4{1} : rigid(draft);
      }
      (draft.carrier.empty() ? set_.tracking.tags : carrier(draft.carrier).tags).push_back(tag);
    }
  }

  // Returns whether a carried tag has no pose, so that its frame is the carrier's.
  static bool is_carrier_itself(const TagDraft& draft) {
    const auto& table = draft.given;
    return !draft.carrier.empty() && !table.has("position_m") && !table.has("rotation_deg") &&
           !table.has("world_from_tag");
  }

  Carrier& carrier(const std::string& name) {
    auto& carriers = set_.tracking.carriers;
    const auto found = std::ranges::find(carriers, name, &Carrier::name);
    return found != carriers.end() ? *found : carriers.emplace_back(Carrier{name, {}});
  }

  void carried(const Given& table, const std::string& by) {
    const auto& carriers = set_.tracking.carriers;
    if (by.empty() || std::ranges::find(carriers, by, &Carrier::name) != carriers.end()) return;
    std::vector<std::string> known;
    for (const Carrier& carrier : carriers) known.push_back(carrier.name);
    const std::string near = nearest(by, known);
    problem(table, "carrier",
            "no tag is on a carrier " + codec::quote(by) +
                (near.empty() ? "; allowed: the carrier of a [[tag]]"
                              : "; did you mean " + codec::quote(near) + "?"));
  }

  // Completes a tag that is given by its four corners.
  void measured(const TagDraft& draft, Tag& tag) {
    const auto& table = draft.given;
    exclude(table, {"position_m", "rotation_deg", "world_from_tag"},
            "conflicts with corners_m; allowed: one form of the pose");
    if (!table.good("corners_m")) return;
    const auto fit = fit_square(*draft.corners);
    const auto percent = [](double part) {
      return codec::print_number(std::round(part * 1000) / 10) + " %";
    };
    if (!fit || fit->error > square_tolerance) {
      problem(table, "corners_m",
              fit ? "is not a square: a corner is off by " + percent(fit->error) +
                        " of the side; allowed: at most " + percent(square_tolerance) +
                        ", in the order lower left, lower right, upper right, upper left"
                  : "has no area; allowed: lower left, lower right, upper right, upper left");
      return;
    }
    tag.world_from_tag = fit->world_from_tag;
    if (!table.good("size_m")) {
      tag.size_m = fit->size;
    } else if (std::abs(tag.size_m / fit->size - 1) > square_tolerance) {
      problem(table, "size_m",
              "conflicts with corners_m, whose side is " + codec::print_number(fit->size) +
                  " m; allowed: the same to within " + percent(square_tolerance) +
                  ", or remove it");
    }
  }

  void objects() {
    std::map<std::string, Position> first;
    for (auto& draft : draft_.objects) {
      const auto& table = draft.given;
      auto& object = draft.object;
      if (table.good("name")) {
        if (object.name.empty()) problem(table, "name", "is empty; allowed: text");
        const auto [other, fresh] = first.emplace(object.name, table.where("name"));
        if (!fresh)
          problem(table, "name",
                  codec::quote(object.name) + " is already on line " +
                      std::to_string(other->second.line) + "; allowed: each name once");
      }
      object.file_as_written = draft.file.string();
      object.file = existing(table, "file", draft.file);
      object.world_from_file = placed(draft);
      carried(table, object.carrier);
      set_.objects.push_back(object);
    }
  }

  void surfaces() {
    std::map<std::string, Position> first;
    for (const auto& draft : draft_.surfaces) {
      const auto& material = draft.surface.material;
      if (draft.given.good("material")) {
        const auto [other, fresh] = first.emplace(material, draft.given.where("material"));
        if (!fresh)
          problem(draft.given, "material",
                  codec::quote(material) + " is already on line " +
                      std::to_string(other->second.line) + "; allowed: each material once");
      }
      set_.surfaces.push_back(draft.surface);
    }
  }

  glm::dmat4 placed(const ObjectDraft& draft) {
    const auto& table = draft.given;
    if (!table.has("world_from_file"))
      return glm::scale(rigid_transform(draft.pose), glm::dvec3{draft.scale});
    exclude(table, {"position_m", "rotation_deg", "scale"},
            "conflicts with world_from_file; allowed: one of the two");
    if (!table.good("world_from_file")) return glm::dmat4{1};
    constexpr double flat = 1e-6;
    if (regularity(*draft.pose.matrix) < flat)
      problem(table, "world_from_file", "flattens the object; allowed: any invertible transform");
    return *draft.pose.matrix;
  }

  void lights() {
    std::map<std::string, Position> first;
    int number = 0;
    for (auto& draft : draft_.lights) {
      ++number;
      if (draft.light.name.empty()) draft.light.name = "light " + std::to_string(number);
      const char* key = draft.given.has("name") ? "name" : "type";
      if (draft.given.good(key)) {
        const auto [other, fresh] = first.emplace(draft.light.name, draft.given.where(key));
        if (!fresh)
          problem(draft.given, key,
                  codec::quote(draft.light.name) + " is already on line " +
                      std::to_string(other->second.line) + "; allowed: each name once");
      }
      captured(draft);
      if (draft.given.good("type")) light(draft.given, draft.light);
      carried(draft.given, draft.light.carrier);
      set_.lights.push_back(draft.light);
    }
  }

  // Decides whether a lamp is taken out of the light around the set.
  void captured(LightDraft& draft) {
    const auto& table = draft.given;
    Light& light = draft.light;
    const bool is_real = light.gain_real > 0 && light.carrier.empty();
    const bool is_filmed = set_.lighting.from != LightFrom::set && !draft_.environment;
    light.captured = draft.captured.value_or(is_real && is_filmed);
    if (light.captured && !is_real)
      problem(table, "captured",
              "is for real lamps that stay in place; allowed: true with "
              "gain_real above 0 and no carrier");
    if (!light.captured) exclude(table, {"cone_deg"}, "needs captured = true; remove it");
    light.measured = light.captured && !table.has("emission");
    const bool is_in_a_map = is_filmed || draft_.environment;
    if ((!light.captured || !is_in_a_map) && !table.has("emission"))
      problem(table, "emission",
              "is missing; allowed: 3 numbers, at least 0, like [10.0, 9.5, 8.0]");
  }

  void captured_lamps() {
    std::map<std::string, Position> first;
    for (auto& draft : draft_.captured_lamps) {
      const auto& table = draft.given;
      CapturedLamp& lamp = draft.lamp;
      if (table.good("name")) {
        if (lamp.name.empty()) problem(table, "name", "is empty; allowed: text");
        const auto [other, fresh] = first.emplace(lamp.name, table.where("name"));
        if (!fresh)
          problem(table, "name",
                  codec::quote(lamp.name) + " is already on line " +
                      std::to_string(other->second.line) + "; allowed: each name once");
        if (std::ranges::find(set_.lights, lamp.name, &Light::name) != set_.lights.end())
          problem(table, "name",
                  codec::quote(lamp.name) + " is also a [[light]]; allowed: each name once");
      }
      if (table.has("position_m"))
        exclude(table, {"direction"}, "conflicts with position_m; remove one of the two");
      else if (!table.has("direction"))
        problem(table, "direction", "is missing; allowed: 3 numbers, or position_m");
      if (table.good("direction")) {
        if (glm::length(lamp.direction) > 0)
          lamp.direction = glm::normalize(lamp.direction);
        else
          problem(table, "direction", "has zero length; allowed: any other vector");
      }
      if (set_.lighting.from == LightFrom::set && !draft_.environment && table.at)
        problems_.add(*table.at, table.path,
                      "conflicts with lighting.from = \"set\", which captures no light");
      set_.captured_lamps.push_back(lamp);
    }
  }

  void light(const Given& table, Light& light) {
    using enum LightType;
    struct Use {
      const char* key;
      std::vector<LightType> required, allowed;
    };
    static const Use uses[] = {
        {"position_m", {point, spot, rectangle, sphere}, {}},
        {"direction", {spot, directional, rectangle}, {}},
        {"up", {}, {rectangle}},
        {"width_m", {rectangle}, {}},
        {"height_m", {rectangle}, {}},
        {"radius_m", {sphere}, {}},
        {"angular_radius_deg", {}, {directional}},
        {"inner_cone_deg", {}, {spot}},
        {"outer_cone_deg", {}, {spot}},
    };
    const std::string type = std::string("a ") + name_of(light.type) + " light";
    for (const auto& [key, required, allowed] : uses) {
      const bool is_required = std::ranges::find(required, light.type) != required.end();
      const bool is_allowed = std::ranges::find(allowed, light.type) != allowed.end();
      if (is_required && !table.has(key)) problem(table, key, "is missing; " + type + " needs it");
      if (!is_required && !is_allowed)
        exclude(table, {key}, type + " does not have this; remove it");
    }
    if (table.good("direction")) {
      if (glm::length(light.direction) > 0)
        light.direction = glm::normalize(light.direction);
      else
        problem(table, "direction", "has zero length; allowed: any other vector");
    }
    if (light.type == rectangle && table.good("direction")) upright(table, light);
    if (light.type == spot && light.inner_cone_rad > light.outer_cone_rad)
      problem(table, "inner_cone_deg",
              "is wider than outer_cone_deg; allowed: at most that, " +
                  codec::print_number(light.outer_cone_rad * 180 / std::numbers::pi));
  }

  // Makes `up` a unit vector at right angles to the direction.
  void upright(const Given& table, Light& light) {
    if (!table.has("up") && std::abs(light.direction.y) > 0.99) light.up = {0, 0, 1};
    const auto across = light.up - glm::dot(light.up, light.direction) * light.direction;
    if (glm::length(across) > 1e-6 * glm::length(light.up))
      light.up = glm::normalize(across);
    else
      problem(table, "up", "is parallel to the light's direction; allowed: any that is not");
  }

  void buttons() {
    std::map<std::pair<std::string, PressKind>, Position> first;
    for (const auto& [table, button] : draft_.buttons) {
      if (table.good("name")) {
        if (button.name.empty()) problem(table, "name", "is empty; allowed: text");
        if (origin_ == Origin::crew) pressable(table, button.name);
        const auto [other, fresh] =
            first.emplace(std::pair(button.name, button.press), table.where("name"));
        if (!fresh)
          problem(table, "name",
                  std::string("a ") + name_of(button.press) + " press of " +
                      codec::quote(button.name) + " is already on line " +
                      std::to_string(other->second.line) + "; allowed: one action per press");
      }
      set_.buttons.push_back(button);
    }
  }

  // Refuses a name that no driver takes, since nobody would notice the typing error. The buttons of
  // a replayed session may have any name without a colon.
  void pressable(const Given& table, const std::string& name) {
    const bool may_be_recorded =
        set_.observer.driver == replay_driver && name.find(':') == std::string::npos;
    if (name.empty() || may_be_recorded) return;
    try {
      check_button_name(name);
    } catch (const Error& error) {
      problem(table, "name", error.what());
    }
  }

  void display() {
    const Display& display = set_.display;
    if (drives_connectors(display.driver)) return;
    const std::string no = "driver \"" + display.driver + "\" has no ";
    exclude(given("display"), {"connector"}, no + "connector; remove it");
    if (display.driver == no_driver) exclude(given("display"), {"mode"}, no + "mode; remove it");
  }

  // Refuses wiring that no button uses, since nobody would notice the typing error.
  void contacts() {
    std::map<std::string, Position> first;
    for (const auto& [table, contact] : draft_.contacts) {
      if (!table.good("name")) continue;
      const std::string quoted = codec::quote(contact.name);
      const auto [other, fresh] = first.emplace(contact.name, table.where("name"));
      const std::string& name = contact.name;  // clang 14 captures no structured binding
      const bool wires_a_button = std::ranges::any_of(set_.buttons, [&name](const Button& button) {
        return button.name == name || button.name.starts_with(name + ':');
      });
      if (!contact.name.starts_with("gpio:"))
        problem(table, "name",
                quoted + " is not a GPIO line; allowed: gpio:CHIP or gpio:CHIP:LINE");
      else if (!fresh)
        problem(table, "name",
                quoted + " is already on line " + std::to_string(other->second.line) +
                    "; allowed: each name once");
      else if (!wires_a_button)
        problem(table, "name",
                quoted +
                    " has no [[button]]; allowed: a button's name, or its part before the "
                    "last colon");
      set_.contacts.push_back(contact);
    }
  }

  void lighting() {
    const auto& table = given("lighting");
    auto& lighting = set_.lighting;
    if (draft_.environment) {
      lighting.environment_as_written = draft_.environment->string();
      lighting.environment = existing(table, "environment", *draft_.environment);
    }
    if (given("lighting.room").at)
      exclude(given("lighting.sources"), {"distance_m"},
              "conflicts with [lighting.room], whose walls hold the lamps; remove one of the two");
    if (lighting.from == LightFrom::recording) {
      exclude(table, {"environment"}, "conflicts with from = \"recording\"; remove one");
      if (lighting.mode != LightMode::sources)
        problem(table, table.has("mode") ? "mode" : "from",
                std::string("a recording has lamps but no light picture, so mode \"") +
                    name_of(lighting.mode) +
                    "\" is not available; allowed: mode = \"sources\", or from = \"camera\"");
    }
    if (table.good("resolution") && lighting.resolution != 0 &&
        !std::has_single_bit(static_cast<unsigned>(lighting.resolution)))
      problem(table, "resolution",
              std::to_string(lighting.resolution) +
                  " is not a power of two; allowed: 0 or 1, 2, 4 ... 4096");
    if (table.has("unseen") && !table.good("unseen")) return;
    if (lighting.unseen == UnseenRule::constant) {
      if (!table.has("unseen_radiance"))
        problem(table, "unseen_radiance",
                "is missing for unseen = \"constant\"; allowed: 3 numbers, at least 0");
      lighting.unseen_radiance = draft_.unseen_radiance.value_or(glm::dvec3{0});
    } else {
      exclude(table, {"unseen_radiance"}, "needs unseen = \"constant\"; set that or remove this");
    }
  }

  void room() {
    const auto& table = given("lighting.room");
    if (!table.at) return;
    Room& room = draft_.room;
    if (draft_.room_file) {
      exclude(table, {"size_m"}, "conflicts with file; allowed: one of the two");
      room.file_as_written = draft_.room_file->string();
      room.file = existing(table, "file", *draft_.room_file);
    } else if (!table.has("size_m")) {
      problem(table, "size_m", "is missing; allowed: 3 numbers in m, or a file");
    }
    room.world_from_room = rigid_transform(draft_.room_pose);
    if (set_.lighting.environment)
      problems_.add(*table.at, table.path,
                    "conflicts with lighting.environment, which is light from infinity");
    set_.lighting.room = room;
  }

  Draft& draft_;
  Set& set_;
  fs::path folder_;
  const Assets& assets_;
  const Origin origin_;
  Problems& problems_;
};

}  // namespace

Set resolve(Draft draft, const fs::path& file, const Assets& assets, Origin origin,
            Problems& problems) {
  Resolver(draft, file, assets, origin, problems).run();
  return std::move(draft.set);
}

}  // namespace previz::set
