#include "daemon/control/status_words.hpp"

namespace previz::control {
namespace {

using Properties = std::map<std::string, std::string>;

// Returns a property's text; "" if it says nothing, as "", "no" and 0 do.
std::string known(const Properties& rig, const char* name) {
  const auto found = rig.find(name);
  if (found == rig.end()) return "";
  const std::string& text = found->second;
  return text == "no" || text == "0" || text == "0.0" ? "" : text;
}

// Joins the parts that are not empty.
std::string joined(const std::vector<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts)
    if (!part.empty()) text += (text.empty() ? "" : ", ") + part;
  return text;
}

std::string framed(const std::string& before, const std::string& text, const std::string& after) {
  return text.empty() ? "" : before + text + after;
}

// "1 frame dropped", "2 frames dropped"; "" of none.
std::string counted(const std::string& number, const std::string& noun,
                    const std::string& after = "") {
  return framed("", number, " " + noun + (number == "1" ? "" : "s") + after);
}

std::string mode_words(const Properties& rig) {
  const std::string mode = known(rig, "Mode");
  const std::string since = known(rig, "LoadingSeconds");
  if (mode == "loading") return "loading a set" + framed(" (since ", since, " s)");
  return joined({mode, known(rig, "Recording").empty() ? "" : "recording"});
}

std::string picture_words(const Properties& rig) {
  const std::string age = known(rig, "PictureSeconds");
  return joined({age.starts_with('-')                            ? "none shown yet"
                 : age.empty() && rig.contains("PictureSeconds") ? "shown just now"
                                                                 : framed("shown ", age, " s ago"),
                 counted(known(rig, "Samples"), "sample", " per pixel")});
}

std::string take_words(const Properties& rig) {
  const auto is = [&](const char* name) { return !known(rig, name).empty(); };
  const std::string name = known(rig, "Take");
  if (name.empty()) return "none yet";
  const std::string behind =
      joined({framed("", known(rig, "BehindSeconds"), " s behind the cameras"),
              framed("", known(rig, "BehindMegabytes"), " MB in memory")});
  return joined({name, is("TakeGood") ? "good" : "", framed("", known(rig, "TakeSeconds"), " s"),
                 counted(known(rig, "TakeFrames"), "frame"),
                 counted(known(rig, "TakeDropped"), "frame", " dropped"),
                 is("Recording") ? "being recorded"
                 : is("Writing") ? "still being written"
                                 : "",
                 behind});
}

// The rig's words about the model begin with it, for the display.
std::string model_words(std::string words) {
  for (const char* start : {"model: ", "model "})
    if (words.starts_with(start)) return words.substr(std::string(start).size());
  return words;
}

}  // namespace

std::vector<std::string> status_words(const Properties& rig) {
  const auto of = [&](const char* name) { return known(rig, name); };
  const bool is_loading = of("Mode") == "loading";
  const std::pair<const char*, std::string> lines[] = {
      {"mode", mode_words(rig)},
      {"set", of("Set")},
      {"the set that was asked for is not in use", of("SetProblem")},
      {"drawn by", of("Device")},
      {"picture", is_loading ? "" : picture_words(rig)},
      {"film camera", of("CameraLost").empty() ? "" : "lost, no picture comes"},
      {"take", take_words(rig)},
      {"the last take ended by itself", of("Fault")},
      {"selected", joined({framed("object ", of("Object"), ""), framed("lamp ", of("Light"), "")})},
      {"model", model_words(of("Model"))},
      {"last message", of("Message")}};
  std::vector<std::string> words;
  for (const auto& [name, text] : lines)
    if (!text.empty()) words.push_back(std::string(name) + ": " + text);
  return words;
}

}  // namespace previz::control
