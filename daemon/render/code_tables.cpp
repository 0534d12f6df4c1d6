#include "daemon/render/code_tables.hpp"

#include <vector>

namespace previz::render {

CodeTables::CodeTables(Device& device, const lighting::Response& response) : bits(response.bits()) {
  const Purpose purpose(device, "the camera's response", "close other programs");
  const std::vector<double>& inverse = response.inverse();
  upload_storage(device, signal_of, std::vector<float>(inverse.begin(), inverse.end()));
  std::vector<float> least;
  for (std::size_t code = 0; code < inverse.size(); ++code)
    least.push_back(static_cast<float>(response.least_signal(static_cast<std::uint16_t>(code))));
  upload_storage(device, least_of, least);
}

void CodeTables::add_to(Buffers& buffers) const {
  buffers.insert({{"signal_of", &signal_of}, {"least_of", &least_of}});
}

}  // namespace previz::render
