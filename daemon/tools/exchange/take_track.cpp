#include "daemon/tools/exchange/take_track.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <ostream>
#include <set>

#include "daemon/core/pipeline/track_stage.hpp"
#include "daemon/core/report/report.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/core/tracking/tag_map.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

using LineJson = nlohmann::ordered_json;

LineJson rows_of(const glm::dmat4& matrix) {
  LineJson rows = LineJson::array();
  for (int r = 0; r < 4; ++r)
    rows.push_back({matrix[0][r], matrix[1][r], matrix[2][r], matrix[3][r]});
  return rows;
}

TrackedFrame tracked_frame(const pipeline::Shot& shot) {
  TrackedFrame frame;
  frame.record.frame = shot.index;
  frame.record.timestamp_ns = shot.frame->timestamp_ns;
  frame.record.scene = shot.scene;
  frame.record.carriers = shot.motion.carriers;
  frame.status = shot.track.status;
  frame.reason = shot.track.reason;
  frame.seen_tags = shot.track.seen_tags;
  if (const auto& pose = shot.track.pose) {
    frame.record.tracked = true;
    frame.record.world_from_camera = pose->world_from_camera;
    frame.record.covariance = pose->covariance;
    frame.record.tags = pose->tags;
    frame.reprojection_rms_px = pose->reprojection_rms_px;
  }
  return frame;
}

std::string pixels(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f px", value);
  return text.data();
}

void print_poses(const std::vector<TrackedFrame>& frames, std::ostream& out) {
  std::vector<double> rms;
  for (const TrackedFrame& frame : frames)
    if (frame.record.tracked) rms.push_back(frame.reprojection_rms_px);
  out << rms.size() << " of " << frames.size() << " frames tracked";
  std::ranges::sort(rms);
  if (!rms.empty() && rms.back() > 0)
    out << ", corners off by " << pixels(rms[rms.size() / 2]) << " rms (median), "
        << pixels(rms.back()) << " at worst";
  out << '\n';
}

void print_tags(const std::vector<TrackedFrame>& frames, const tracking::PoseJudgement& judgement,
                std::ostream& out) {
  std::map<int, std::pair<std::size_t, std::size_t>> counts;  // seen, used for the camera
  std::map<std::string, std::size_t> carriers;
  for (const TrackedFrame& frame : frames) {
    for (const int tag : std::set(frame.seen_tags.begin(), frame.seen_tags.end()))
      ++counts[tag].first;
    for (const int tag : frame.record.tags) ++counts[tag].second;
    for (const auto& [name, carrier] : frame.record.carriers)
      if (!carrier.tags.empty()) ++carriers[name];
  }
  for (const auto& [tag, count] : counts) {
    out << "  tag " << tag << ": seen in " << set::plural(std::uint64_t(count.first), "frame")
        << ", used for the camera in " << count.second;
    if (const std::string why = judgement.why_unusable(tag); count.second == 0 && !why.empty())
      out << ": " << why;
    out << '\n';
  }
  for (const auto& [name, count] : carriers)
    out << "  carrier \"" << name << "\": found in " << set::plural(std::uint64_t(count), "frame")
        << "\n";
}

// Tags that the set does not have are no mistake of the tracking.
void print_strangers(const std::vector<TrackedFrame>& frames, const set::Tracking& tracking,
                     std::ostream& out) {
  std::set<int> known, strangers;
  for (const set::Tag& tag : tracking.tags) known.insert(tag.id);
  for (const set::Carrier& carrier : tracking.carriers)
    for (const set::Tag& tag : carrier.tags) known.insert(tag.id);
  for (const TrackedFrame& frame : frames)
    for (const int tag : frame.seen_tags)
      if (!known.contains(tag)) strangers.insert(tag);
  if (strangers.empty()) return;
  out << "  " << tracking::tags_in_words({strangers.begin(), strangers.end()})
      << ": not in the set; `previz calibrate tags` measures where tags are, and writes it there "
         "(--set SET --write)\n";
}

// Prints each reason once, with the figures of the first frame that it holds for.
void print_reasons(const std::vector<TrackedFrame>& frames, std::ostream& out) {
  struct Lost {
    std::size_t count = 0;
    const TrackedFrame* first = nullptr;
  };
  std::map<std::string, Lost> lost;
  for (const TrackedFrame& frame : frames) {
    if (frame.record.tracked) continue;
    Lost& alike = lost[report::wording(frame.reason)];
    if (alike.count++ == 0) alike.first = &frame;
  }
  for (const auto& [wording, alike] : lost)
    out << "  " << alike.count << " without a pose, e.g. frame " << alike.first->record.frame
        << ": " << alike.first->reason << '\n';
}

}  // namespace

std::vector<TrackedFrame> track_frames(const pipeline::Take& take,
                                       const std::function<bool(std::uint64_t)>& wanted,
                                       const std::function<void(const std::string&)>& note,
                                       const std::stop_token& stop,
                                       tracking::PoseJudgement* judgement) {
  pipeline::TrackStage stage(take);
  std::vector<TrackedFrame> frames;
  const std::size_t count = take.observer_stream->records().size();
  for (std::size_t i = 0; i < count && !stop.stop_requested(); ++i) {
    // A carrier stays where it was in the frames before.
    if (!wanted(i) && !stage.remembers()) continue;
    pipeline::Shot shot;
    shot.index = i;
    try {
      shot.frame = take.observer_stream->read(i);
    } catch (const Error& error) {
      note(error.what());
      continue;
    }
    stage(shot);
    for (const std::string& trouble : stage.troubles()) note(trouble);
    if (judgement) judgement->add(shot.frame, shot.track);
    if (wanted(i)) frames.push_back(tracked_frame(shot));
  }
  return frames;
}

std::string to_json(const TrackedFrame& frame) {
  const session::TrackRecord& record = frame.record;
  LineJson line;
  line["frame"] = record.frame;
  line["timestamp_ns"] = record.timestamp_ns;
  line["tracked"] = record.tracked;
  line["tags_seen"] = frame.seen_tags;
  if (record.tracked) {
    line["world_from_camera"] = rows_of(record.world_from_camera);
    line["covariance"] = record.covariance;
    line["tags"] = record.tags;
    line["reprojection_rms_px"] = frame.reprojection_rms_px;
  } else {
    line["reason"] = frame.reason;
  }
  LineJson carriers = LineJson::object();
  for (const auto& [name, carrier] : record.carriers)
    if (!carrier.tags.empty())
      carriers[name] = {{"world_from_carrier", rows_of(carrier.world_from_carrier)},
                        {"covariance", carrier.covariance},
                        {"tags", carrier.tags}};
  if (!carriers.empty()) line["carriers"] = carriers;
  return line.dump(-1, ' ', false, LineJson::error_handler_t::replace);
}

int track_take(const TrackOptions& options, std::ostream& out) {
  const pipeline::Take take =
      pipeline::open_take(options.session, options.set_file, options.any_paths, options.stop);
  for (const std::string& what : take.session.missing) out << "session: " << what << std::endl;
  report::Once noted;
  tracking::PoseJudgement judgement(take.set.tracking, take.observer);
  const std::vector<TrackedFrame> frames = track_frames(
      take, [](std::uint64_t) { return true; },
      [&](const std::string& what) {
        if (noted.is_first(report::wording(what))) out << what << std::endl;
      },
      options.stop, &judgement);
  if (options.stop.stop_requested())
    throw Error(options.session.string() + ": tracking interrupted; nothing written");
  if (options.out) {
    std::string lines;
    for (const TrackedFrame& frame : frames) lines += to_json(frame) + "\n";
    session::replace_file(*options.out, lines);
  }
  print_poses(frames, out);
  print_tags(frames, judgement, out);
  print_strangers(frames, take.set.tracking, out);
  print_reasons(frames, out);
  for (const std::string& doubt : judgement.doubts(options.stop))
    out << "warning: " << doubt << '\n';
  if (options.out) out << options.out->string() << std::endl;
  const bool found =
      std::ranges::any_of(frames, [](const auto& one) { return one.record.tracked; });
  return found ? 0 : 1;
}

}  // namespace previz::exchange
