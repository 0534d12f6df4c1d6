// Averages a picture over the areas of fewer pixels, row by row.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace previz::convert {

// A pixel is a vector of doubles, or one.
template <typename Pixel>
class AreaAverage {
 public:
  // The smaller picture has at least one pixel along each side, and no more than the other one.
  AreaAverage(int width, int height, int smaller_width, int smaller_height)
      : width_(width),
        height_(height),
        smaller_height_(smaller_height),
        narrow_(static_cast<std::size_t>(smaller_width)),
        sums_(narrow_.size()) {}

  // Adds the next row from the top, whose pixel at x is pixel(x). Calls finished(means) with the
  // row of the smaller picture, a std::span<const Pixel>, that has all of its rows now.
  template <typename At, typename Finished>
  void add(const At& pixel, const Finished& finished) {
    const int to = static_cast<int>(narrow_.size());
    std::ranges::fill(narrow_, Pixel(0));
    for (int x = 0; x < width_; ++x) {
      const Shares shares = shares_of(x, width_, to);
      const Pixel value = pixel(x);
      narrow_[shares.first] += shares.of_first * value;
      if (shares.of_next > 0) narrow_[shares.first + 1] += shares.of_next * value;
    }
    const Shares shares = shares_of(rows_++, height_, smaller_height_);
    add_to_sums(shares.of_first);
    const bool is_last = rows_ == height_;
    if (!is_last && shares_of(rows_, height_, smaller_height_).first == shares.first) return;
    finished(std::span<const Pixel>(sums_));
    std::ranges::fill(sums_, Pixel(0));
    if (shares.of_next > 0) add_to_sums(shares.of_next);
  }

 private:
  // How much of the mean of pixel `first`, and of the next one, a pixel of the larger picture is.
  struct Shares {
    std::size_t first;
    double of_first, of_next;
  };
  static Shares shares_of(int i, int from, int to) {
    const std::int64_t start = static_cast<std::int64_t>(i) * to;
    const std::int64_t first = start / from;
    const std::int64_t in_first = std::min<std::int64_t>((first + 1) * from - start, to);
    return {static_cast<std::size_t>(first), static_cast<double>(in_first) / from,
            static_cast<double>(to - in_first) / from};
  }

  void add_to_sums(double share) {
    for (std::size_t i = 0; i < sums_.size(); ++i) sums_[i] += share * narrow_[i];
  }

  int width_, height_, smaller_height_;
  int rows_ = 0;               // added
  std::vector<Pixel> narrow_;  // the last row, over the columns of the smaller picture
  std::vector<Pixel> sums_;    // of its unfinished row
};

}  // namespace previz::convert
