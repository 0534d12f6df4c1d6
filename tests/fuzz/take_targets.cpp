// The folder of a take from elsewhere. The bytes say what somebody did to a small take: files that
// were cut, changed, removed or mixed, and links, pipes and folders in their places. Then all runs
// over it that opens takes of strangers. Nothing outside of the folder may be read into a copy,
// written or changed, and what only reads leaves the take itself as it is.
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <map>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/repair.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/session/summary.hpp"
#include "daemon/tools/post/take_copy.hpp"
#include "drivers/error.hpp"
#include "tests/fuzz/targets.hpp"
#include "tests/support/session_fixture.hpp"

namespace previz::fuzz {
namespace take_targets_cpp {

namespace fs = std::filesystem;

using Files = std::map<fs::path, std::string>;     // by their paths in a take
using Snapshot = std::map<fs::path, std::string>;  // what is there, in full

// The owner's take has these two in all of its files, so that they are found wherever they went.
const std::string owners_word = "what only its owner may read";
constexpr std::uint64_t owners_sequence = 7'777'777'777;

struct Places {
  fs::path root = work_folder() / "strangers";
  fs::path takes = root / "takes", take = takes / "12A_take001";
  fs::path owners = root / "owners";  // nobody may read or write it through links
  fs::path disk = root / "disk", copy = disk / "copy", repaired = disk / "repaired";
};

void write_take(const fs::path& take, const std::string& word, std::uint64_t first_sequence) {
  const fs::path object =
      file_of({reinterpret_cast<const std::uint8_t*>(word.data()), word.size()}, "object.glb");
  session::SessionInfo info;
  info.name = word;
  info.set_text = "[set]\nname = \"small\"\n";
  info.take = session::TakeInfo{3, "12A", "14:03:27:12", 25, word, false};
  session::SessionWriter writer(take, info);
  writer.add_asset("object.glb", object);
  for (const char* source : {"observer", "light", "composite"})
    for (std::uint64_t i = 0; i < 3; ++i) {
      Frame frame = session::noise_frame(source, i, PixelFormat::rgb8, 16, 8);
      frame.sequence = first_sequence + i;
      writer.write(frame);
    }
  session::TrackRecord record;
  record.scene.variants[word] = "red";
  writer.write(record);
  writer.write(ButtonEvent{word, true, 5});
  writer.write_event(6, word);
  writer.close();
}

Files files_of(const fs::path& take) {
  Files files;
  for (const fs::path& file : session::own_files(take))
    files[file] = session::content_of(take / file);
  return files;
}

const Files& small_take() {
  static const Files files = [] {
    const Places places;
    fs::remove_all(places.root);
    write_take(places.owners, owners_word, owners_sequence);
    write_take(places.root / "small", "small", 100);
    return files_of(places.root / "small");
  }();
  return files;
}

// Describes everything below a folder, its times included, and follows no link.
Snapshot snapshot_of(const fs::path& folder) {
  Snapshot all;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    struct stat status {};
    expect(::lstat(entry.path().c_str(), &status) == 0, "what is listed is there");
    std::string& words = all[entry.path()];
    words = std::to_string(status.st_mode) + " " + std::to_string(status.st_mtim.tv_sec) + "." +
            std::to_string(status.st_mtim.tv_nsec) + " ";
    if (S_ISLNK(status.st_mode)) words += fs::read_symlink(entry.path()).string();
    if (S_ISREG(status.st_mode)) words += session::content_of(entry.path());
  }
  return all;
}

// ---- what was done to the take

fs::path file_chosen(Choices& choices) {
  static const std::vector<fs::path> files = [] {
    std::vector<fs::path> names{"assets", "SHA256SUMS", ".recording", "session.toml.part"};
    for (const auto& [file, content] : small_take()) names.push_back(file);
    names.emplace_back("assets/" + std::string(64, 'a') + ".glb");
    names.emplace_back("assets/" + std::string(64, 'b') + ".g\nlb");
    names.emplace_back(std::string(255, 'n'));
    names.emplace_back("\xff\xfe.mkv");
    names.emplace_back("a\nline.jsonl");
    return names;
  }();
  return files[choices.byte() % files.size()];
}

std::string text_chosen(Choices& choices) {
  const std::size_t wanted = choices.byte();
  const Bytes text = choices.rest().first(std::min(wanted, choices.rest().size()));
  choices = Choices(choices.rest().subspan(text.size()));
  return text_of(text);
}

void edit(const fs::path& file, const std::function<void(std::string&)>& change) {
  if (!session::why_not_plain(file).empty() || !fs::exists(file)) return;
  std::string content = session::content_of(file);
  change(content);
  session::write_content(file, content);
}

void cut_or_zero(const fs::path& file, Choices& choices) {
  const std::uint8_t kind = choices.byte();
  edit(file, [&](std::string& content) {
    const std::size_t at = content.size() * choices.byte() / 256;
    const std::size_t length = std::min<std::size_t>(choices.byte() * 4u, content.size() - at);
    if (kind % 3 == 0) content.resize(at);
    if (kind % 3 == 1) std::fill_n(content.begin() + static_cast<std::ptrdiff_t>(at), length, '\0');
    if (kind % 3 == 2) content.replace(at, length, text_chosen(choices));
  });
}

// Puts something that is no file in the place of one.
void put_stranger(const Places& places, const fs::path& file, Choices& choices) {
  const fs::path place = places.take / file;
  std::error_code impossible;  // as below a file
  fs::remove_all(place, impossible);
  const fs::path targets[] = {places.owners / file,
                              places.owners / "session.toml",
                              places.owners / "new",
                              places.take / "events.jsonl",
                              place,
                              "..",
                              "/dev/zero",
                              "/dev/full",
                              "../../owners/observer.mkv"};
  switch (choices.byte() % 4) {
    case 0:
      fs::create_directory(place, impossible);
      break;
    case 1:
      ::mkfifo(place.c_str(), 0600);
      break;
    default:
      fs::create_symlink(targets[choices.byte() % std::size(targets)], place, impossible);
  }
}

// Changes words that chance would take long to find.
void change_word(const fs::path& file, Choices& choices) {
  static constexpr std::array<std::string_view, 2> words[] = {
      {"closed = true", "closed = false"},
      {"format_version = 1", "format_version = 2"},
      {"format_version = 1", "format_version = 3"},
      {"assets/", "../../owners/assets/"},
      {"assets/", "/dev/"},
      {"\"rgb8\"", "\"gray16\""},
      {"\"ffv1\"", "\"raw\""},
      {"\"frame\":1", "\"frame\":18446744073709551615"},
      {"\"frame\":1", "\"frame\":0"},
      {"\"timestamp_ns\":1", "\"timestamp_ns\":-9"},
      {"\"video_ms\":40", "\"video_ms\":0"},
      {"width = 16", "width = 65535"},
  };
  const std::array<std::string_view, 2>& word = words[choices.byte() % std::size(words)];
  edit(file, [&](std::string& content) {
    const std::size_t at = content.find(word[0]);
    if (at != std::string::npos) content.replace(at, word[0].size(), word[1]);
  });
}

void damage(const Places& places, Choices& choices) {
  const std::uint8_t kind = choices.byte();
  const fs::path name = file_chosen(choices), file = places.take / name;
  if (fs::is_symlink(file.parent_path())) return;  // it would be done to the owner's files
  std::error_code impossible;
  switch (kind % 7) {
    case 0:
      fs::remove_all(file, impossible);
      break;
    case 1:
      put_stranger(places, name, choices);
      break;
    case 2:
      change_word(file, choices);
      break;
    case 3:  // one file in the place of another
      fs::remove_all(file, impossible);
      fs::copy(places.take / file_chosen(choices), file, fs::copy_options::copy_symlinks,
               impossible);
      break;
    case 4: {  // a file with this text
      const std::string text = text_chosen(choices);
      if (session::why_not_plain(file).empty() && fs::is_directory(file.parent_path()))
        session::write_content(file, text);
      break;
    }
    case 5:
      edit(file, [&](std::string& content) { content += text_chosen(choices); });
      break;
    default:
      cut_or_zero(file, choices);
  }
}

void make_damaged_take(const Places& places, Choices choices) {
  fs::remove_all(places.takes);
  fs::remove_all(places.disk);
  fs::create_directories(places.disk);
  for (const auto& [file, content] : small_take())
    session::write_content(places.take / file, content);
  for (int times = 0; times < 8 && !choices.rest().empty(); ++times) damage(places, choices);
}

// ---- what opens it

// Does what a stranger's take may be refused for, and returns whether it was not.
bool attempt(const std::function<void()>& action) {
  try {
    action();
    return true;
  } catch (const Error&) {
    return false;
  }
}

// Returns what is damaged, as `previz takes check` finds it.
std::vector<std::string> check(const fs::path& take) {
  session::Session opened = session::open_session(take);
  for (const char* source : {"observer", "light", "composite"}) {
    const auto stream = session::open_stream(opened, source);
    for (std::size_t i = 0; stream && i < std::min<std::size_t>(stream->records().size(), 4); ++i)
      attempt([&] { stream->read(i); });
  }
  for (const std::string& fault : post::checksum_faults(take, {})) opened.missing.push_back(fault);
  return opened.missing;
}

void expect_nothing_of_the_owner(const fs::path& folder) {
  for (const auto& [path, words] : snapshot_of(folder)) {
    const fs::file_type type = fs::symlink_status(path).type();
    expect(type == fs::file_type::regular || type == fs::file_type::directory,
           "what is written consists of files");
    expect(words.find(owners_word) == std::string::npos &&
               words.find(std::to_string(owners_sequence)) == std::string::npos,
           "nothing of another's files is in what is written");
  }
}

// Looks at a take as the list of takes does, which would bring the whole recorder along.
void list(const Places& places) {
  session::summary_of(places.take);
  session::strangers_in(places.take);
  session::is_being_written(places.take);
}

void copy(const Places& places) {
  output::ListedTake take;
  take.directory = places.take;
  if (!attempt([&] { post::copy_take(take, places.copy, {}); })) {
    expect(fs::is_empty(places.disk), "a copy that fails leaves nothing");
    return;
  }
  for (const fs::path& file : session::own_files(places.take))
    expect(session::content_of(places.take / file) == session::content_of(places.copy / file),
           "a copy is as its take");
  try {
    expect(post::checksum_faults(places.copy, {}).empty(), "a copy has its checksums");
  } catch (const Error& error) {
    expect(false, error.what());
  }
}

void repair(const Places& places) {
  session::Repair made;
  fs::remove_all(places.copy);
  if (!attempt([&] { made = session::repair_session(places.take, places.repaired); })) {
    expect(fs::is_empty(places.disk), "a repair that fails leaves nothing");
    return;
  }
  try {
    session::Session repaired = session::open_session(places.repaired);
    const auto observer = session::open_stream(repaired, "observer");
    expect((observer ? observer->records().size() : 0) == made.frames,
           "a repaired take has the frames reported");
  } catch (const Error& error) {
    expect(false, error.what());
  }
}

bool is_owners_word_in(const Snapshot& take) {
  return std::ranges::any_of(take, [](const auto& entry) {
    return entry.second.find(owners_word) != std::string::npos ||
           entry.second.find(std::to_string(owners_sequence)) != std::string::npos;
  });
}

void take_folder(Bytes bytes) {
  const Places places;
  small_take();
  make_damaged_take(places, Choices(bytes));
  const Snapshot owners = snapshot_of(places.owners), takes = snapshot_of(places.takes);
  const bool is_mixed = is_owners_word_in(takes);  // the bytes themselves spell it

  std::vector<std::string> faults;
  attempt([&] { list(places); });
  const bool is_open = attempt([&] { faults = check(places.take); });
  attempt([&] { copy(places); });
  if (!is_mixed) expect_nothing_of_the_owner(places.disk);
  if (!is_open || !faults.empty()) repair(places);
  if (!is_mixed) expect_nothing_of_the_owner(places.disk);
  expect(snapshot_of(places.takes) == takes, "what reads a take leaves it as it is");

  attempt([&] {  // as a daemon does that starts
    session::remove_dead_drafts(places.takes);
    if (session::salvage(places.take)) session::remove_dead_drafts(places.take);
  });
  attempt([&] {
    session::change_take(places.take, [](session::TakeInfo& take) { take.good = true; });
    post::write_checksum(places.take, "session.toml");
  });
  expect(snapshot_of(places.owners) == owners, "nothing of another's files is changed");
  if (!is_open) throw Error("the take cannot be opened");
}

constexpr Target own[] = {
    {"take_folder", "what was done to the folder of a take", take_folder},
};

}  // namespace take_targets_cpp

std::span<const Target> take_targets() {
  return take_targets_cpp::own;
}

}  // namespace previz::fuzz
