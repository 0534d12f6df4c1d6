#include "daemon/tools/post/takes.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <ostream>
#include <string>

#include "daemon/core/output/take_list.hpp"
#include "daemon/core/report/printable.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/repair.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/tools/post/render_folder.hpp"
#include "daemon/tools/post/take_copy.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

namespace fs = std::filesystem;
using output::ListedTake;

Paths folders_of(const Paths& places) {
  Paths folders;
  for (const fs::path& place : places) {
    if (fs::is_directory(place)) {
      folders.push_back(place);
    } else if (fs::is_regular_file(place)) {
      const set::Recording recording = set::load_set(place).recording;
      folders.push_back(recording.directory);
      if (recording.second_directory) folders.push_back(*recording.second_directory);
    } else {
      throw Error(place.string() +
                  ": not found; give a folder of takes, or a set file whose "
                  "recording.directory holds them");
    }
  }
  return folders;
}

std::string size_words(std::uintmax_t bytes) {
  std::array<char, 32> text{};
  const double value = static_cast<double>(bytes);
  if (value >= 1e9)
    std::snprintf(text.data(), text.size(), "%.1f GB", value / 1e9);
  else
    std::snprintf(text.data(), text.size(), "%.1f MB", value / 1e6);
  return text.data();
}

std::string length_words(double seconds) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%d:%04.1f", static_cast<int>(seconds / 60),
                seconds - 60 * static_cast<int>(seconds / 60));
  return text.data();
}

std::string what_it_lacks(const ListedTake& take) {
  if (!take.fault.empty()) return take.fault;
  std::string text;
  const session::Summary& summary = take.summary;
  if (take.may_be_in_recording)
    add_to_list(text, "being recorded");
  else if (!summary.fault.empty())
    add_to_list(text, summary.fault);
  else if (!summary.closed)
    add_to_list(text, "cut off");
  for (const std::string& words : session::words_of(summary.lost))
    add_to_list(text, "lost " + words);
  for (const std::string& stranger : take.strangers) add_to_list(text, stranger);
  if (summary.info.take && !summary.info.take->notes.empty())
    add_to_list(text, "notes: " + summary.info.take->notes);
  return text;
}

using Row = std::array<std::string, 8>;

Row row_of(const ListedTake& take) {
  const session::Summary& summary = take.summary;
  Row row;
  row[0] = take.directory.filename().string();
  row[5] = size_words(take.bytes);
  row[7] = what_it_lacks(take);
  if (!take.fault.empty()) return row;
  const session::TakeInfo info = summary.info.take.value_or(session::TakeInfo{});
  row[1] = info.good ? "good" : "";
  row[2] = length_words(summary.seconds);
  row[3] = std::to_string(summary.frames);
  if (const auto timecode = session::timecode_of(summary.info)) row[4] = timecode->first;
  const auto rendered = rendered_frames(take);
  row[6] = !rendered                     ? "?"
           : *rendered == 0              ? ""
           : *rendered >= summary.frames ? "all"
                                         : std::to_string(*rendered);
  return row;
}

// Says something of a take, whose name and files may be anybody's.
void say(const fs::path& take, const std::string& what, std::ostream& out) {
  out << on_one_line(take.string() + ": " + what) << std::endl;
}

void print(const std::vector<Row>& rows, std::ostream& out) {
  std::array<std::size_t, std::tuple_size_v<Row>> widths{};
  for (const Row& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i)
      line += row[i] + std::string(widths[i] - row[i].size() + 2, ' ');
    line.erase(line.find_last_not_of(' ') + 1);
    out << line << '\n';
  }
}

// Returns the takes if each can be changed or read as a whole now.
std::vector<ListedTake> takes_at_rest(const Paths& directories) {
  std::vector<ListedTake> takes;
  for (const fs::path& directory : directories) {
    takes.push_back(output::listed_take(directory));
    if (takes.back().may_be_in_recording)
      throw Error(takes.back().directory.string() +
                  ": is being recorded; end the take first (`previzctl record off`), or start the "
                  "rig once if its computer crashed during the take");
  }
  return takes;
}

void count_rest(const fs::path& directory, std::string& rest) {
  for (const auto& entry : fs::directory_iterator(directory))
    add_to_list(rest, entry.path().filename().string());
}

void delete_file(const fs::path& file) {
  std::error_code failure;
  fs::remove(file, failure);
  if (failure) throw Error(file.string() + ": cannot be deleted: " + failure.message());
}

// The folder counts as a take until the last file is gone, so that a deletion that was interrupted
// can be repeated.
void delete_take(const ListedTake& take, std::ostream& out) {
  const fs::path& directory = take.directory;
  for (const fs::path& file : session::own_files(directory))
    if (file != "session.toml") delete_file(directory / file);
  delete_file(directory / checksums_name);
  std::error_code unknown;
  if (!fs::is_symlink(directory / "assets") && fs::is_empty(directory / "assets", unknown))
    delete_file(directory / "assets");
  delete_file(directory / "session.toml");
  std::string rest;
  count_rest(directory, rest);
  if (rest.empty()) delete_file(directory);
  session::sync_names(fs::absolute(directory).parent_path());
  out << directory.string() << ": deleted, " << size_words(take.bytes)
      << (rest.empty() ? "" : "; kept, because not part of the take: " + rest) << '\n';
}

}  // namespace

void list_takes(const Paths& places, std::ostream& out) {
  const std::vector<ListedTake> takes = output::list_takes(folders_of(places));
  if (takes.empty()) {
    out << "no takes\n";
    return;
  }
  std::vector<Row> rows{{"take", "good", "length", "frames", "timecode", "size", "rendered", ""}};
  for (const ListedTake& take : takes) {
    rows.push_back(row_of(take));
    for (std::string& cell : rows.back()) cell = on_one_line(cell);
  }
  print(rows, out);
}

void mark_takes(const Paths& takes, bool good, std::ostream& out) {
  const std::vector<ListedTake> all = takes_at_rest(takes);
  for (const ListedTake& take : all)
    if (!take.fault.empty()) throw Error(take.fault);
  for (const ListedTake& take : all) {
    session::change_take(take.directory, [&](session::TakeInfo& info) { info.good = good; });
    if (fs::exists(fs::symlink_status(take.directory / checksums_name)))
      write_checksum(take.directory, "session.toml");
    say(take.directory, good ? "good" : "not good", out);
  }
}

namespace {

// The faults of a take, in words.
struct Faults {
  std::vector<std::string> damage;  // what is not as it was recorded
  std::vector<std::string> lost;    // what the rig lost while it recorded, and nothing brings back
};

// Reads a take from end to end.
Faults faults_of(const fs::path& take, const std::stop_token& stop) {
  Faults faults;
  try {
    session::Session session = session::open_session(take, stop);
    for (const char* stream : {"observer", "light", "composite"})
      static_cast<void>(session::open_stream(session, stream, stop));
    faults.lost = session.lost;
    std::ranges::copy_if(session.missing, std::back_inserter(faults.damage),
                         [&](const std::string& what) {
                           return std::ranges::find(faults.lost, what) == faults.lost.end();
                         });
    for (const std::string& fault : checksum_faults(take, stop)) faults.damage.push_back(fault);
  } catch (const Error& error) {
    if (stop.stop_requested()) throw;
    faults.damage.emplace_back(error.what());
  }
  return faults;
}

}  // namespace

int check_takes(const Paths& takes, std::ostream& out, const std::stop_token& stop) {
  bool is_damaged = false, is_incomplete = false;
  for (const ListedTake& take : takes_at_rest(takes)) {
    Faults faults = faults_of(take.directory, stop);
    // What could not be read a moment ago, and now can, is a disk that begins to fail.
    if (faults.damage.empty()) faults.damage = take.strangers;
    if (faults.damage.empty() && !take.fault.empty()) faults.damage.push_back(take.fault);
    for (const auto* kind : {&faults.damage, &faults.lost})
      for (const std::string& fault : *kind) say(take.directory, fault, out);
    const std::string frames = set::plural(take.summary.frames, "frame");
    if (!faults.damage.empty())
      is_damaged = true;
    else if (!faults.lost.empty())
      say(take.directory, "incomplete since it was recorded, and not damaged, " + frames, out);
    else
      say(take.directory, "whole, " + frames, out);
    is_incomplete |= !faults.lost.empty();
  }
  return is_damaged ? damaged_status : is_incomplete ? incomplete_status : 0;
}

int repair_takes(const RepairOptions& options, std::ostream& out, const std::stop_token& stop) {
  const std::vector<ListedTake> takes = takes_at_rest(options.takes);
  for (const ListedTake& take : takes)
    if (const fs::path place = options.folder / take.directory.filename(); fs::exists(place))
      throw Error(
          place.string() +
          ": already exists; repair into another folder, or remove it; nothing was written");
  int result = 0;
  for (const ListedTake& take : takes) {
    if (!take.fault.empty()) throw Error(take.fault);
    if (faults_of(take.directory, stop).damage.empty()) {
      say(take.directory, "nothing to repair", out);
      continue;
    }
    session::make_folders(options.folder);
    const fs::path place = options.folder / take.directory.filename();
    const session::Repair repair = session::repair_session(take.directory, place, stop);
    for (const std::string& what : repair.lacked) say(take.directory, what, out);
    say(place,
        "repaired, " + set::plural(repair.frames, "frame") +
            (repair.is_complete ? ", nothing is lost" : "; what is lost is in its session.toml"),
        out);
    for (const std::string& fault : faults_of(place, stop).damage) say(place, fault, out);
    if (!repair.is_complete) result = 1;
  }
  return result;
}

int copy_takes(const CopyOptions& options, std::ostream& out, const std::stop_token& stop) {
  int result = 0;
  const std::vector<ListedTake> takes = takes_at_rest(options.takes);
  session::make_folders(options.folder);
  for (const ListedTake& take : takes) {
    const fs::path copy = options.folder / take.directory.filename();
    const bool was_made = copy_take(take, copy, stop);
    say(copy, was_made ? size_words(take.bytes) + ", checked" : "already copied", out);
    // The bytes are the same; whether they are a whole take is another question.
    for (const std::string& fault : faults_of(copy, stop).damage) {
      say(copy, "the take itself is damaged, not by copying: " + fault, out);
      result = 1;
    }
  }
  return result;
}

void delete_takes(const Paths& takes, bool also_good, std::ostream& out) {
  for (const fs::path& take : takes)
    if (fs::is_symlink(output::named(take)))
      throw Error(output::named(take).string() + ": is a link to " +
                  fs::read_symlink(output::named(take)).string() + "; name the take itself");
  const std::vector<ListedTake> all = takes_at_rest(takes);
  for (const ListedTake& take : all)
    if (!also_good && take.summary.info.take && take.summary.info.take->good)
      throw Error(take.directory.string() +
                  ": is marked good; add --good to delete it anyway, or remove the mark "
                  "with `previz takes mark --not`; nothing was deleted");
  for (const ListedTake& take : all) delete_take(take, out);
}

}  // namespace previz::post
