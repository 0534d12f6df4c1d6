#include "daemon/tools/calibrate/lens/views.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>

#include "daemon/tools/calibrate/lens/board_guess.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr std::size_t looked_at_of_a_stream = 150;
constexpr int every_of_a_video = 10;  // about a third of a second
constexpr std::size_t least_corners = 6;
constexpr std::size_t most_sampled = 5;
constexpr double same_view = 0.02;  // share of the diagonal

int step(const PictureSource& source, const GatherOptions& options) {
  if (options.every > 0) return options.every;
  const auto count = source.count();
  if (!count) return every_of_a_video;
  return int(
      std::max<std::size_t>(1, (*count + looked_at_of_a_stream - 1) / looked_at_of_a_stream));
}

// Returns the largest distance that a corner has moved; infinite if one of the two has corners that
// the other lacks.
double largest_move(const BoardCorners& a, const BoardCorners& b) {
  if (a.ids != b.ids) return HUGE_VAL;
  double largest = 0;
  for (std::size_t i = 0; i < a.ids.size(); ++i)
    largest = std::max(largest, glm::distance(a.pixels[i], b.pixels[i]));
  return largest;
}

View view_of(const BoardCorners& corners, const Board& board, const std::string& name) {
  View view{name, {}, corners.pixels};
  for (const int id : corners.ids) view.points.push_back(board.points[std::size_t(id)]);
  return view;
}

// Returns `count` of the views, evenly spread over the take.
std::vector<View> thinned(std::vector<View> views, std::size_t count) {
  if (views.size() <= count) return views;
  std::vector<View> kept;
  for (std::size_t i = 0; i < count; ++i)
    kept.push_back(std::move(views[i * views.size() / count]));
  return kept;
}

std::string why_nowhere(const Views& gathered, const Board& board, const ResponseCurve& response) {
  if (const std::string other = other_board(gathered.sampled, board, response); !other.empty())
    return ": " + other;
  return ", and nothing like it: it must be entirely in view, sharp, evenly lit, and large (a "
         "square "
         "or a tag's cell of ten pixels or more). A chessboard with tags in only a few places is "
         "not a supported board";
}

}  // namespace

Views gather_views(PictureSource& source, BoardFinder& finder, const Board& board,
                   const GatherOptions& options,
                   const std::function<void(const std::string&)>& report) {
  Views gathered;
  std::vector<BoardCorners> taken;
  std::size_t index = 0, looked_at = 0, alike = 0;
  const auto every = std::size_t(step(source, options));
  for (auto picture = source.next(); picture; picture = source.next()) {
    if (index++ % every) continue;
    const Frame& frame = *picture->frame;
    if (looked_at++ == 0) {
      gathered.width = frame.width;
      gathered.height = frame.height;
    } else if (frame.width != gathered.width || frame.height != gathered.height) {
      throw Error(picture->name + ": has " + std::to_string(frame.width) + "x" +
                  std::to_string(frame.height) + " pixels, earlier pictures " +
                  std::to_string(gathered.width) + "x" + std::to_string(gathered.height) +
                  "; a calibration is for one size");
    }
    if (std::has_single_bit(looked_at) && gathered.sampled.size() < most_sampled)
      gathered.sampled.push_back(picture->frame);
    BoardCorners corners = finder.find(frame);
    const double same = same_view * std::hypot(frame.width, frame.height);
    const bool is_new = std::ranges::none_of(
        taken, [&](const BoardCorners& other) { return largest_move(corners, other) < same; });
    if (corners.ids.size() < least_corners) {
      report(picture->name + ": " +
             (corners.ids.empty() ? "no board, or a part of one"
                                  : std::to_string(corners.ids.size()) + " corners only, skipped"));
    } else if (!is_new) {
      ++alike;
    } else {
      report(picture->name + ": " + std::to_string(corners.ids.size()) + " corners");
      gathered.views.push_back(view_of(corners, board, picture->name));
      taken.push_back(std::move(corners));
    }
  }
  if (gathered.views.empty())
    throw Error("the board is in none of the " + std::to_string(looked_at) + " pictures examined" +
                why_nowhere(gathered, board, options.response));
  const std::size_t found = gathered.views.size();
  gathered.views = thinned(std::move(gathered.views), std::size_t(options.at_most));
  std::string said = std::to_string(looked_at) + " of " + std::to_string(index) +
                     " pictures examined, " + std::to_string(found) + " different views";
  if (alike) said += ", " + std::to_string(alike) + " too similar to another";
  if (gathered.views.size() < found) said += ", " + std::to_string(gathered.views.size()) + " used";
  report(said);
  return gathered;
}

}  // namespace previz::calibrate
