#include "tests/support/calibrate_pictures.hpp"

#include <glm/gtc/matrix_transform.hpp>

#include "daemon/tools/calibrate/lens/observer.hpp"
#include "daemon/tools/calibrate/tags/tag_lens.hpp"

namespace previz::test {
namespace {

glm::dmat3 turned(const Held& held) {
  glm::dmat4 m(1.0);
  m = glm::rotate(m, held.turn_deg * degree, glm::dvec3(0, 1, 0));
  m = glm::rotate(m, held.tip_deg * degree, glm::dvec3(1, 0, 0));
  m = glm::rotate(m, held.roll_deg * degree, glm::dvec3(0, 0, 1));
  return glm::dmat3(m);
}

}  // namespace

calibrate::Views hold(const calibrate::Board& board, const std::vector<Held>& how, const Lens& lens,
                      int width, int height, double noise_px, std::mt19937& random) {
  glm::dvec3 centre(0);
  for (const glm::dvec3& point : board.points) centre += point / double(board.points.size());
  std::normal_distribution<double> noise(0, 1);
  calibrate::Views views{width, height, {}};
  for (const Held& held : how) {
    calibrate::View view{"view " + std::to_string(views.views.size()), {}, {}};
    for (const glm::dvec3& point : board.points) {
      const auto pixel = lens(turned(held) * (point - centre) + held.middle);
      if (!pixel || pixel->x < 0 || pixel->y < 0 || pixel->x > width - 1 || pixel->y > height - 1)
        continue;
      view.points.push_back(point);
      view.pixels.push_back(*pixel + noise_px * glm::dvec2(noise(random), noise(random)));
    }
    views.views.push_back(std::move(view));
  }
  return views;
}

calibrate::Views hold(const std::vector<Held>& how, const PinholeIntrinsics& lens, double noise_px,
                      unsigned seed) {
  std::mt19937 random(seed);
  const calibrate::LensVector all = calibrate::lens_vector(lens);
  const Lens through = [&](const glm::dvec3& point) {
    return calibrate::project_pinhole({all.val, calibrate::lens_size}, point);
  };
  return hold(calibrate::parse_board("chessboard:9x6:25mm"), how, through, lens.width, lens.height,
              noise_px, random);
}

std::vector<Held> careful_capture() {
  std::vector<Held> how;
  for (const double turn : {-35.0, 0.0, 35.0})
    for (const double tip : {-35.0, 0.0, 35.0})
      for (const double depth : {0.30, 0.45})
        how.push_back({turn, tip, 10 * turn / 35 + 5, {0.12 * turn / 35, 0.09 * tip / 35, depth}});
  return how;
}

void record(const std::filesystem::path& session, const session::SessionInfo& info,
            const std::string& source, const std::vector<calibrate::BracketPicture>& pictures) {
  session::SessionWriter writer(session, info);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    Frame frame;
    frame.source = source;
    frame.sequence = i;
    frame.timestamp_ns = frame.arrival_ns = std::int64_t(i) * 40'000'000;
    frame.exposure = frame.exposure_s = pictures[i].exposure;
    frame.width = pictures[i].width;
    frame.height = pictures[i].height;
    frame.bytes = pictures[i].rgb;
    writer.write(frame);
  }
}

}  // namespace previz::test
