// The colours of a scan: its textures, or the colours of its vertices, as grey pictures.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec2.hpp>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace previz::model {

struct ScanPicture {
  std::string name;
  int width = 0, height = 0;
  std::vector<std::uint8_t> luma;  // sRGB-encoded, row-major from the top
};

// The source of a triangle's colour is the index of a picture, or one of these.
inline constexpr int from_vertices = -1, colourless = -2;

struct ScanColours {
  std::vector<ScanPicture> pictures;
  std::vector<glm::vec2> uvs;      // of each vertex; (0, 0) is the lower left of the picture
  std::vector<std::uint8_t> luma;  // of each vertex, sRGB-encoded
  std::vector<int> sources;        // of each triangle
};

// Reads the textures of a scan, each once.
class ScanTextures {
 public:
  // `file` is the scan's; textures are in it, or in its folder. No path leads out of that folder.
  explicit ScanTextures(std::filesystem::path file) : file_(std::move(file)) {}

  // Both return the index of a picture. They throw previz::Error naming the scan and its texture:
  // it is missing, is no PNG, JPEG or WebP, is damaged, or is too large together with the others.
  int named(const std::string& written);  // a file, by the path that the scan has
  int encoded(std::span<const unsigned char> bytes, const std::string& name);

  // Returns where a file is that the scan names; nothing if it is not there. One that has another
  // name is noted.
  std::optional<std::filesystem::path> find(const std::string& written);

  std::vector<ScanPicture> take() { return std::move(pictures_); }
  void note(const std::string& text);  // each once
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  std::filesystem::path file_;
  std::map<std::string, int> used_;  // indices of pictures by their paths
  std::size_t texels_ = 0;
  std::vector<ScanPicture> pictures_;
  std::vector<std::string> notes_;
};

}  // namespace previz::model
