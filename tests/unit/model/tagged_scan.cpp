#include "tests/unit/model/tagged_scan.hpp"

#include <fmt/format.h>

#include <glm/geometric.hpp>

#include "drivers/calibration.hpp"
#include "tests/support/gltf_writer.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::test {
namespace {

glm::dvec3 point_on(const TaggedFace& face, glm::dvec2 at) {
  return face.origin + at.x * face.across + at.y * face.up;
}

// What is printed on a face.
class Print {
 public:
  explicit Print(const TaggedFace& face) : face_(face) {
    for (const set::Tag& tag : face.tags) cells_.push_back(cells_of("tag36h11", tag.id));
  }

  // Returns the mean over a square of this side.
  std::uint8_t mean_shade(glm::dvec2 at, double side) const {
    constexpr int samples = 4;
    double sum = 0;
    for (int i = 0; i < samples; ++i)
      for (int j = 0; j < samples; ++j)
        sum +=
            shade_at(at + side * glm::dvec2((i + 0.5) / samples - 0.5, (j + 0.5) / samples - 0.5));
    return static_cast<std::uint8_t>(std::lround(sum / (samples * samples)));
  }

 private:
  // Returns black or white of the tag that is at this place, grey beside tags.
  double shade_at(glm::dvec2 at) const {
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      const set::Tag& tag = face_.tags[i];
      const int total = cells_[i].total;
      const glm::dvec3 off = point_on(face_, at) - glm::dvec3(tag.world_from_tag[3]);
      const double cell = tag.size_m / cells_[i].border;
      const double column = glm::dot(off, glm::dvec3(tag.world_from_tag[0])) / cell + total / 2.0;
      const double row = total / 2.0 - glm::dot(off, glm::dvec3(tag.world_from_tag[1])) / cell;
      if (column < 0 || row < 0 || column >= total || row >= total) continue;
      const auto index = static_cast<std::size_t>(row) * static_cast<std::size_t>(total) +
                         static_cast<std::size_t>(column);
      return cells_[i].cells[index] == 0 ? 30 : 225;
    }
    return 150 + 20 * std::sin(40 * at.x) * std::cos(30 * at.y);
  }

  const TaggedFace& face_;
  std::vector<TagCells> cells_;
};

// A strip of a face in the atlas, with a gutter around it that continues the face.
struct Strip {
  const TaggedFace* face = nullptr;
  double from = 0, to = 0;  // across
  int columns = 0, rows = 0;
  int x = 0, y = 0;  // of the first pixel within the gutter
  bool is_turned = false;

  // The place on the face of a place in the strip, in pixels from its upper left corner.
  glm::dvec2 on_face(glm::dvec2 px) const {
    const glm::dvec2 part = px / glm::dvec2(columns, rows);
    const glm::dvec2 fraction = is_turned ? glm::dvec2(1 - part.y, part.x) : part;
    return {from + fraction.x * (to - from), (1 - fraction.y) * face->height_m};
  }
};

constexpr int gutter_px = 3, atlas_width_px = 1024;

std::vector<Strip> strips_of(const std::vector<TaggedFace>& faces, double pixel_m, int& height) {
  std::vector<Strip> strips;
  int x = 0, y = 0, shelf = 0;
  for (const TaggedFace& face : faces) {
    const int count = static_cast<int>(std::ceil(face.width_m / 0.05));
    for (int i = 0; i < count; ++i) {
      Strip strip{&face, face.width_m * i / count, face.width_m * (i + 1) / count};
      strip.columns = static_cast<int>(std::lround((strip.to - strip.from) / pixel_m));
      strip.rows = static_cast<int>(std::lround(face.height_m / pixel_m));
      strip.is_turned = i % 2 == 1;
      if (strip.is_turned) std::swap(strip.columns, strip.rows);
      if (x + strip.columns + 2 * gutter_px > atlas_width_px) x = 0, y += shelf, shelf = 0;
      strip.x = x + gutter_px;
      strip.y = y + gutter_px;
      x += strip.columns + 2 * gutter_px;
      shelf = std::max(shelf, strip.rows + 2 * gutter_px);
      strips.push_back(strip);
    }
  }
  height = y + shelf;
  return strips;
}

}  // namespace

set::Tag tag_on(const TaggedFace& face, int id, double size_m, glm::dvec2 at, double turn_rad) {
  const glm::dvec3 right = std::cos(turn_rad) * face.across + std::sin(turn_rad) * face.up;
  const glm::dvec3 out = glm::cross(face.across, face.up);
  return {id, size_m,
          glm::dmat4(glm::dvec4(right, 0), glm::dvec4(glm::cross(out, right), 0),
                     glm::dvec4(out, 0), glm::dvec4(point_on(face, at), 1))};
}

std::vector<TaggedFace> table_with_box() {
  TaggedFace table{{-0.3, -0.25, 0}, {1, 0, 0}, {0, 1, 0}, 0.6, 0.5};
  table.tags = {tag_on(table, 3, 0.08, {0.1, 0.12}), tag_on(table, 5, 0.08, {0.5, 0.14}, 0.6)};
  TaggedFace front{{-0.1, 0.05, 0}, {1, 0, 0}, {0, 0, 1}, 0.2, 0.15};
  front.tags = {tag_on(front, 7, 0.08, {0.1, 0.08})};
  const TaggedFace right{{0.1, 0.05, 0}, {0, 1, 0}, {0, 0, 1}, 0.15, 0.15};
  const TaggedFace back{{0.1, 0.2, 0}, {-1, 0, 0}, {0, 0, 1}, 0.2, 0.15};
  const TaggedFace left{{-0.1, 0.2, 0}, {0, -1, 0}, {0, 0, 1}, 0.15, 0.15};
  const TaggedFace top{{-0.1, 0.05, 0.15}, {1, 0, 0}, {0, 1, 0}, 0.2, 0.15};
  return {table, front, right, back, left, top};
}

std::vector<set::Tag> tags_of(const std::vector<TaggedFace>& faces) {
  std::vector<set::Tag> tags;
  for (const TaggedFace& face : faces) tags.insert(tags.end(), face.tags.begin(), face.tags.end());
  return tags;
}

void TaggedScan::move(const std::function<glm::dvec3(const glm::dvec3&)>& scan_from_world) {
  for (glm::vec3& p : positions) p = glm::vec3(scan_from_world(glm::dvec3(p)));
}

TaggedScan textured_scan(const std::vector<TaggedFace>& faces, double pixel_m) {
  TaggedScan scan;
  const std::vector<Strip> strips = strips_of(faces, pixel_m, scan.height);
  scan.width = atlas_width_px;
  scan.luma.assign(static_cast<std::size_t>(scan.width) * static_cast<std::size_t>(scan.height), 0);
  for (const Strip& strip : strips) {
    const Print print(*strip.face);
    for (int y = -gutter_px; y < strip.rows + gutter_px; ++y)
      for (int x = -gutter_px; x < strip.columns + gutter_px; ++x)
        scan.luma[static_cast<std::size_t>(strip.y + y) * atlas_width_px +
                  static_cast<std::size_t>(strip.x + x)] =
            print.mean_shade(strip.on_face({x + 0.5, y + 0.5}), pixel_m);
    const auto first = static_cast<unsigned>(scan.positions.size());
    for (const glm::dvec2 corner : {glm::dvec2(0, 1), {1, 1}, {1, 0}, {0, 0}}) {
      const glm::dvec2 px = corner * glm::dvec2(strip.columns, strip.rows);
      scan.positions.emplace_back(point_on(*strip.face, strip.on_face(px)));
      scan.uvs.emplace_back((strip.x + px.x) / scan.width, 1 - (strip.y + px.y) / scan.height);
    }
    for (const unsigned k : {0U, 1U, 2U, 0U, 2U, 3U}) scan.indices.push_back(first + k);
  }
  return scan;
}

TaggedScan vertex_coloured_scan(const std::vector<TaggedFace>& faces, double step_m) {
  TaggedScan scan;
  for (const TaggedFace& face : faces) {
    const Print print(face);
    const auto columns = static_cast<unsigned>(std::lround(face.width_m / step_m));
    const auto rows = static_cast<unsigned>(std::lround(face.height_m / step_m));
    const auto first = static_cast<unsigned>(scan.positions.size());
    for (unsigned y = 0; y <= rows; ++y)
      for (unsigned x = 0; x <= columns; ++x) {
        const glm::dvec2 at(face.width_m * x / columns, face.height_m * y / rows);
        scan.positions.emplace_back(point_on(face, at));
        scan.luma.push_back(print.mean_shade(at, step_m));
        if (x == columns || y == rows) continue;
        const unsigned a = first + y * (columns + 1) + x, c = a + columns + 1;
        scan.indices.insert(scan.indices.end(), {a, a + 1, c + 1, a, c + 1, c});
      }
  }
  return scan;
}

std::vector<unsigned char> png_of(const TaggedScan& scan) {
  std::vector<unsigned char> rgba;
  for (const std::uint8_t luma : scan.luma) rgba.insert(rgba.end(), {luma, luma, luma, 255});
  return png(scan.width, scan.height, rgba);
}

void write_textured_obj(const std::filesystem::path& file, const TaggedScan& scan,
                        const glm::dvec3& offset) {
  const std::string name = file.stem().string();
  std::ofstream out(file);
  out << "mtllib " << name << ".mtl\nusemtl atlas\n";
  for (const glm::vec3& near : scan.positions) {
    const glm::dvec3 p = glm::dvec3(near) + offset;
    out << fmt::format("v {} {} {}\n", p.x, p.y, p.z);
  }
  for (const glm::vec2& uv : scan.uvs) out << fmt::format("vt {} {}\n", uv.x, uv.y);
  for (std::size_t i = 0; i < scan.indices.size(); i += 3)
    out << fmt::format("f {0}/{0} {1}/{1} {2}/{2}\n", scan.indices[i] + 1, scan.indices[i + 1] + 1,
                       scan.indices[i + 2] + 1);
  std::ofstream(std::filesystem::path(file).replace_extension(".mtl"))
      << "newmtl atlas\nmap_Kd " << name << ".png\n";
  const std::vector<unsigned char> bytes = png_of(scan);
  std::ofstream(std::filesystem::path(file).replace_extension(".png"), std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

void write_textured_glb(const std::filesystem::path& file, const TaggedScan& scan) {
  GltfWriter gltf;
  std::vector<unsigned char> rgba;
  for (const std::uint8_t luma : scan.luma) rgba.insert(rgba.end(), {luma, luma, luma, 255});
  std::vector<glm::vec2> from_top = scan.uvs;
  for (glm::vec2& uv : from_top) uv.y = 1 - uv.y;
  const int texture = gltf.texture(scan.width, scan.height, rgba);
  const int material = gltf.add(
      "materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}});
  const int positions = gltf.positions(scan.positions), uvs = gltf.uvs(from_top);
  const int indices = gltf.indices({scan.indices.begin(), scan.indices.end()});
  gltf.root("scan", gltf.mesh({{"attributes", {{"POSITION", positions}, {"TEXCOORD_0", uvs}}},
                               {"indices", indices},
                               {"material", material}}));
  gltf.save(file);
}

void write_coloured_glb(const std::filesystem::path& file, const TaggedScan& scan) {
  GltfWriter gltf;
  std::vector<glm::vec3> linear;  // glTF 2.0, 3.7.2
  for (const std::uint8_t luma : scan.luma)
    linear.emplace_back(static_cast<float>(srgb_signal(luma / 255.0)));
  const int positions = gltf.positions(scan.positions), colours = gltf.positions(linear);
  const int indices = gltf.indices({scan.indices.begin(), scan.indices.end()});
  gltf.root("scan", gltf.mesh({{"attributes", {{"POSITION", positions}, {"COLOR_0", colours}}},
                               {"indices", indices}}));
  gltf.save(file);
}

void write_coloured_ply(const std::filesystem::path& file, const TaggedScan& scan) {
  std::ofstream out(file, std::ios::binary);
  out << "ply\nformat binary_little_endian 1.0\nelement vertex " << scan.positions.size()
      << "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty "
         "uchar green\nproperty uchar blue\nelement face "
      << scan.indices.size() / 3 << "\nproperty list uchar int vertex_indices\nend_header\n";
  for (std::size_t v = 0; v < scan.positions.size(); ++v) {
    out.write(reinterpret_cast<const char*>(&scan.positions[v]), sizeof(glm::vec3));
    for (int channel = 0; channel < 3; ++channel) out.put(static_cast<char>(scan.luma[v]));
  }
  for (std::size_t i = 0; i < scan.indices.size(); i += 3) {
    out.put(3);
    out.write(reinterpret_cast<const char*>(&scan.indices[i]), 3 * sizeof(unsigned));
  }
}

}  // namespace previz::test
