#include "drivers/kms/cards.hpp"

#include <fcntl.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "drivers/error.hpp"

namespace previz::kms {
namespace {

std::string bus_of(const drmDevice& device) {
  if (device.bustype == DRM_BUS_PCI) {
    const drmPciBusInfo& pci = *device.businfo.pci;
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "%04x:%02x:%02x.%x", pci.domain, pci.bus, pci.dev,
                  pci.func);
    return name.data();
  }
  if (device.bustype == DRM_BUS_PLATFORM) return device.businfo.platform->fullname;
  return device.nodes[DRM_NODE_PRIMARY];
}

}  // namespace

std::vector<Card> find_cards() {
  constexpr int most = 64;
  std::array<drmDevicePtr, most> devices{};
  const int count = drmGetDevices2(0, devices.data(), most);
  std::vector<Card> cards;
  for (int i = 0; i < count; ++i) {
    const drmDevice& device = *devices[static_cast<std::size_t>(i)];
    if ((device.available_nodes & (1 << DRM_NODE_PRIMARY)) != 0)
      cards.push_back({device.nodes[DRM_NODE_PRIMARY], bus_of(device)});
  }
  if (count > 0) drmFreeDevices(devices.data(), count);
  return cards;
}

OwnedDescriptor open_card(const Card& card) {
  OwnedDescriptor descriptor(open(card.node.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK));
  if (!descriptor) throw Error(card.node + ": cannot be opened: " + std::strerror(errno));
  return descriptor;
}

std::vector<DrmOwned<drmModeConnector>> connectors_of(int card) {
  std::vector<DrmOwned<drmModeConnector>> connectors;
  const DrmOwned<drmModeRes> resources(drmModeGetResources(card));
  if (!resources) return connectors;  // a card without outputs
  for (int i = 0; i < resources->count_connectors; ++i)
    if (DrmOwned<drmModeConnector> connector{drmModeGetConnector(card, resources->connectors[i])})
      connectors.push_back(std::move(connector));
  return connectors;
}

std::string name_of(const drmModeConnector& connector) {
  const char* type = drmModeGetConnectorTypeName(connector.connector_type);
  return std::string(type ? type : "Unknown") + "-" + std::to_string(connector.connector_type_id);
}

bool is_meant(const std::string& wanted, const Card& card, const drmModeConnector& connector) {
  const std::string name = name_of(connector);
  return wanted == name || wanted == card.bus + "/" + name;
}

}  // namespace previz::kms
