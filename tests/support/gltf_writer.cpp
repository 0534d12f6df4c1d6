#include "tests/support/gltf_writer.hpp"

#include <spng.h>

#include <cstdlib>
#include <fstream>
#include <memory>
#include <span>
#include <stdexcept>
#include <string_view>

#include "daemon/core/session/files.hpp"

namespace previz::test {
namespace {

void append_u32(std::string& bytes, std::size_t value) {
  for (int shift = 0; shift < 32; shift += 8)
    bytes.push_back(static_cast<char>(value >> shift & 0xff));
}

void append_chunk(std::string& file, const char* type, std::string data, char padding) {
  while (data.size() % 4 != 0) data.push_back(padding);
  append_u32(file, data.size());
  file.append(type, 4).append(data);
}

}  // namespace

int GltfWriter::add(const char* what, Json value) {
  // The meshes of tests are mostly open, and their backs are not what a test is about.
  if (what == std::string_view("materials") && !value.contains("doubleSided"))
    value["doubleSided"] = true;
  json[what].push_back(std::move(value));
  return static_cast<int>(json[what].size()) - 1;
}

int GltfWriter::view(const std::vector<unsigned char>& bytes, int stride) {
  while (buffer_.size() % 4 != 0) buffer_.push_back(0);
  Json view = {{"buffer", 0}, {"byteOffset", buffer_.size()}, {"byteLength", bytes.size()}};
  if (stride > 0) view["byteStride"] = stride;
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  return add("bufferViews", std::move(view));
}

int GltfWriter::accessor(int view, int component_type, const char* type, std::size_t count,
                         bool normalized, std::size_t offset) {
  Json accessor = {{"componentType", component_type}, {"type", type}, {"count", count}};
  if (view >= 0) accessor["bufferView"] = view;
  if (normalized) accessor["normalized"] = true;
  if (offset > 0) accessor["byteOffset"] = offset;
  return add("accessors", std::move(accessor));
}

int GltfWriter::triangle_mesh(int material) {
  Json primitive = {{"attributes", {{"POSITION", positions({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}})}}}};
  if (material >= 0) primitive["material"] = material;
  return mesh(std::move(primitive), "triangle");
}

GltfWriter::Json GltfWriter::animation(int node, const char* path,
                                       const std::vector<float>& times_s, int output) {
  const int input = values(5126, "SCALAR", times_s);
  return {{"channels", {{{"sampler", 0}, {"target", {{"node", node}, {"path", path}}}}}},
          {"samplers", {{{"input", input}, {"output", output}}}}};
}

int GltfWriter::root(const char* name, int mesh, Json more) {
  more["name"] = name;
  if (mesh >= 0) more["mesh"] = mesh;
  const int node = add("nodes", std::move(more));
  json["scenes"][0]["nodes"].push_back(node);
  return node;
}

int GltfWriter::texture(int width, int height, const std::vector<unsigned char>& rgba,
                        Json sampler) {
  const int image =
      add("images", {{"bufferView", view(png(width, height, rgba))}, {"mimeType", "image/png"}});
  return add("textures", {{"source", image}, {"sampler", add("samplers", std::move(sampler))}});
}

void GltfWriter::save(const std::filesystem::path& path) const {
  Json saved = json;
  const bool is_binary = path.extension() == ".glb";
  if (!buffer_.empty()) {
    saved["buffers"][0] = {{"byteLength", buffer_.size()}};
    if (!is_binary)
      saved["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64(buffer_);
  }
  std::string bytes = saved.dump();
  if (is_binary) {
    std::string chunks;
    append_chunk(chunks, "JSON", bytes, ' ');
    if (!buffer_.empty())
      append_chunk(chunks, "BIN\0", std::string(buffer_.begin(), buffer_.end()), '\0');
    bytes = "glTF";
    append_u32(bytes, 2);
    append_u32(bytes, 12 + chunks.size());
    bytes += chunks;
  }
  std::ofstream stream(path, std::ios::binary);
  stream << bytes;
  if (!stream.flush()) throw std::runtime_error("cannot write " + path.string());
}

std::string base64(const std::vector<unsigned char>& bytes) {
  return session::base64(std::as_bytes(std::span(bytes)));
}

std::vector<unsigned char> png(int width, int height, const std::vector<unsigned char>& rgba) {
  const std::unique_ptr<spng_ctx, void (*)(spng_ctx*)> png(spng_ctx_new(SPNG_CTX_ENCODER),
                                                           spng_ctx_free);
  spng_ihdr header{};
  header.width = static_cast<std::uint32_t>(width);
  header.height = static_cast<std::uint32_t>(height);
  header.bit_depth = 8;
  header.color_type = SPNG_COLOR_TYPE_TRUECOLOR_ALPHA;
  spng_set_ihdr(png.get(), &header);
  spng_set_option(png.get(), SPNG_ENCODE_TO_BUFFER, 1);
  int code =
      spng_encode_image(png.get(), rgba.data(), rgba.size(), SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE);
  std::size_t size = 0;
  const std::unique_ptr<void, void (*)(void*)> bytes(spng_get_png_buffer(png.get(), &size, &code),
                                                     std::free);
  if (!bytes) throw std::runtime_error("cannot encode a PNG");
  const auto* begin = static_cast<const unsigned char*>(bytes.get());
  return {begin, begin + size};
}

}  // namespace previz::test
