// One clip in several files, as cameras write it that begin a new file every few minutes.
#include <cmath>
#include <utility>

#include "daemon/core/session/nominal_rate.hpp"
#include "daemon/core/session/timecode.hpp"
#include "daemon/tools/exchange/footage.hpp"
#include "daemon/tools/exchange/video_tags.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

class Chapters final : public Footage {
 public:
  Chapters(std::vector<std::filesystem::path> files, const ReadAs& read_as)
      : files_(std::move(files)), read_as_(read_as) {}

  // Frames and times go on where the file before ended, a frame later than its last one.
  std::optional<Picture> next() override {
    while (index_ < files_.size()) {
      if (!file_) file_ = open_video(files_[index_], read_as_);
      if (std::optional<Picture> picture = file_->next()) {
        if (shown_++ == 0) note_timecode();
        last_number_ = picture->number;
        if (picture->container_ns) times_.push_back(*picture->container_ns);
        picture->number += first_number_;
        if (picture->container_ns) *picture->container_ns += first_ns_;
        return picture;
      }
      end_file();
    }
    return std::nullopt;
  }

  std::uint64_t lost() const override { return lost_ + (file_ ? file_->lost() : 0); }
  std::optional<FileTimecode> timecode() const override { return timecode_; }
  std::vector<std::string> shape() const override {
    return file_ ? file_->shape() : std::vector<std::string>{};
  }
  std::vector<std::string> notes() const override { return notes_; }

 private:
  void end_file() {
    for (std::string& note : file_->notes()) notes_.push_back(std::move(note));
    const std::uint64_t in_file = shown_ + file_->lost();
    if (times_.size() > 1) rate_ = session::nominal_rate(times_);
    if (rate_.fps > 0 && !times_.empty())
      first_ns_ += times_.back() +
                   std::llround(static_cast<double>(in_file - last_number_) / rate_.fps * 1e9);
    first_number_ += in_file;
    lost_ += file_->lost();
    file_.reset();
    times_.clear();
    shown_ = 0;
    ++index_;
  }

  // Says where a file does not begin at the timecode at which the one before ends.
  void note_timecode() {
    const auto own = file_->timecode();
    if (index_ == 0) timecode_ = own;
    if (index_ == 0 || !own || !timecode_ || rate_.fps <= 0) return;
    const auto after = [&](const FileTimecode& timecode, std::int64_t frames) {
      const auto digits = session::timecode_after(
          {timecode.first, rate_.fps},
          timecode.frames + std::llround(timecode.seconds * rate_.fps) + frames);
      return digits ? session::words_of(*digits) : std::string();
    };
    const std::string begins = after(*own, 0);
    const auto expected = static_cast<std::int64_t>(first_number_);
    for (const int rounding : {0, -1, 1})
      if (begins == after(*timecode_, expected + rounding)) return;
    notes_.push_back(files_[index_].string() + ": begins at timecode " + begins + ", and " +
                     files_[index_ - 1].string() + " ends at " + after(*timecode_, expected) +
                     ": a file between them is missing, or their order is another");
  }

  std::vector<std::filesystem::path> files_;
  ReadAs read_as_;
  std::size_t index_ = 0;
  std::unique_ptr<Footage> file_;  // the one that is being read
  std::uint64_t first_number_ = 0, last_number_ = 0, shown_ = 0, lost_ = 0;
  std::int64_t first_ns_ = 0;
  std::vector<std::int64_t> times_;  // of the file's frames, in the file
  session::NominalRate rate_;
  std::optional<FileTimecode> timecode_;
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Footage> open_videos(std::vector<std::filesystem::path> files,
                                     const ReadAs& read_as) {
  if (files.size() == 1) return open_video(files.front(), read_as);
  return std::make_unique<Chapters>(std::move(files), read_as);
}

}  // namespace previz::exchange
