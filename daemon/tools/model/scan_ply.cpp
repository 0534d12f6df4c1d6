#include "daemon/tools/model/scan_ply.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/tools/model/scan_text.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"
#include "drivers/letters.hpp"

namespace previz::model {
namespace {

enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

struct TypeName {
  std::string_view name;
  Type type;
};
constexpr std::array type_names{
    TypeName{"char", Type::int8},      TypeName{"int8", Type::int8},
    TypeName{"uchar", Type::uint8},    TypeName{"uint8", Type::uint8},
    TypeName{"short", Type::int16},    TypeName{"int16", Type::int16},
    TypeName{"ushort", Type::uint16},  TypeName{"uint16", Type::uint16},
    TypeName{"int", Type::int32},      TypeName{"int32", Type::int32},
    TypeName{"uint", Type::uint32},    TypeName{"uint32", Type::uint32},
    TypeName{"float", Type::float32},  TypeName{"float32", Type::float32},
    TypeName{"double", Type::float64}, TypeName{"float64", Type::float64}};

enum class Format { text, little_endian, big_endian };

// The part that a property has in a scan.
enum class Role {
  other,
  x,
  y,
  z,
  u,
  v,
  red_part,
  green_part,
  blue_part,
  grey_part,
  corners,
  corner_uvs,
  picture
};
constexpr std::size_t roles = 13;

struct RoleName {
  std::string_view name;
  Role role;
};
constexpr std::array vertex_roles{RoleName{"x", Role::x},
                                  RoleName{"y", Role::y},
                                  RoleName{"z", Role::z},
                                  RoleName{"u", Role::u},
                                  RoleName{"v", Role::v},
                                  RoleName{"s", Role::u},
                                  RoleName{"t", Role::v},
                                  RoleName{"tx", Role::u},
                                  RoleName{"ty", Role::v},
                                  RoleName{"texture_u", Role::u},
                                  RoleName{"texture_v", Role::v},
                                  RoleName{"intensity", Role::grey_part},
                                  RoleName{"gray", Role::grey_part},
                                  RoleName{"grey", Role::grey_part}};
constexpr std::array color_roles{
    RoleName{"red", Role::red_part},     RoleName{"r", Role::red_part},
    RoleName{"green", Role::green_part}, RoleName{"g", Role::green_part},
    RoleName{"blue", Role::blue_part},   RoleName{"b", Role::blue_part}};
constexpr std::array face_roles{
    RoleName{"vertex_indices", Role::corners}, RoleName{"vertex_index", Role::corners},
    RoleName{"vertices", Role::corners},       RoleName{"indices", Role::corners},
    RoleName{"texcoord", Role::corner_uvs},    RoleName{"texcoords", Role::corner_uvs},
    RoleName{"texture_uv", Role::corner_uvs},  RoleName{"uv", Role::corner_uvs},
    RoleName{"texnumber", Role::picture},      RoleName{"texture_number", Role::picture}};

struct Property {
  Role role = Role::other;
  Type type = Type::float32;
  std::optional<Type> count;  // of a list
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  Format format = Format::text;
  std::vector<Element> elements;
  std::vector<std::string> pictures;
};

template <std::size_t count>
Role role_among(const std::array<RoleName, count>& table, std::string_view name) {
  const auto at = std::ranges::find(table, name, &RoleName::name);
  return at == table.end() ? Role::other : at->role;
}

// Colours of vertices are called red, diffuse_red, vertex_r and the like.
Role role_of(const Element& element, const std::string& name) {
  if (element.name != "vertex") return role_among(face_roles, name);
  if (const Role role = role_among(vertex_roles, name); role != Role::other) return role;
  constexpr std::array<std::string_view, 6> of_colours{"",     "diffuse_", "vertex_",
                                                       "col_", "color_",   "colour_"};
  const std::size_t end = name.rfind('_') + 1;
  if (std::ranges::find(of_colours, std::string_view(name).substr(0, end)) == of_colours.end())
    return Role::other;
  return role_among(color_roles, std::string_view(name).substr(end));
}

class PlyHeaderReader {
 public:
  PlyHeaderReader(const std::filesystem::path& file, std::string_view& bytes)
      : file_(file), bytes_(bytes) {}

  Header read() {
    if (bytes_.starts_with("\xef\xbb\xbf")) bytes_.remove_prefix(3);
    const std::size_t first_end = std::min(bytes_.find_first_of("\r\n"), bytes_.size());
    const std::string_view first_ends = bytes_.substr(first_end, 2);
    const bool is_macintosh = first_ends.starts_with('\r') && first_ends != "\r\n";
    if (trimmed(next_line(bytes_)) != "ply") fail("it does not begin with \"ply\"");
    Header header;
    bool has_format = false;
    for (;;) {
      if (bytes_.empty()) fail("its header has no end_header");
      // Behind end_header there may be data that look like the end of a line.
      std::string_view line = bytes_.substr(0, bytes_.find(is_macintosh ? '\r' : '\n'));
      bytes_.remove_prefix(std::min(line.size() + 1, bytes_.size()));
      const std::string word = lower_case(next_word(line));
      if (word == "end_header") break;
      if (word == "format") {
        header.format = format_of(lower_case(next_word(line)));
        has_format = true;
      } else if (word == "comment" || word == "obj_info") {
        add_picture(line, header);
      } else if (word == "element") {
        add_element(line, header);
      } else if (word == "property") {
        add_property(line, header);
      } else if (!word.empty()) {
        fail(fmt::format("its header has the line \"{} ...\"", shown(word)));
      }
    }
    if (!has_format) fail("its header has no format");
    return header;
  }

 private:
  [[noreturn]] void fail(const std::string& why) const {
    throw Error(fmt::format("{}: cannot be read as PLY: {}; export it again", file_.string(), why));
  }
  static std::string shown(std::string_view word) {
    return printable(std::string(word.substr(0, 40)));
  }

  Format format_of(const std::string& word) const {
    if (word == "ascii") return Format::text;
    if (word == "binary_little_endian") return Format::little_endian;
    if (word == "binary_big_endian") return Format::big_endian;
    fail(fmt::format("its format \"{}\" is unknown", shown(word)));
  }

  Type type_of(std::string_view word) const {
    const auto at = std::ranges::find(type_names, lower_case(word), &TypeName::name);
    if (at == type_names.end()) fail(fmt::format("its type \"{}\" is unknown", shown(word)));
    return at->type;
  }

  static void add_picture(std::string_view line, Header& header) {
    std::string word = lower_case(next_word(line));
    if (word.ends_with(':')) word.pop_back();
    if (word != "texturefile" && word != "texture_file") return;
    if (const std::string_view name = without_quotes(line); !name.empty())
      header.pictures.emplace_back(name);
  }

  void add_element(std::string_view line, Header& header) const {
    Element element;
    element.name = lower_case(next_word(line));
    if (element.name == "vertices") element.name = "vertex";
    if (element.name == "faces") element.name = "face";
    if (element.name == "vertex" &&
        std::ranges::find(header.elements, element.name, &Element::name) != header.elements.end())
      fail("its header has two elements of vertices");
    const std::string_view word = next_word(line);
    const auto count = number_in(word);
    if (!count || !(*count >= 0 && *count < 1e15) || *count != std::floor(*count))
      fail(fmt::format("its element {} has no number", shown(element.name)));
    element.count = static_cast<std::uint64_t>(*count);
    header.elements.push_back(std::move(element));
  }

  void add_property(std::string_view line, Header& header) const {
    if (header.elements.empty()) fail("its header has a property before an element");
    Property property;
    std::string_view word = next_word(line);
    if (lower_case(word) == "list") {
      property.count = type_of(next_word(line));
      word = next_word(line);
    }
    property.type = type_of(word);
    const std::string name = lower_case(next_word(line));
    property.role = role_of(header.elements.back(), name);
    const bool needs_list = property.role == Role::corners || property.role == Role::corner_uvs;
    if (needs_list != property.count.has_value()) property.role = Role::other;
    header.elements.back().properties.push_back(property);
  }

  const std::filesystem::path& file_;
  std::string_view& bytes_;
};

// Reads values one after the other.
class PlyValues {
 public:
  PlyValues(const std::filesystem::path& file, Format format, std::string_view bytes)
      : file_(file), format_(format), bytes_(bytes) {}

  double next(Type type) {
    if (format_ == Format::text) return next_word_as_number();
    switch (type) {
      case Type::int8:
        return take<std::int8_t>();
      case Type::uint8:
        return take<std::uint8_t>();
      case Type::int16:
        return take<std::int16_t>();
      case Type::uint16:
        return take<std::uint16_t>();
      case Type::int32:
        return take<std::int32_t>();
      case Type::uint32:
        return take<std::uint32_t>();
      case Type::float32:
        return take<float>();
      case Type::float64:
        break;
    }
    return take<double>();
  }

  std::uint64_t next_count(Type type) {
    const double count = next(type);
    if (!(count >= 0 && count <= static_cast<double>(bytes_.size()))) fail();
    return static_cast<std::uint64_t>(count);
  }

  // Returns how many of so many elements there can be in what is left.
  std::size_t at_most(std::uint64_t count) const {
    constexpr std::size_t least_bytes = 4;
    return std::min<std::uint64_t>(count, bytes_.size() / least_bytes);
  }

  // Returns the last value as a text has it.
  std::string_view word() const { return word_; }

  // Begins with an element's values, whose line in a text may have more values than the last
  // element had properties.
  void begin_element() {
    if (format_ != Format::text || !is_in_line_) return;
    is_in_line_ = false;
    bytes_.remove_prefix(std::min(bytes_.find_first_of("\r\n"), bytes_.size()));
  }

 private:
  [[noreturn]] void fail() const {
    throw Error(file_.string() +
                ": is cut short, or its header does not describe it; export it again");
  }

  template <typename T>
  double take() {
    if (bytes_.size() < sizeof(T)) fail();
    const bool is_swapped =
        (format_ == Format::big_endian) != (std::endian::native == std::endian::big);
    const double value = binary_number<T>(bytes_.data(), is_swapped);
    bytes_.remove_prefix(sizeof(T));
    return value;
  }

  double next_word_as_number() {
    word_ = next_word(bytes_);
    const std::optional<double> number = number_in(word_);
    if (!number) fail();
    is_in_line_ = true;
    return *number;
  }

  const std::filesystem::path& file_;
  Format format_;
  std::string_view bytes_;
  bool is_in_line_ = false;
  std::string_view word_;
};

// The colours of vertices, of which text and binary files have integers or floats.
class VertexColours {
 public:
  explicit VertexColours(const Element& element) {
    const auto type = [&](Role role) -> std::optional<Type> {
      const auto at = std::ranges::find(element.properties, role, &Property::role);
      if (at == element.properties.end()) return {};
      return at->type;
    };
    is_grey_ = !(type(Role::red_part) && type(Role::green_part) && type(Role::blue_part));
    const std::optional<Type> found = is_grey_ ? type(Role::grey_part) : type(Role::red_part);
    if (!found) return;
    exist_ = true;
    is_float_ = *found == Type::float32 || *found == Type::float64;
    if (*found == Type::uint16) largest_ = 65535;
  }

  void add(const std::array<double, roles>& values, std::vector<std::uint8_t>& luma) {
    if (!exist_) return;
    const auto value = [&](Role role) { return values[static_cast<std::size_t>(role)]; };
    const glm::dvec3 colour = is_grey_ ? glm::dvec3(value(Role::grey_part))
                                       : glm::dvec3(value(Role::red_part), value(Role::green_part),
                                                    value(Role::blue_part));
    if (is_float_)
      floats_.add(colour);
    else
      luma.push_back(luma_of(colour / largest_, false));
  }

  void finish(std::vector<std::uint8_t>& luma) const {
    if (is_float_) floats_.finish(luma);
  }

 private:
  bool exist_ = false, is_grey_ = false, is_float_ = false;
  double largest_ = 255;
  FloatColours floats_;
};

class PlyReader {
 public:
  PlyReader(const std::filesystem::path& file, Header header, std::string_view data,
            ScanTextures* textures)
      : header_(std::move(header)), values_(file, header_.format, data), textures_(textures) {
    if (textures_)
      for (const std::string& name : header_.pictures) pictures_.push_back(textures_->named(name));
  }

  FoundSurface read() {
    for (const Element& element : header_.elements) {
      if (element.properties.empty()) continue;
      if (element.name == "vertex")
        read_vertices(element);
      else
        read_faces(element);
    }
    return std::move(found_);
  }

 private:
  void read_vertices(const Element& element) {
    VertexColours colours(element);
    const auto has = [&](Role role) {
      return std::ranges::find(element.properties, role, &Property::role) !=
             element.properties.end();
    };
    has_vertex_uvs_ = has(Role::u) && has(Role::v);
    bool is_single = false;
    for (const Property& property : element.properties)
      is_single |= property.role >= Role::x && property.role <= Role::z &&
                   property.type == Type::float32 && header_.format != Format::text;
    std::array<double, roles> values{};
    double farthest = 0;
    found_.points.reserve(values_.at_most(element.count));
    for (std::uint64_t i = 0; i < element.count; ++i) {
      values_.begin_element();
      for (const Property& property : element.properties) read(property, values);
      const auto value = [&](Role role) { return values[static_cast<std::size_t>(role)]; };
      const glm::dvec3& p =
          found_.points.emplace_back(value(Role::x), value(Role::y), value(Role::z));
      for (glm::length_t k = 0; k < 3; ++k)
        if (std::isfinite(p[k])) farthest = std::max(farthest, std::abs(p[k]));
      if (!textures_) continue;
      colours.add(values, found_.luma);
      if (has_vertex_uvs_) found_.uvs.emplace_back(value(Role::u), value(Role::v));
    }
    colours.finish(found_.luma);
    if (is_single) found_.step = single_step * farthest;
    if (header_.format == Format::text) found_.step = steps_.step();
    found_.is_step_of_text = header_.format == Format::text;
  }

  // A single value goes to `values`; a list goes to corners_ and uvs_.
  void read(const Property& property, std::array<double, roles>& values) {
    if (!property.count) {
      const double value = values_.next(property.type);
      values[static_cast<std::size_t>(property.role)] = value;
      if (property.role >= Role::x && property.role <= Role::z && header_.format == Format::text)
        steps_.add(static_cast<std::size_t>(property.role) - static_cast<std::size_t>(Role::x),
                   value, values_.word());
      return;
    }
    std::vector<double>* const list = property.role == Role::corners      ? &corners_
                                      : property.role == Role::corner_uvs ? &uvs_
                                                                          : nullptr;
    const std::uint64_t count = values_.next_count(*property.count);
    for (std::uint64_t k = 0; k < count; ++k) {
      const double value = values_.next(property.type);
      if (list) list->push_back(value);
    }
  }

  void read_faces(const Element& element) {
    const bool are_strips = element.name == "tristrips";
    const bool are_faces = element.name == "face" || are_strips;
    if (are_faces && !are_strips) reserve_faces(values_.at_most(element.count));
    std::array<double, roles> values{};
    for (std::uint64_t i = 0; i < element.count; ++i) {
      values_.begin_element();
      corners_.clear();
      uvs_.clear();
      for (const Property& property : element.properties) read(property, values);
      if (!are_faces) continue;
      if (are_strips) {
        add_strip();
      } else {
        for (std::size_t k = 0; k < corners_.size(); ++k) add_corner(k);
        found_.end_face(picture_of(values[static_cast<std::size_t>(Role::picture)]));
      }
    }
  }

  // Most faces are triangles.
  void reserve_faces(std::size_t count) {
    found_.corners.reserve(3 * count);
    if (textures_) found_.corner_uvs.reserve(3 * count);
    found_.ends.reserve(count);
    found_.sources.reserve(count);
  }

  int picture_of(double number) const {
    if (pictures_.size() == 1) return pictures_[0];
    if (number >= 0 && number < static_cast<double>(pictures_.size()))
      return pictures_[static_cast<std::size_t>(number)];
    if (!pictures_.empty())
      textures_->note("faces whose texnumber has no texture in the header have no colour");
    return colourless;
  }

  void add_corner(std::size_t k) {
    const double point = corners_[k];
    const bool is_point = point >= 0 && point < static_cast<double>(no_index);
    found_.corners.push_back(is_point ? static_cast<std::uint32_t>(point) : no_index);
    if (!textures_) return;
    if (uvs_.size() == 2 * corners_.size()) {
      found_.corner_uvs.push_back(static_cast<std::uint32_t>(found_.uvs.size()));
      found_.uvs.emplace_back(uvs_[2 * k], uvs_[2 * k + 1]);
    } else {
      found_.corner_uvs.push_back(has_vertex_uvs_ ? found_.corners.back() : no_index);
    }
  }

  // Every second triangle of a strip is turned; -1 ends a strip (Stanford's scans).
  void add_strip() {
    const auto ends = [&](std::size_t k) {
      return !(corners_[k] >= 0 && corners_[k] < static_cast<double>(no_index));
    };
    bool is_turned = false;
    for (std::size_t k = 2; k < corners_.size(); ++k) {
      if (ends(k) || ends(k - 1) || ends(k - 2)) {
        is_turned = false;
        continue;
      }
      add_corner(is_turned ? k - 1 : k - 2);
      add_corner(is_turned ? k - 2 : k - 1);
      add_corner(k);
      found_.end_face(picture_of(0));
      is_turned = !is_turned;
    }
  }

  Header header_;
  PlyValues values_;
  ScanTextures* textures_;
  std::vector<int> pictures_;
  bool has_vertex_uvs_ = false;
  std::vector<double> corners_, uvs_;
  TextSteps steps_;
  FoundSurface found_;
};

}  // namespace

FoundSurface read_ply(const std::filesystem::path& file, std::string&& bytes,
                      ScanTextures* textures) {
  const std::string held = std::move(bytes);
  std::string_view rest = held;
  Header header = PlyHeaderReader(file, rest).read();
  return PlyReader(file, std::move(header), rest, textures).read();
}

}  // namespace previz::model
