#include "daemon/tools/calibrate/lens/source.hpp"

#include <algorithm>

#include "daemon/core/session/files.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/tools/exchange/footage.hpp"
#include "daemon/tools/exchange/picture_header.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

namespace fs = std::filesystem;

class SessionPictures final : public PictureSource {
 public:
  SessionPictures(const fs::path& directory, const std::string& stream)
      : session_(session::open_session(directory)),
        reader_(session::open_stream(session_, stream)),
        name_(directory.string() + "/" + stream) {
    if (!reader_) throw Error(directory.string() + ": the session has no stream \"" + stream + '"');
  }

  std::optional<NamedFrame> next() override {
    if (index_ == reader_->records().size()) return std::nullopt;
    const std::string name = name_ + " frame " + std::to_string(index_);
    return NamedFrame{reader_->read(index_++), name};
  }
  std::optional<std::size_t> count() const override { return reader_->records().size(); }
  std::vector<std::string> notes() const override { return session_.missing; }

 private:
  session::Session session_;
  std::unique_ptr<session::StreamReader> reader_;
  std::string name_;
  std::size_t index_ = 0;
};

class FootagePictures final : public PictureSource {
 public:
  FootagePictures(std::unique_ptr<exchange::Footage> footage, std::optional<std::size_t> count)
      : footage_(std::move(footage)), count_(count) {}

  std::optional<NamedFrame> next() override {
    std::optional<exchange::Picture> picture = footage_->next();
    if (!picture) return std::nullopt;
    Frame frame;
    frame.sequence = index_++;
    frame.format = picture->format;
    frame.width = picture->width;
    frame.height = picture->height;
    frame.bytes = std::move(picture->bytes);
    return NamedFrame{std::make_shared<const Frame>(std::move(frame)), picture->name};
  }
  std::optional<std::size_t> count() const override { return count_; }
  std::vector<std::string> notes() const override { return footage_->notes(); }

 private:
  std::unique_ptr<exchange::Footage> footage_;
  std::optional<std::size_t> count_;
  std::uint64_t index_ = 0;
};

}  // namespace

bool is_session(const fs::path& path) {
  return fs::is_regular_file(path / "session.toml");
}

std::vector<fs::path> picture_files(const fs::path& folder) {
  std::vector<fs::path> files, others;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file())
      (exchange::is_picture_name(entry.path()) ? files : others).push_back(entry.path());
  std::ranges::sort(others);
  if (files.empty())
    for (const fs::path& file : others)
      if (const auto fault = exchange::picture_fault(file, session::read_beginning(file, 1 << 16));
          !fault.empty())
        throw Error(file.string() + ": " + fault);
  if (files.empty())
    throw Error(folder.string() +
                ": contains no pictures; allowed: PNG, JPEG, TIFF, WebP, DPX, OpenEXR");
  std::ranges::sort(files);
  return files;
}

std::unique_ptr<PictureSource> open_source(const fs::path& path, const std::string& stream) {
  if (is_session(path)) return std::make_unique<SessionPictures>(path, stream);
  if (fs::is_directory(path)) {
    auto files = picture_files(path);
    const std::size_t count = files.size();
    return std::make_unique<FootagePictures>(exchange::open_pictures(std::move(files)), count);
  }
  if (fs::is_regular_file(path))
    return std::make_unique<FootagePictures>(exchange::open_video(path), std::nullopt);
  throw Error(path.string() + ": not found; allowed: a session, a folder of pictures, a video");
}

}  // namespace previz::calibrate
