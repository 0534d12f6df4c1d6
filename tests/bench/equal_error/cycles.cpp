#include "tests/bench/equal_error/cycles.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <glm/vec4.hpp>
#include <memory>
#include <sstream>

#include "drivers/error.hpp"

namespace previz::bench {
namespace {

namespace fs = std::filesystem;

std::string quoted(const fs::path& path) {
  std::string out = "'";
  for (const char c : path.string()) out += c == '\'' ? "'\\''" : std::string(1, c);
  return out + "'";
}

std::vector<CyclesRender> read_table(const fs::path& directory) {
  std::ifstream file(directory / "renders.csv");
  std::vector<CyclesRender> renders;
  std::string line;
  std::getline(file, line);  // names
  while (std::getline(file, line)) {
    for (char& c : line)
      if (c == ',' || c == '\r') c = ' ';
    std::istringstream row(line);
    CyclesRender render;
    std::string name;
    row >> render.samples >> render.cpu_s >> name;
    if (!row) throw Error((directory / "renders.csv").string() + ": cannot read '" + line + "'");
    render.file = directory / name;
    renders.push_back(render);
  }
  return renders;
}

struct Passes {
  std::vector<glm::vec4> combined;
  std::vector<glm::vec3> ratio;
};

Passes read_passes(const fs::path& path, int width, int height) {
  Imf::InputFile file(path.c_str());
  const Imath::Box2i window = file.header().dataWindow();
  const auto columns = static_cast<std::size_t>(width), rows = static_cast<std::size_t>(height);
  if (window.max.x - window.min.x + 1 != width || window.max.y - window.min.y + 1 != height)
    throw Error("is not " + std::to_string(width) + "x" + std::to_string(height));
  Passes passes{std::vector<glm::vec4>(columns * rows), std::vector<glm::vec3>(columns * rows)};
  Imf::FrameBuffer buffer;
  const auto add = [&](const std::string& channel, float* first, std::size_t stride) {
    if (file.header().channels().findChannel(channel) == nullptr)
      throw Error("has no channel '" + channel + "'");
    buffer.insert(channel, Imf::Slice::Make(Imf::FLOAT, first, window, stride, stride * columns));
  };
  const std::array<const char*, 4> names{"R", "G", "B", "A"};
  for (int c = 0; c < 4; ++c)
    add(std::string("ViewLayer.Combined.") + names[static_cast<std::size_t>(c)],
        &passes.combined[0][c], sizeof(glm::vec4));
  for (int c = 0; c < 3; ++c)
    add(std::string("ViewLayer.Shadow Catcher.") + names[static_cast<std::size_t>(c)],
        &passes.ratio[0][c], sizeof(glm::vec3));
  file.setFrameBuffer(buffer);
  file.readPixels(window.min.y, window.max.y);
  return passes;
}

}  // namespace

std::string blender_version(const std::string& blender) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> out(
      popen((blender + " --version").c_str(), "r"), pclose);
  std::array<char, 256> line{};
  if (!out || std::fgets(line.data(), line.size(), out.get()) == nullptr)
    throw Error("'" + blender + "' does not run");
  const std::string version = line.data();
  return version.substr(0, version.find_last_not_of(" \n") + 1);
}

std::vector<CyclesRender> render_with_cycles(const CyclesOptions& options,
                                             const std::vector<int>& samples, std::uint32_t seed,
                                             const fs::path& directory) {
  fs::create_directories(directory);
  std::ostringstream command;
  command << options.blender << " --background --factory-startup --python-exit-code 1 --python "
          << quoted(options.script) << " -- --set " << quoted(options.set) << " --frame "
          << options.frame << " --width " << options.width << " --seed " << seed << " --threads "
          << options.threads << " --out " << quoted(directory) << " --samples ";
  for (std::size_t i = 0; i < samples.size(); ++i) command << (i > 0 ? "," : "") << samples[i];
  const fs::path log = directory / "blender.log";
  command << " > " << quoted(log) << " 2>&1";
  if (std::system(command.str().c_str()) != 0)
    throw Error("Blender did not render; see " + log.string());
  return read_table(directory);
}

truth::EstimatedFrame read_shadow_catcher(const fs::path& file, const truth::TruthFrame& plate) {
  Passes passes;
  try {
    passes = read_passes(file, plate.width, plate.height);
  } catch (const std::exception& error) {
    throw Error(file.string() + ": " + error.what());
  }
  truth::EstimatedFrame estimate;
  estimate.real = plate.plate;
  for (std::size_t i = 0; i < passes.ratio.size(); ++i) {
    const float mask = passes.combined[i].a;
    const glm::vec3 caught = plate.plate[i] * passes.ratio[i];
    estimate.mask.push_back(mask);
    estimate.diff.push_back(caught - plate.plate[i]);
    estimate.mixed.push_back(glm::vec3(passes.combined[i]) + (1 - mask) * caught);
  }
  return estimate;
}

}  // namespace previz::bench
