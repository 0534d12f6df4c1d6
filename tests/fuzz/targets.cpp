#include "tests/fuzz/targets.hpp"

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "drivers/error.hpp"
#include "tests/support/temporary_directory.hpp"

namespace previz::fuzz {
namespace {

std::vector<Target> all_targets() {
  std::vector<Target> all;
  for (const std::span<const Target> some :
       {device_targets(), farm_targets(), footage_targets(), scene_targets(), session_targets(),
        take_targets(), v4l2_targets(), bus_targets(), video_targets()})
    all.insert(all.end(), some.begin(), some.end());
  return all;
}

}  // namespace

std::span<const Target> targets() {
  static const std::vector<Target> all = all_targets();
  return all;
}

const Target* find_target(std::string_view name) {
  for (const Target& target : targets())
    if (target.name == name) return &target;
  return nullptr;
}

bool accepts(const Target& target, Bytes bytes) {
  try {
    target.read(bytes);
    return true;
  } catch (const Error&) {
    return false;
  }
}

void expect(bool holds, const char* promise) {
  if (holds) return;
  std::fprintf(stderr, "BROKEN PROMISE: %s\n", promise);
  std::abort();
}

const std::filesystem::path& work_folder() {
  static const test::TemporaryDirectory directory;
  return directory.path();
}

std::filesystem::path file_of(Bytes bytes, const char* name) {
  std::filesystem::path file = work_folder() / name;
  std::ofstream(file, std::ios::binary | std::ios::trunc) << text_of(bytes);
  return file;
}

}  // namespace previz::fuzz
