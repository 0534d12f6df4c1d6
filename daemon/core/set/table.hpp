// Declares the table of all keys of a set file: the parser reads by it, and the reference is
// printed from it. A new key is a row in table.cpp and a member in set.hpp.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/set/names.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/calibration/keys.hpp"
#include "drivers/keys/value.hpp"

namespace previz::set {

// Records which keys a table of the file gives, and where. A key whose value cannot be read is
// given, but not good.
struct Given {
  struct Key {
    Position at;
    bool good = false;
  };
  std::string path;            // "observer.lens"
  std::optional<Position> at;  // position of the table's header; none: the file lacks the table
  std::map<std::string, Key> keys;

  bool has(const std::string& key) const { return keys.contains(key); }
  bool good(const std::string& key) const { return has(key) && keys.at(key).good; }
  // Returns the position to report for a key: its own, else the table's, else the top of the file.
  Position where(const std::string& key) const {
    return has(key) ? keys.at(key).at : at.value_or(Position{});
  }
};

struct TagDraft {
  Given given;
  int id = 0;
  std::optional<double> size;
  PoseDraft pose;
  std::optional<std::array<glm::dvec3, 4>> corners;
  std::string carrier;
};

struct ObjectDraft {
  Given given;
  Object object;
  std::filesystem::path file;
  PoseDraft pose;
  double scale = 1;
};

struct SurfaceDraft {
  Given given;
  Surface surface;
};

struct LightDraft {
  Given given;
  Light light;
  std::optional<bool> captured;
};

struct CapturedLampDraft {
  Given given;
  CapturedLamp lamp;
};

struct PreviewStepDraft {
  Given given;
  PreviewStep step;
};

struct ButtonDraft {
  Given given;
  Button button;
};

struct GpioDraft {
  Given given;
  GpioContact contact;
};

// Holds the file as it is written. Values that need no interpretation are read straight into `set`;
// resolve() completes the rest.
struct Draft {
  Set set;
  std::map<std::string, Given> given;  // tables that occur at most once, by path
  calibration::ObserverDraft observer;
  calibration::LightCameraDraft light_camera;
  std::optional<std::filesystem::path> environment;
  std::optional<glm::dvec3> unseen_radiance;
  Room room;
  std::optional<std::filesystem::path> room_file;
  PoseDraft room_pose;
  std::vector<TagDraft> tags;
  std::vector<ObjectDraft> objects;
  std::vector<SurfaceDraft> surfaces;
  std::vector<LightDraft> lights;
  std::vector<CapturedLampDraft> captured_lamps;
  std::vector<PreviewStepDraft> preview_steps;
  std::vector<ButtonDraft> buttons;
  std::vector<GpioDraft> contacts;
};

// A row of the table, bound to the variable that receives its value.
struct Key {
  template <class T>
  Key(const char* its_name, T* to, const Rule& rule, const char* its_about, Need its_need = {})
      : name(its_name),
        about(its_about),
        need(std::move(its_need)),
        allowed(Codec<T>::describe(rule)),
        read([to, rule](const Value& value) { *to = Codec<T>::read(value, rule); }) {
    if constexpr (requires { Codec<T>::print(*to, rule); }) {
      print = [to, rule] { return Codec<T>::print(*to, rule); };
      if (need.kind == Need::Kind::defaulted) initial = print();
    }
  }

  std::string name;
  std::string about;  // one line
  Need need;
  std::string allowed;                     // type, unit, range
  std::string initial;                     // the default as TOML
  std::function<void(const Value&)> read;  // throws Misread
  std::function<std::string()> print;      // returns the current value; "" if there is none
};

// A table of the file, or an array of tables. `open` makes room for one in the draft and returns
// its keys. A table whose keys are names that the file makes up has `others`, which reads each.
struct Section {
  enum class Kind { always, optional, repeated };
  // Throws Misread.
  using Others = std::function<void(Position at, const std::string& key, const Value& value)>;
  struct Opened {
    Given* given;
    std::vector<Key> keys;
    Others others{};
  };
  std::string path;
  Kind kind;
  std::string about;
  std::function<Opened()> open;
};

// Returns every table of a set file, bound to `draft`, in the order of the reference.
std::vector<Section> sections(Draft& draft);

}  // namespace previz::set
