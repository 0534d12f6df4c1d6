// Graphics cards and what is plugged into them.
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
// Those that can drive a screen, open or not.
std::vector<Card> find_cards();

// Throws previz::Error naming the node.
OwnedDescriptor open_card(const Card& card);

// Those of an open card, asked anew what is plugged in.
std::vector<DrmOwned<drmModeConnector>> connectors_of(int card);

// "HDMI-A-1", as the kernel and every other tool calls it.
std::string name_of(const drmModeConnector& connector);

// Whether a set means this one: by its name, or by BUS/NAME where several cards have that name.
bool is_meant(const std::string& wanted, const Card& card, const drmModeConnector& connector);

}  // namespace previz::kms
