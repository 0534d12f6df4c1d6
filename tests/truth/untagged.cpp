#include "tests/truth/untagged.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "daemon/core/lighting/linear_picture.hpp"
#include "drivers/error.hpp"

namespace previz::truth {
namespace {

// The composite's edge of a tag is not blurred as the truth's is within so many pixels of it; the
// bands that are compared are so wide.
constexpr int blurred_px = 2, band_px = 6;

std::filesystem::path file_of(const TruthSet& set, int frame, const char* what) {
  return set.directory / "truth" / (frame_name(frame) + "_" + what + ".exr");
}

render::Sheet<glm::vec3> read(const TruthSet& set, int frame, const char* what) {
  const auto file = file_of(set, frame, what);
  std::vector<std::string> notes;
  const lighting::LinearPicture picture = lighting::read_exr_picture(file, notes);
  const PinholeIntrinsics& lens = set.observer.intrinsics;
  if (picture.width != lens.width || picture.height != lens.height)
    throw Error(file.string() + ": is not of the observer's size");
  return {picture.radiance.begin(), picture.radiance.end()};
}

double brightness(const glm::vec3& radiance) {
  return (radiance.r + radiance.g + radiance.b) / 3.0;
}

// The tags of a picture, each with a number from 1 on; 0 is no tag.
class Labels {
 public:
  Labels(std::span<const glm::vec3> paper, int width, int height)
      : width_(width), height_(height), labels_(paper.size()) {
    for (std::size_t i = 0; i < paper.size(); ++i)
      if (paper[i].x > 0.5f && labels_[i] == 0) fill(paper, i, ++count_);
  }

  int count() const { return count_; }
  // Returns the label of the nearest tag's pixels within band_px + blurred_px, and how far off its
  // outline a pixel is, px: below 0 inside.
  struct Near {
    int label = 0;
    double outside_px = 0;
  };
  Near near(std::size_t pixel) const {
    const int own = labels_[pixel], reach = band_px + blurred_px;
    Near result{own, own > 0 ? -1e9 : 1e9};
    const int x = int(pixel) % width_, y = int(pixel) / width_;
    for (int dy = -reach; dy <= reach; ++dy)
      for (int dx = -reach; dx <= reach; ++dx) {
        if (x + dx < 0 || y + dy < 0 || x + dx >= width_ || y + dy >= height_) continue;
        const int other = labels_[std::size_t((y + dy) * width_ + x + dx)];
        if ((other > 0) == (own > 0)) continue;
        const double distance = std::hypot(dx, dy);
        if (distance >= std::abs(result.outside_px)) continue;
        result = own > 0 ? Near{own, -distance} : Near{other, distance};
      }
    return result;
  }

 private:
  void fill(std::span<const glm::vec3> paper, std::size_t from, int label) {
    std::vector<std::size_t> open{from};
    labels_[from] = label;
    while (!open.empty()) {
      const std::size_t at = open.back();
      open.pop_back();
      const int x = int(at) % width_, y = int(at) / width_;
      for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        if (x + dx < 0 || y + dy < 0 || x + dx >= width_ || y + dy >= height_) continue;
        const auto next = std::size_t((y + dy) * width_ + x + dx);
        if (paper[next].x <= 0.5f || labels_[next] != 0) continue;
        labels_[next] = label;
        open.push_back(next);
      }
    }
  }

  int width_, height_, count_ = 0;
  std::vector<int> labels_;
};

// Sums up the brightness of the composite and of the truth in a band along an outline.
struct Band {
  double composite = 0, truth = 0;
  double off() const { return truth > 0 ? composite / truth - 1 : 0; }
};

}  // namespace

bool has_untagged(const TruthSet& set, int frame) {
  return std::filesystem::exists(file_of(set, frame, "untagged_mixed"));
}

TruthFrame load_untagged_frame(const TruthSet& set, int frame) {
  TruthFrame truth = load_truth_frame(set, frame);
  truth.mixed = read(set, frame, "untagged_mixed");
  const auto paper = read(set, frame, "paper_mask");
  for (std::size_t i = 0; i < paper.size(); ++i)
    truth.mask[i] = std::max(truth.mask[i], paper[i].x);
  return truth;
}

std::vector<std::string> violations(const UntaggedMeasures& measures) {
  constexpr double most_e_tags = 0.08, most_outline = 0.01;
  std::vector<std::string> lines;
  if (measures.tags == 0) lines.emplace_back("tags 0: no tag was hidden in this frame");
  if (!(measures.e_tags <= most_e_tags))
    lines.push_back(fmt::format("e_tags {:.4f}, at most {}", measures.e_tags, most_e_tags));
  if (!(measures.outline <= most_outline))
    lines.push_back(fmt::format("outline {:.4f}, at most {}", measures.outline, most_outline));
  return lines;
}

UntaggedMeasures compare_untagged(const TruthSet& set, int frame,
                                  std::span<const glm::vec3> composite) {
  const TruthFrame tagged = load_truth_frame(set, frame);
  const auto truth = read(set, frame, "untagged_mixed");
  const auto paper = read(set, frame, "paper_mask");
  const Labels labels(paper, tagged.width, tagged.height);
  std::vector<Band> inside(std::size_t(labels.count()) + 1), outside = inside;
  UntaggedMeasures measures;
  measures.tags = labels.count();
  double error = 0, change = 0;
  for (std::size_t i = 0; i < paper.size(); ++i) {
    if (tagged.mask[i] > 0) continue;  // a virtual object covers it
    if (paper[i].x > 0.5f) {
      const glm::vec3 off = composite[i] - truth[i], changed = truth[i] - tagged.real[i];
      error += glm::dot(off, off);
      change += glm::dot(changed, changed);
      ++measures.pixels;
    }
    const auto [label, outside_px] = labels.near(i);
    if (label == 0 || std::abs(outside_px) <= blurred_px ||
        std::abs(outside_px) > band_px + blurred_px)
      continue;
    Band& band = (outside_px > 0 ? outside : inside)[std::size_t(label)];
    band.composite += brightness(composite[i]);
    band.truth += brightness(truth[i]);
  }
  measures.e_tags = change > 0 ? std::sqrt(error / change) : 0;
  for (std::size_t tag = 1; tag < inside.size(); ++tag)
    measures.outline = std::max(measures.outline, std::abs(inside[tag].off() - outside[tag].off()));
  return measures;
}

}  // namespace previz::truth
