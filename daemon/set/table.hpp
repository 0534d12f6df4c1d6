// The heart of the set file: one table of every key, which the parser reads by and the reference is
// printed from. A new key is one line in table.cpp.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/set/names.hpp"
#include "daemon/set/set.hpp"
#include "drivers/calibration/keys.hpp"
#include "drivers/keys/value.hpp"

namespace previz::set {

// Which keys a table of the file gave, and where. A key that could not be read is given, not good.
struct Given {
  struct Key {
    Position at;
    bool good = false;
  };
  std::string path;            // "observer.lens"
  std::optional<Position> at;  // of the table's header; none: the file does not have the table
  std::map<std::string, Key> keys;

  bool has(const std::string& key) const { return keys.contains(key); }
  bool good(const std::string& key) const { return has(key) && keys.at(key).good; }
  // Where to point for a key: its own place, else the table's, else the top of the file.
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
};

struct ButtonDraft {
  Given given;
  Button button;
};

struct GpioDraft {
  Given given;
  GpioContact contact;
};

// The file as it is written. What needs no second thought is read straight into `set`; the rest is
// brought there by resolve().
struct Draft {
  Set set;
  std::map<std::string, Given> given;  // every table that stands once, by its path
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
  std::vector<ButtonDraft> buttons;
  std::vector<GpioDraft> contacts;
};

// A row of the table, bound to the place its value goes to.
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
  std::function<std::string()> print;      // the value as it is now; "" where there is none
};

// A table of the file, or an array of tables. `open` makes room for one in the draft.
struct Section {
  enum class Kind { always, optional, repeated };
  struct Opened {
    Given* given;
    std::vector<Key> keys;
  };
  std::string path;
  Kind kind;
  std::string about;
  std::function<Opened()> open;
};

// Every table of a set file, bound to `draft`, in the order of the reference.
std::vector<Section> sections(Draft& draft);

}  // namespace previz::set
