// Finds graphics cards and what is plugged into them.
#pragma once

#include <string>
#include <vector>

#include "drivers/descriptor.hpp"
#include "drivers/kms/handles.hpp"

namespace previz::kms {

struct Card {
  std::string node;  // /dev/dri/card0
  std::string bus;   // where it is plugged in: "0000:01:00.0"
};
// Returns the cards that can drive a screen, whether or not they can be opened.
std::vector<Card> find_cards();

// Throws previz::Error naming the node.
OwnedDescriptor open_card(const Card& card);

// Returns the connectors of an open card, after probing anew what is plugged in.
std::vector<DrmOwned<drmModeConnector>> connectors_of(int card);

// Returns a connector's name as the kernel and every other tool writes it: "HDMI-A-1".
std::string name_of(const drmModeConnector& connector);

// Returns whether a set means this connector: by its name, or by BUS/NAME if several cards have
// that name.
bool is_meant(const std::string& wanted, const Card& card, const drmModeConnector& connector);

}  // namespace previz::kms
