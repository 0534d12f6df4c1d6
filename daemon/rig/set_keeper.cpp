#include "daemon/rig/set_keeper.hpp"

#include <algorithm>
#include <vector>

#include "daemon/core/scene/load.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/file_edit.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/rig/errand.hpp"
#include "daemon/rig/kept_edits.hpp"
#include "drivers/error.hpp"

namespace previz::rig {

using report::Severity;

namespace {

// A set that is being read is waited for so long when the rig ends.
constexpr std::chrono::seconds end_patience{2};

// Reads a set from the text of its file; `changed` is left open.
LoadedSet loaded(std::string text, const std::filesystem::path& file,
                 const std::optional<std::filesystem::path>& with) {
  LoadedSet loaded;
  std::optional<set::Overlay> overlay;
  if (with) overlay = set::read_overlay(*with);
  loaded.set = set::parse_set(text, file, {}, set::Origin::crew, overlay);
  loaded.text = std::move(text);
  loaded.scene = scene::load_scene(loaded.set);
  return loaded;
}

}  // namespace

LoadedSet load_whole_set(const std::filesystem::path& file,
                         const std::optional<std::filesystem::path>& with) {
  std::error_code missing;  // reading the file gives a better error
  const auto changed = std::filesystem::last_write_time(file, missing);
  LoadedSet set = loaded(set::read_set_file(file), file, with);
  set.changed = changed;
  return set;
}

std::filesystem::path neighbour(const std::filesystem::path& file, int next) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".toml" && entry.is_regular_file())
      files.push_back(entry.path().filename());
  std::ranges::sort(files);
  const auto at = std::ranges::lower_bound(files, file.filename()) - files.begin();
  const auto count = static_cast<std::ptrdiff_t>(files.size());
  return count == 0
             ? file
             : file.parent_path() / files[static_cast<std::size_t>((at + next + count) % count)];
}

SetKeeper::SetKeeper(const std::filesystem::path& file, std::function<void(set::Set&)> override_set,
                     report::Reports& reports, std::optional<std::filesystem::path> with,
                     std::chrono::milliseconds patience)
    : override_set_(std::move(override_set)),
      with_(std::move(with)),
      patience_(patience),
      reports_(reports),
      running_(load_whole_set(file, with_)),
      file_(running_.changed) {
  override_set_(running_.set);
}

void SetKeeper::begin(std::function<Read()> read,
                      std::function<std::string(const std::string&)> refused) {
  refused_ = std::move(refused);
  begun_ = Clock::now();
  try {
    reading_ = sent_off(std::move(read));
  } catch (const std::exception&) {  // there is no thread for it
    std::promise<Read> promise;
    promise.set_exception(std::current_exception());
    reading_ = promise.get_future();
  }
}

// A thread that still reads is left to itself if its disk does not answer.
SetKeeper::~SetKeeper() {
  if (reading_.valid()) reading_.wait_for(end_patience);
}

std::optional<SetKeeper::Ended> SetKeeper::finish(std::chrono::milliseconds patience) {
  if (reading_.wait_for(patience) == std::future_status::timeout) {
    if (Clock::now() - begun_ < patience_) return std::nullopt;
    reading_ = {};
    next_.reset();
    return Ended{refused_("its files cannot be read: the disk does not respond")};
  }
  try {
    Read read = reading_.get();
    override_set_(read.set.set);
    next_ = std::move(read.set);
    if (!read.kept) return Ended{};
    changes_.kept = std::move(read.kept);
    reports_(
        {Severity::info, "keep",
         next_->set.file.string() + " has the changes; previous version: " + read.kept_beside});
    return Ended{};
  } catch (const std::exception& error) {
    next_.reset();
    return Ended{refused_(error.what())};
  }
}

std::string SetKeeper::drop_next(const std::string& why) {
  if (next_ && next_->set.file == running_.set.file) file_ = SetFileWatch(running_.changed);
  next_.reset();
  problem_ = why;
  reports_({Severity::warning, "", "the old set stays in use: " + why});
  return "the old set stays in use: " + why;
}

void SetKeeper::begin_change(int next) {
  begin(
      [file = running_.set.file, next, with = with_] {
        return Read{load_whole_set(next == 0 ? file : neighbour(file, next), with), {}, {}};
      },
      [this](const std::string& what) {
        const std::string first = problem_ = what.substr(0, what.find('\n'));
        reports_({Severity::error, "", what + "\nthe old set stays in use", "",
                  report::passing("the old set stays in use", first)});
        return "the old set stays in use: " + first;
      });
}

bool SetKeeper::look_at_file() {
  if (is_reading()) return false;
  if (!looked_.valid()) {
    looked_for_ = running_.set.file;
    looked_ = sent_off<std::optional<SetFileWatch::Time>>(
        [file = looked_for_]() -> std::optional<SetFileWatch::Time> {
          std::error_code gone;
          const auto time = std::filesystem::last_write_time(file, gone);
          return gone ? std::nullopt : std::optional(time);
        });
  }
  if (looked_.wait_for(std::chrono::milliseconds(0)) == std::future_status::timeout) return false;
  const std::optional<SetFileWatch::Time> time = looked_.get();
  if (!time || looked_for_ != running_.set.file || !file_.is_changed(*time)) return true;
  reports_({Severity::info, running_.set.file.string(), "the file has changed"});
  begin_change(0);
  return true;
}

void SetKeeper::begin_keep(const pipeline::Edits& edits) {
  const auto write = [set = running_.set, text_before = running_.text, edits, with = with_] {
    const std::filesystem::path& file = set.file;
    // What a symbolic link leads to is written, not the link.
    const std::filesystem::path target = std::filesystem::canonical(file);
    if (set::read_set_file(target) != text_before)
      throw Error(file.string() + " has changed since it was loaded; reload it first");
    const std::string text = with_edits(text_before, set, edits);
    if (text == text_before)
      throw Error("the changes have no effect; " + file.string() + " stays as it is");
    Read read{loaded(text, file, with), Kept{text_before, edits}, {}};
    read.kept_beside = set::keep_beside(target).string();
    session::replace_file(target, text);
    std::error_code missing;
    read.set.changed = std::filesystem::last_write_time(file, missing);
    return read;
  };
  begin(write, [this](const std::string& why) {
    reports_({Severity::error, "keep", why});
    return "not kept: " + why.substr(0, why.find('\n'));
  });
}

// Keeps the changes that were made to a set that is read again; those to another set end with it,
// and those that its file has by now are not made twice.
void SetKeeper::carry_edits() {
  const bool is_same = before_ && before_->set.file == running_.set.file;
  auto& [edits, kept] = changes_;
  const bool are_in_file = is_same && kept && running_.text != kept->text_before;
  if (are_in_file && edits != kept->edits)
    reports_({Severity::warning, "keep",
              "button changes made since the last keep are dropped: " + running_.set.file.string() +
                  " was reloaded"});
  if (!is_same || are_in_file) changes_ = {};
  for (const std::string& name : pipeline::drop_unknown(edits, running_.set))
    reports_({Severity::warning, "",
              "\"" + name +
                  "\" was changed by buttons but is no longer in the set; the change is "
                  "dropped"});
  for (const std::string& variant :
       pipeline::drop_unknown_variants(edits, running_.set, running_.scene))
    reports_({Severity::warning, "",
              "the variant " + variant +
                  " was chosen by buttons but is no longer in its file; the choice is dropped"});
}

void SetKeeper::run(LoadedSet set) {
  running_ = std::move(set);
  problem_.clear();
  file_ = SetFileWatch(running_.changed);
}

void SetKeeper::begin_next() {
  before_ = std::move(running_);
  changes_before_ = changes_;
  run(*std::exchange(next_, std::nullopt));
  carry_edits();
}

bool SetKeeper::go_back(const std::string& why) {
  if (!before_) return false;
  reports_(
      {Severity::error, "", why + "\nback to the previous set: " + before_->set.file.string()});
  // The same file is not tried again until it changes again.
  if (before_->set.file == running_.set.file) before_->changed = running_.changed;
  run(*std::exchange(before_, std::nullopt));
  problem_ = why.substr(0, why.find('\n'));
  changes_ = std::move(changes_before_);
  return true;
}

}  // namespace previz::rig
