#include "daemon/core/scene/gltf_decoding.hpp"

#include <utility>

#include "drivers/error.hpp"

namespace previz::scene {

void DecodingLimit::add(std::uint64_t compressed, std::uint64_t decoded, const std::string& where) {
  if (compressed > compressed_left_)
    throw Error(where +
                ": more is compressed than its buffers hold: compressed parts overlap; export the "
                "file again");
  if (decoded > decoded_left_)
    throw Error(where + ": the file would have more than 4 GiB when decompressed");
  compressed_left_ -= compressed;
  decoded_left_ -= decoded;
}

int add_view(tinygltf::Model& model, std::vector<unsigned char> bytes) {
  tinygltf::BufferView view;
  view.buffer = static_cast<int>(model.buffers.size());
  view.byteLength = bytes.size();
  model.buffers.emplace_back().data = std::move(bytes);
  model.bufferViews.push_back(std::move(view));
  return static_cast<int>(model.bufferViews.size()) - 1;
}

}  // namespace previz::scene
