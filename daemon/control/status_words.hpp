// Puts what the rig publishes on the bus into words for people.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace previz::control {

// Returns lines such as "take: 12A_take003, good, 4.8 s, 120 frames". `properties` are those of
// org.previz.Rig1 as text: "yes" or "no", numbers, names. What is missing is left out.
std::vector<std::string> status_words(const std::map<std::string, std::string>& properties);

}  // namespace previz::control
