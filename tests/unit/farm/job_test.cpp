// How frames are divided, and that a plan is read back as it was written, or refused.
#include "daemon/tools/farm/job.hpp"

#include <nlohmann/json.hpp>

#include "tests/support/test.hpp"

namespace previz::farm::job_test {

std::set<std::uint64_t> frames(std::uint64_t first, std::uint64_t last) {
  std::set<std::uint64_t> all;
  for (std::uint64_t frame = first; frame <= last; ++frame) all.insert(frame);
  return all;
}

Job small_job() {
  Job job;
  job.software = "previzd 1.2.3";
  job.made = "2026-11-28 20:03 UTC";
  job.render.samples = 64;
  job.render.scale = 0.5;
  job.render.estimator = set::Estimator::difference;
  job.render.device.name = "llvmpipe";
  job.set_file = "set/a \"quoted\"\nname.toml";
  job.set_assets["../model.glb"] = "set/0123.glb";
  job.sample_ranges = 4;
  job.wishes = {12, "render", "4:00:00", "64G"};
  JobTake take;
  take.session = "/takes/a 'take'\nof two lines";
  take.pictures = "/out/a";
  take.frames = {3, 4};
  take.settings = "{}";
  take.video = false;
  take.frame_bytes = 7;
  job.takes.push_back(take);
  Division division;
  divide(frames(3, 4), 0, 4, division, job.chunks);
  return job;
}

std::string refusal(const nlohmann::json& plan) {
  return test::error_of([&] { job_from_json(plan.dump(), "JOB/job.json"); });
}

// One change of a sound plan.
struct Change {
  const char* place;     // RFC 6901
  nlohmann::json value;  // null: nothing is there
  const char* words;     // in the refusal
};

void expect_refused(const std::vector<Change>& changes) {
  const nlohmann::json sound = nlohmann::json::parse(to_json(small_job()));
  for (const auto& [place, value, words] : changes) {
    nlohmann::json plan = sound;
    if (value.is_null())
      plan = plan.patch(nlohmann::json::array({{{"op", "remove"}, {"path", place}}}));
    else
      plan[nlohmann::json::json_pointer(place)] = value;
    EXPECT_THAT(refusal(plan), HasSubstr(words)) << place << ": " << value;
  }
}

TEST(JobPlan, IsReadBackAsItWasWritten) {
  const std::string text = to_json(small_job());
  const Job read = job_from_json(text, "JOB/job.json");
  EXPECT_EQ(to_json(read), text);
  EXPECT_EQ(read.takes.at(0).session, small_job().takes.at(0).session);
  EXPECT_EQ(read.render.estimator, set::Estimator::difference);
  EXPECT_FALSE(read.render.seed);
}

TEST(JobPlan, ThatIsNotOneIsRefused) {
  EXPECT_THAT(test::error_of([] { job_from_json("{", "JOB/job.json"); }),
              StartsWith("JOB/job.json: is not a job's plan: "));
  expect_refused({
      {"/format", 2, "its format"},
      {"/takes", {}, "takes"},
      {"/chunks/0/take", 1, "a take that there is not"},
      {"/chunks/0/frames", {4, 3}, "from 4 to 3"},
      {"/chunks/9/frames", {4, 1ull << 39}, "from 4 to"},
      {"/chunks/0/range", 5, "sample range 5 of 4"},
      {"/chunks/0/kind", "rm", "kind"},
      {"/render/scale", 1e9, "scale"},
      {"/render/samples", -1, "samples"},
      {"/render/seconds", 1e308, "seconds"},
      {"/sample_ranges", 4'294'967'297, "4294967297"},
      {"/render/samples", 4'294'967'298, "4294967298 is too large"},
      {"/render/samples", 1e12, "1000000000000.0 is not a whole number"},
      {"/takes/0/settings", "garbage", "no JSON object"},
  });
  nlohmann::json plan = nlohmann::json::parse(to_json(small_job()));
  std::swap(plan["chunks"][0], plan["chunks"][9]);
  EXPECT_THAT(refusal(plan), HasSubstr("order"));
}

// The last step looks at each of them.
TEST(JobPlan, HasNoMoreThanAShootMakes) {
  const nlohmann::json chunk = nlohmann::json::parse(to_json(small_job()))["chunks"][0];
  expect_refused({
      {"/takes/0/frames", {0, 1'000'000}, "a range of frames runs from 0 to 1000000"},
      {"/chunks", std::vector(100'001, chunk), "it has more than 100000 chunks"},
  });
}

// Otherwise the last step would find every frame there that is in a chunk, and none that is not.
TEST(JobPlan, HasEveryFrameOnce) {
  nlohmann::json plan = nlohmann::json::parse(to_json(small_job()));
  const char* const once = "do not have every frame once";
  expect_refused({
      {"/chunks", nlohmann::json::array(), once},
      {"/chunks/9", {}, once},
      {"/chunks/3", {}, once},
      {"/chunks/-", plan["chunks"][9], once},
      {"/takes/0/frames", {3, 1u << 19}, once},
  });
  plan["takes"] = plan["chunks"] = nlohmann::json::array();
  EXPECT_THAT(refusal(plan), HasSubstr("it has no take"));
}

// A plan from elsewhere names files; none of them is outside of what the command line allows.
TEST(JobPlan, ReachesNothingBesideItsFolder) {
  expect_refused({
      {"/set_file", "../../set.toml", "is not in the job's folder"},
      {"/set_assets/a", "/etc/passwd", "is not in the job's folder"},
      {"/takes/0/pictures", "out", "is not a full path"},
  });
}

TEST(JobPlan, WithATextThatIsNotUtf8IsRefusedInWords) {
  Job job = small_job();
  job.takes[0].session = "/takes/\xff";
  EXPECT_THAT(test::error_of([&] { to_json(job); }), HasSubstr("is not UTF-8"));
}

TEST(Division, GivesEveryFrameToOneChunk) {
  std::vector<Chunk> chunks;
  std::set<std::uint64_t> wanted = frames(0, 99);
  wanted.erase(40);
  Division division;
  division.chunk = 16;
  divide(wanted, 2, 1, division, chunks);
  std::set<std::uint64_t> given;
  for (const Chunk& chunk : chunks) {
    EXPECT_EQ(chunk.take, 2u);
    EXPECT_EQ(chunk.kind, ChunkKind::pictures);
    EXPECT_LE(chunk.frames.last - chunk.frames.first, 15u);
    for (std::uint64_t frame = chunk.frames.first; frame <= chunk.frames.last; ++frame)
      EXPECT_TRUE(given.insert(frame).second) << frame;
  }
  EXPECT_EQ(given, wanted);
  EXPECT_EQ(chunks.back().frames.last, 99u);  // the last one is short, and never beyond the take
}

TEST(Division, GoesByTheNumberOfMachines) {
  const auto chunks_of = [](int machines, std::uint64_t count, bool averaged = false) {
    std::vector<Chunk> chunks;
    Division division;
    division.machines = machines;
    division.averages_neighbours = averaged;
    divide(frames(0, count - 1), 0, 1, division, chunks);
    return chunks.size();
  };
  EXPECT_EQ(chunks_of(8, 320), 32u);
  EXPECT_EQ(chunks_of(8, 5), 5u);
  EXPECT_EQ(chunks_of(8, 10'000), 157u);  // none is longer than 64 frames
  EXPECT_EQ(chunks_of(8, 64, true), 4u);  // 16 frames, of which few are rendered twice
}

TEST(Division, DividesTheSamplesOfAFewFrames) {
  Division division;
  division.most_sample_ranges = 16;
  EXPECT_EQ(sample_ranges_for(division, 1), 8);
  EXPECT_EQ(sample_ranges_for(division, 3), 2);
  EXPECT_EQ(sample_ranges_for(division, 8), 1);
  EXPECT_EQ(sample_ranges_for(division, 1000), 1);
  division.most_sample_ranges = 4;
  EXPECT_EQ(sample_ranges_for(division, 1), 4);
  division.sample_ranges = 1;
  EXPECT_EQ(sample_ranges_for(division, 1), 1);
}

TEST(Division, OfSamplesEndsWithTheMerges) {
  const Job job = small_job();
  ASSERT_EQ(job.chunks.size(), 10u);
  EXPECT_EQ(job.first_merge(), 8u);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(job.chunks[i].kind, ChunkKind::sums);
    EXPECT_EQ(job.chunks[i].range, static_cast<int>(i % 4) + 1);
    EXPECT_EQ(job.chunks[i].frames.first, 3 + i / 4);
  }
  EXPECT_EQ(words_of(job, job.chunks[5]), "frame 4 of a 'take'\nof two lines, sample range 2 of 4");
}

}  // namespace previz::farm::job_test
