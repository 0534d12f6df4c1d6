#include "daemon/tools/model/scan_obj.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "daemon/tools/model/scan_text.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"
#include "drivers/letters.hpp"

namespace previz::model {
namespace {

struct ObjMap {
  std::string file;       // empty: none
  bool is_moved = false;  // on its faces, by -o, -s or -t
};

struct ObjMaterial {
  ObjMap colour, emission;
};
using ObjMaterials = std::map<std::string, ObjMaterial>;

// Options have a word behind them, -mm two, and those that move the texture up to three numbers.
ObjMap map_of(std::string_view line) {
  ObjMap map;
  for (;;) {
    std::string_view rest = line;
    const std::string option = lower_case(next_word(rest));
    if (!option.starts_with('-') || option.find('.') != std::string::npos) break;
    const bool moves = option == "-o" || option == "-s" || option == "-t";
    const double neutral = option == "-s" ? 1 : 0;
    for (int k = 0; k < (moves ? 3 : option == "-mm" ? 2 : 1); ++k) {
      line = rest;
      const std::string_view word = next_word(rest);
      const auto number = number_in(word);
      if (moves && (!number || word.find_first_not_of("+-.,0123456789eE") < word.size())) break;
      if (moves && std::abs(*number - neutral) > 1e-6) map.is_moved = true;
      line = rest;
    }
  }
  map.file = without_quotes(line.substr(0, line.find(" #")));
  return map;
}

// A material that is described twice keeps its first maps.
void read_mtl(std::string_view text, ObjMaterials& materials) {
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  ObjMaterial* material = nullptr;
  while (!text.empty()) {
    std::string_view line = next_line(text);
    const std::string word = lower_case(next_word(line));
    if (word == "newmtl") material = &materials[std::string(trimmed(line))];
    if (material && word == "map_kd" && material->colour.file.empty())
      material->colour = map_of(line);
    if (material && (word == "map_ke" || word == "map_emissive") && material->emission.file.empty())
      material->emission = map_of(line);
  }
}

class ObjReader {
 public:
  ObjReader(const std::filesystem::path& file, ScanTextures* textures)
      : file_(file), textures_(textures) {}

  FoundSurface read(std::string_view text) {
    if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
    std::string joined;
    while (!text.empty()) {
      std::string_view part = next_line(text);
      if (!continues(part) || trimmed(part).starts_with('#')) {
        read_line(part);
        continue;
      }
      joined.clear();
      for (;; part = next_line(text)) {
        joined.append(part.substr(0, continues(part) ? part.rfind('\\') : part.size())).append(" ");
        if (!continues(part) || text.empty()) break;
      }
      read_line(joined);
    }
    if (textures_) {
      find_textures();
      if (has_colours_) colours_.finish(found_.luma);
    }
    found_.step = steps_.step();
    found_.is_step_of_text = true;
    return std::move(found_);
  }

 private:
  // Returns whether the next line belongs to this one.
  static bool continues(std::string_view line) { return trimmed(line).ends_with('\\'); }

  void read_line(std::string_view line) {
    const std::string_view word = next_word(line);
    if (word == "v") {
      read_vertex(line);
    } else if (word == "f" || word == "fo") {
      read_face(line);
    } else if (!textures_) {
      return;
    } else if (word == "vt") {
      const auto u = number_in(next_word(line)), v = number_in(next_word(line));
      found_.uvs.emplace_back(u.value_or(0), v.value_or(0));
    } else if (word == "usemtl") {
      const std::string name(trimmed(line));
      material_ = names_.try_emplace(name, static_cast<int>(names_.size())).first->second;
    } else if (word == "mtllib") {
      read_library(without_quotes(line));
    }
  }

  // x y z, x y z w, or x y z r g b.
  void read_vertex(std::string_view line) {
    std::array<double, 6> numbers{};
    std::array<std::string_view, 3> words;
    std::size_t count = 0;
    while (count < numbers.size()) {
      const std::string_view word = next_word(line);
      const auto number = word.starts_with('#') ? std::nullopt : number_in(word);
      if (!number) break;
      if (count < words.size()) words[count] = word;
      numbers[count++] = *number;
    }
    glm::dvec3 p(numbers[0], numbers[1], numbers[2]);
    if (count < 3) p = glm::dvec3(std::numeric_limits<double>::quiet_NaN());
    if (count == 4 && numbers[3] != 0) p /= numbers[3];
    for (std::size_t k = 0; k < words.size(); ++k) steps_.add(k, numbers[k], words[k]);
    found_.points.push_back(p);
    if (!textures_) return;
    has_colours_ |= count == numbers.size();
    colours_.add({numbers[3], numbers[4], numbers[5]});
  }

  // Indices begin with 1; negative ones count from the last element.
  static std::uint32_t index_in(std::string_view number, std::size_t count) {
    std::int64_t index = 0;
    const auto read = std::from_chars(number.data(), number.data() + number.size(), index);
    if (read.ec != std::errc() || index == 0) return no_index;
    index = index > 0 ? index - 1 : static_cast<std::int64_t>(count) + index;
    return index >= 0 && index < std::int64_t{no_index} ? static_cast<std::uint32_t>(index)
                                                        : no_index;
  }

  void read_face(std::string_view line) {
    for (std::string_view word = next_word(line); !word.empty() && !word.starts_with('#');
         word = next_word(line)) {
      const std::size_t slash = std::min(word.find('/'), word.size());
      found_.corners.push_back(index_in(word.substr(0, slash), found_.points.size()));
      if (!textures_) continue;
      const std::string_view rest = word.substr(std::min(slash + 1, word.size()));
      found_.corner_uvs.push_back(index_in(rest.substr(0, rest.find('/')), found_.uvs.size()));
    }
    found_.end_face(material_);
  }

  // One name with spaces, or several; where none is there, the MTL of the OBJ's own name.
  void read_library(std::string_view names) {
    if (read_library_file(std::string(names))) return;
    bool is_read = false;
    std::string_view rest = names;
    for (std::string_view name = next_word(rest); !name.empty(); name = next_word(rest))
      is_read |= name.size() < names.size() && read_library_file(std::string(name));
    if (!is_read) read_library_file(file_.stem().string() + ".mtl");
  }

  bool read_library_file(const std::string& name) {
    const auto found = textures_->find(name);
    if (!found) return false;
    if (libraries_.insert(*found).second) read_mtl(scan_bytes(*found), materials_);
    return true;
  }

  // Replaces the numbers of material names by those of pictures.
  void find_textures() {
    std::vector<std::string> names(names_.size());
    for (const auto& [name, number] : names_) names[static_cast<std::size_t>(number)] = name;
    std::vector<std::optional<int>> pictures(names.size());
    for (int& source : found_.sources) {
      if (source < 0) continue;
      std::optional<int>& picture = pictures[static_cast<std::size_t>(source)];
      if (!picture) picture = picture_of(names[static_cast<std::size_t>(source)]);
      source = *picture;
    }
  }

  int picture_of(const std::string& name) {
    if (lower_.empty())
      for (const auto& [known, material] : materials_)
        lower_.try_emplace(lower_case(known), &material);
    const auto exact = materials_.find(name);
    const auto similar = lower_.find(lower_case(name));
    if (exact == materials_.end() && similar == lower_.end()) return colourless;
    const auto& [colour, emission] = exact != materials_.end() ? exact->second : *similar->second;
    const ObjMap& map = colour.file.empty() ? emission : colour;
    if (map.file.empty()) return colourless;
    if (map.is_moved)
      throw Error(
          fmt::format("{}: its texture \"{}\" is moved or scaled on its faces (-o, -s or -t in the "
                      "MTL); export the scan without that",
                      file_.string(), printable(map.file)));
    return textures_->named(map.file);
  }

  const std::filesystem::path& file_;
  ScanTextures* textures_;
  ObjMaterials materials_;
  std::map<std::string, const ObjMaterial*> lower_;  // by their names in small letters
  TextSteps steps_;
  std::set<std::filesystem::path> libraries_;
  std::map<std::string, int> names_;  // that usemtl has, numbered
  int material_ = colourless;         // number of the name in use
  bool has_colours_ = false;
  FloatColours colours_;
  FoundSurface found_;
};

}  // namespace

FoundSurface read_obj(const std::filesystem::path& file, std::string&& bytes,
                      ScanTextures* textures) {
  const std::string text = std::move(bytes);
  return ObjReader(file, textures).read(text);
}

}  // namespace previz::model
