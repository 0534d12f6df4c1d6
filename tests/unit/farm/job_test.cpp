// How frames are divided, and that a plan is read back as it was written, or refused.
#include "daemon/tools/farm/job.hpp"

#include <nlohmann/json.hpp>

#include "tests/support/test.hpp"

namespace previz::farm::job_test {

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
  job.share = 3;
  job.wishes = {12, "render", "4:00:00", "64G"};
  JobTake take;
  take.session = "/takes/a 'take'\nof two lines";
  take.pictures = "/out/a";
  take.frames = {3, 4};
  take.settings = "{}";
  take.video = false;
  take.frame_bytes = 7;
  job.takes.push_back(take);
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

TEST(JobPlan, OfAnEarlierPrevizIsRead) {
  nlohmann::json plan = nlohmann::json::parse(to_json(small_job()));
  plan["format"] = 1;
  plan["wishes"] = {{"at_once", 7}, {"partition", "night"}, {"time", ""}, {"memory", ""}};
  for (const char* key : {"share", "at_once", "partition", "time", "memory"}) plan.erase(key);
  plan["chunks"] = {{{"take", 0}, {"frames", {3, 4}}, {"kind", "pictures"}}};
  const Job job = job_from_json(plan.dump(), "JOB/job.json");
  EXPECT_EQ(job.share, 2u);
  EXPECT_EQ(job.wishes.partition, "night");
}

TEST(JobPlan, ThatIsNotOneIsRefused) {
  EXPECT_THAT(test::error_of([] { job_from_json("{", "JOB/job.json"); }),
              StartsWith("JOB/job.json: is not a job's plan: "));
  expect_refused({
      {"/format", 3, "its format"},
      {"/takes", {}, "takes"},
      {"/takes", nlohmann::json::array(), "it has no take"},
      {"/share", 0, "\"share\" is 0"},
      {"/takes/0/frames", {4, 3}, "from 4 to 3"},
      {"/takes/0/frames", {4, 1ull << 39}, "from 4 to"},
      {"/render/scale", 1e9, "scale"},
      {"/render/samples", -1, "samples"},
      {"/render/seconds", 1e308, "seconds"},
      {"/sample_ranges", 4'294'967'297, "4294967297"},
      {"/render/samples", 4'294'967'298, "4294967298 is too large"},
      {"/render/samples", 1e12, "1000000000000.0 is not a whole number"},
      {"/takes/0/settings", "garbage", "no JSON object"},
  });
}

TEST(JobPlan, HasNoMoreThanAShootMakes) {
  expect_refused({
      {"/takes/0/frames", {0, 1'000'000}, "a range of frames runs from 0 to 1000000"},
      {"/takes/0/frames", {0, 999'999}, "it has more than 100000 tasks"},
  });
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

TEST(Division, GoesByTheNumberOfMachines) {
  const auto tasks_of = [](int machines, std::uint64_t count, bool averaged = false) {
    Division division;
    division.machines = machines;
    division.averages_neighbours = averaged;
    Job job;
    job.share = share_for(division, count, 1);
    return job.tasks(count);
  };
  EXPECT_EQ(tasks_of(8, 320), 32u);
  EXPECT_EQ(tasks_of(8, 5), 5u);
  EXPECT_EQ(tasks_of(8, 10'000), 157u);  // none has more than 64 frames
  EXPECT_EQ(tasks_of(8, 64, true), 4u);  // 16 frames, of which few are rendered twice
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

TEST(Division, OfSamplesGivesATaskOneRangeOfAFrame) {
  EXPECT_EQ(share_for({}, 2, 4), 1u);
  const Job job = small_job();  // two frames in four ranges, three to a task
  EXPECT_EQ(job.tasks(job.frames()), 3u);
  EXPECT_EQ(job.tasks(0), 0u);
}

}  // namespace previz::farm::job_test
