#include "daemon/core/lighting/exr_color.hpp"

#include <ImfChromaticities.h>
#include <ImfIntAttribute.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <string_view>

#include "drivers/error.hpp"
#include "drivers/letters.hpp"

namespace previz::lighting {
namespace {

struct Space {
  enum class Kind {
    rgb,     // linear, of the primaries
    xyz,     // linear CIE XYZ, of their white
    linear,  // of primaries that another attribute may name
    unsaid,
    data
  };
  Kind kind = Kind::unsaid;
  std::string_view words;
  Chromaticities primaries = rec709;

  bool has_primaries() const { return kind == Kind::rgb || kind == Kind::xyz; }
  bool is_rec709() const { return kind == Kind::rgb && lighting::is_rec709(primaries); }
};

constexpr std::array<double, 2> aces_white = {0.32168, 0.33767};
constexpr Space linear_rec709{Space::Kind::rgb, "linear Rec. 709"};
// SMPTE ST 2065-1, Academy S-2014-004, ITU-R BT.2020, SMPTE EG 432-1, Adobe RGB (1998).
constexpr Space ap0{
    Space::Kind::rgb, "ACES2065-1", {{{0.7347, 0.2653}, {0, 1}, {0.0001, -0.077}, aces_white}}};
constexpr Space ap1{
    Space::Kind::rgb, "ACEScg", {{{0.713, 0.293}, {0.165, 0.830}, {0.128, 0.044}, aces_white}}};
constexpr Space rec2020{
    Space::Kind::rgb, "linear Rec. 2020", {{{0.708, 0.292}, {0.170, 0.797}, {0.131, 0.046}, d65}}};
constexpr Space p3{
    Space::Kind::rgb, "linear P3-D65", {{{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, d65}}};
constexpr Space adobe{
    Space::Kind::rgb, "linear Adobe RGB", {{{0.64, 0.33}, {0.21, 0.71}, {0.15, 0.06}, d65}}};
constexpr Space xyz_d65{Space::Kind::xyz, "CIE XYZ with a white of D65"};
constexpr Space xyz_e{Space::Kind::xyz, "CIE XYZ with a white of E", {{{}, {}, {}, equal_energy}}};
constexpr Space linear{Space::Kind::linear, "linear"};
constexpr Space unsaid{};
constexpr Space no_colors{Space::Kind::data, "data"};

// The names of the Color Interop Forum, of OpenImageIO, of the configurations of ACES and Blender
// for OpenColorIO, as plain() leaves them.
struct Name {
  std::string_view name;
  const Space& space;
};
constexpr auto space_names = std::to_array<Name>({{"linrec709", linear_rec709},
                                                  {"linsrgb", linear_rec709},
                                                  {"srgblin", linear_rec709},
                                                  {"linrec709srgb", linear_rec709},
                                                  {"linbt709", linear_rec709},
                                                  {"linrec709id65", linear_rec709},
                                                  {"linap0", ap0},
                                                  {"aces20651", ap0},
                                                  {"acesaces20651", ap0},
                                                  {"linaces20651", ap0},
                                                  {"linap1", ap1},
                                                  {"acescg", ap1},
                                                  {"acesacescg", ap1},
                                                  {"linacescg", ap1},
                                                  {"linrec2020", rec2020},
                                                  {"linbt2020", rec2020},
                                                  {"linrec2020id65", rec2020},
                                                  {"linp3d65", p3},
                                                  {"linp3", p3},
                                                  {"lindcip3d65", p3},
                                                  {"linadobergb", adobe},
                                                  {"linciexyzd65", xyz_d65},
                                                  {"ciexyzd65", xyz_d65},
                                                  {"linciexyzid65", xyz_d65},
                                                  {"linciexyzie", xyz_e},
                                                  {"lin", linear},
                                                  {"", unsaid},
                                                  {"unknown", unsaid},
                                                  {"none", unsaid},
                                                  {"raw", unsaid},
                                                  {"bypass", unsaid},
                                                  {"data", no_colors},
                                                  {"noncolor", no_colors},
                                                  {"noncolordata", no_colors}});

// Lower case without what programs spell in their own ways: "ocio:Utility - Linear - Rec.709" and
// "lin_rec709_scene" are the same.
std::string plain(std::string_view name) {
  if (const std::size_t colon = name.rfind(':'); colon != std::string_view::npos)
    name.remove_prefix(colon + 1);
  std::string letters = lower_case(name);
  std::erase_if(letters, [](unsigned char c) { return std::isalnum(c) == 0; });
  for (const auto& [word, shorter] :
       {std::pair{"linear", "lin"}, {"utility", ""}, {"scene", ""}, {"display", ""}})
    if (const std::size_t at = letters.find(word); at != std::string::npos)
      letters.replace(at, std::string_view(word).size(), shorter);
  return letters;
}

// A space, and the attribute that names it.
struct Said {
  std::string attribute;
  Space space;

  std::string words() const { return fmt::format("{} (by {})", space.words, attribute); }
};

Said named(const std::string& attribute, const std::string& value,
           const std::filesystem::path& path) {
  const auto found = std::ranges::find(space_names, plain(value), &Name::name);
  const std::string says = fmt::format("{}: {} is \"{}\"", path.string(), attribute,
                                       std::string_view(value).substr(0, 60));
  if (found == space_names.end())
    throw Error(
        says +
        ", which is not known as linear light; convert the file with an OpenColorIO configuration "
        "that has it: oiiotool --colorconfig CONFIG.ocio IN --colorconvert \"" +
        value.substr(0, 60) +
        "\" lin_rec709 --eraseattrib chromaticities --eraseattrib colorInteropID -o OUT.exr");
  if (found->space.kind == Space::Kind::data)
    throw Error(says + ", which holds no colours; export the picture of the light instead");
  return {fmt::format("{} \"{}\"", attribute, value), found->space};
}

std::optional<ColorMatrix> matrix_of(const Space& space) {
  return space.kind == Space::Kind::xyz ? rec709_from_xyz(space.primaries[3])
                                        : rec709_from(space.primaries);
}

bool same_primaries(const Space& a, const Space& b) {
  constexpr double digits = 0.01;
  const auto one = matrix_of(a), other = matrix_of(b);
  return one && other && std::ranges::equal(*one, *other, [](double x, double y) {
           return std::abs(x - y) < digits;
         });
}

Space chromaticities_in(const Imf::Header& header) {
  const Imf::Chromaticities found = Imf::chromaticities(header);
  const auto xy = [](const Imath::V2f& v) { return std::array<double, 2>{v.x, v.y}; };
  Space space{Space::Kind::rgb,
              "linear light of other primaries",
              {xy(found.red), xy(found.green), xy(found.blue), xy(found.white)}};
  for (const Name& name : space_names)
    if (name.space.kind == Space::Kind::rgb && same_primaries(name.space, space) &&
        name.space.is_rec709() == space.is_rec709())
      space.words = name.space.words;
  return space;
}

// What the file's attributes say, the one that counts first.
std::vector<Said> said_by(const Imf::Header& header, const std::filesystem::path& path) {
  std::vector<Said> said;
  const auto add_named = [&](const char* attribute) {
    if (const auto* text = header.findTypedAttribute<Imf::StringAttribute>(attribute))
      said.push_back(named(attribute, text->value(), path));
  };
  add_named("colorInteropID");
  if (const auto* flag = header.findTypedAttribute<Imf::IntAttribute>("acesImageContainerFlag");
      flag && flag->value() == 1)
    said.push_back({"acesImageContainerFlag", ap0});
  const std::size_t before = said.size();
  add_named("oiio:ColorSpace");
  if (Imf::hasChromaticities(header)) {
    const bool is_first = said.size() > before && said.back().space.is_rec709();
    said.insert(said.end() - (is_first ? 1 : 0), {"chromaticities", chromaticities_in(header)});
  }
  return said;
}

// Returns what counts for X, Y and Z, whose white an attribute may name.
Said said_by_xyz(const Said* first) {
  if (first == nullptr) return {"its channels X, Y and Z", xyz_d65};
  if (first->space.kind == Space::Kind::xyz) return *first;
  return {"its channels X, Y and Z", {Space::Kind::xyz, "CIE XYZ", first->space.primaries}};
}

void note_disagreement(const std::vector<Said>& said, const std::filesystem::path& path,
                       std::vector<std::string>& notes) {
  for (std::size_t i = 1; i < said.size(); ++i)
    if (!same_primaries(said[0].space, said[i].space))
      notes.push_back(
          fmt::format("{}: is {}, and {}; the first counts; if it is wrong, remove it: oiiotool IN "
                      "--eraseattrib {} -o OUT.exr",
                      path.string(), said[0].words(), said[i].words(),
                      said[0].attribute.substr(0, said[0].attribute.find(' '))));
}

}  // namespace

std::optional<ColorMatrix> rec709_from(const Imf::Header& header, ExrChannels channels,
                                       const std::filesystem::path& path,
                                       std::vector<std::string>& notes) {
  std::vector<Said> said = said_by(header, path);
  if (!said.empty() &&
      std::ranges::all_of(said, [](const Said& s) { return s.space.kind == Space::Kind::unsaid; }))
    notes.push_back(fmt::format(
        "{}: {} names no colour space; its values are used as linear Rec. 709; convert others: "
        "oiiotool --colorconfig CONFIG.ocio IN --colorconvert FROM lin_rec709 -o OUT.exr",
        path.string(), said.front().attribute));
  std::erase_if(said, [](const Said& s) { return !s.space.has_primaries(); });
  // A grey of any primaries is a grey of Rec. 709.
  if (channels == ExrChannels::luminance) return std::nullopt;
  if (channels == ExrChannels::xyz) said = {said_by_xyz(said.empty() ? nullptr : &said.front())};
  note_disagreement(said, path, notes);
  if (said.empty() || said.front().space.is_rec709()) return std::nullopt;
  const Space& space = said.front().space;
  const auto matrix = matrix_of(space);
  if (!matrix)
    throw Error(fmt::format(
        "{}: its chromaticities span no colours; remove them if its values are linear Rec. 709: "
        "oiiotool IN --eraseattrib chromaticities -o OUT.exr",
        path.string()));
  notes.push_back(fmt::format("{}: is {}; it is converted to linear Rec. 709, white to white",
                              path.string(), said.front().words()));
  return matrix;
}

}  // namespace previz::lighting
