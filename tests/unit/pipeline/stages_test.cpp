// A line of stages ends in order at the stream's end, cleanly at a stop, and at once at an error.
#include "daemon/core/pipeline/stages.hpp"

#include <nlohmann/json.hpp>

#include "daemon/core/pipeline/metrics.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::pipeline::stages_test {

// Counts up to `total`; with a move-only value, as shots are moved and never copied.
auto count_to(int total) {
  return [next = 0, total]() mutable -> std::optional<std::unique_ptr<int>> {
    if (next == total) return std::nullopt;
    return std::make_unique<int>(next++);
  };
}

TEST(StageThreads, EndOfStreamRunsThroughTheWholeLine) {
  Metrics metrics;
  BoundedQueue<std::unique_ptr<int>> first(1), second(1);
  std::vector<int> results;
  StageThreads stages(metrics, {});
  stages.source("camera", first, count_to(100));
  stages.stage("double", first, second, [](std::unique_ptr<int> value) {
    *value *= 2;
    return value;
  });
  stages.sink("display", second, [&](std::unique_ptr<int> value) { results.push_back(*value); });
  stages.wait();
  ASSERT_EQ(results.size(), 100u);
  EXPECT_EQ(results.front(), 0);
  EXPECT_EQ(results.back(), 198);
  const MetricsSnapshot snapshot = metrics.snapshot(1);
  EXPECT_EQ(snapshot.stages.at("camera").frames, 100u);
  EXPECT_EQ(snapshot.stages.at("double").frames, 100u);
  EXPECT_EQ(snapshot.stages.at("display").frames, 100u);
}

// In front of a stage that stands still each kind of queue fills, says for how long and with how
// much, and then drops by its rule or takes no more.
TEST(StageThreads, WhatWaitsInFrontOfAStageIsInItsMetricsUntilItDrops) {
  constexpr std::chrono::milliseconds pause{20};
  Metrics metrics;
  Mailbox<int> mailbox;
  BoundedQueue<int> bounded(2);
  RecentQueue<int> recent(2, 30, [](int) { return std::uint64_t{10}; });
  std::atomic<int> standing = 0;
  std::atomic<bool> goes_on = false;
  const auto stand_still = [&](int) {
    ++standing;
    goes_on.wait(false);
  };
  const auto waiting = [&](const char* stage) {
    return metrics.snapshot(1).stages.at(stage).waiting;
  };
  StageThreads stages(metrics, {});
  stages.sink("mailbox", mailbox, stand_still);
  stages.sink("bounded", bounded, stand_still);
  stages.sink("recent", recent, stand_still);
  mailbox.push(0);
  bounded.push(0);
  recent.push(0);
  ASSERT_TRUE(test::wait_until("the stages stand still", [&] { return standing == 3; }));
  for (const char* stage : {"mailbox", "bounded", "recent"})
    EXPECT_EQ(waiting(stage).values + waiting(stage).bytes, 0u) << stage;

  mailbox.push(1);
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(bounded.offer(i));
  EXPECT_FALSE(bounded.offer(2));
  for (int i = 0; i < 5; ++i) recent.push(i);
  std::this_thread::sleep_for(pause);  // what waits gets an age
  EXPECT_EQ(waiting("mailbox").values, 1u);
  EXPECT_EQ(waiting("bounded").values, 2u);
  EXPECT_EQ(waiting("recent").values, 3u);
  EXPECT_EQ(waiting("recent").bytes, 30u);
  for (const char* stage : {"mailbox", "bounded", "recent"})
    EXPECT_GE(waiting(stage).oldest_s, 0.02) << stage;
  mailbox.push(2);  // which has not waited yet

  goes_on = true;
  goes_on.notify_all();
  mailbox.close();
  bounded.close();
  recent.close();
  stages.wait();
  const MetricsSnapshot after = metrics.snapshot(1);
  EXPECT_EQ(after.stages.at("mailbox").dropped.at("newer frame"), 1u);
  EXPECT_EQ(after.stages.at("recent").dropped.at("newer frame"), 2u);
  EXPECT_TRUE(after.stages.at("bounded").dropped.empty());
  for (const char* stage : {"mailbox", "bounded", "recent"})
    EXPECT_EQ(after.stages.at(stage).waiting.values, 0u) << stage;
  EXPECT_THAT(to_json(after), HasSubstr("\"waiting\": {"));
}

TEST(StageThreads, StopEndsTheSourceAndFinishesWhatWasBegun) {
  Metrics metrics;
  std::stop_source stop;
  BoundedQueue<int> queue(2);
  int produced = 0, shown = 0;
  StageThreads stages(metrics, stop.get_token());
  stages.source("camera", queue, [&]() -> std::optional<int> { return produced++; });
  stages.sink("display", queue, [&](int value) {
    if (value == 50) stop.request_stop();
    ++shown;
  });
  stages.wait();
  EXPECT_EQ(shown, produced);
  EXPECT_GE(shown, 51);
  EXPECT_LE(shown, 51 + 4);  // 2 in the queue, 1 in the source's hands, 1 it may have begun
}

TEST(StageThreads, AnErrorEndsEveryStageAndIsThrown) {
  Metrics metrics;
  BoundedQueue<std::unique_ptr<int>> first(1), second(1);
  StageThreads stages(metrics, {});
  stages.source("camera", first, count_to(1'000'000'000));  // would never end by itself
  stages.stage("faulty", first, second, [](std::unique_ptr<int> value) {
    if (*value == 10) throw std::runtime_error("lamp fell down");
    return value;
  });
  stages.sink("display", second, [](std::unique_ptr<int>) {});
  EXPECT_THAT([&] { stages.wait(); }, testing::ThrowsMessage<std::runtime_error>("lamp fell down"));
}

// A camera that is silent waits for its device, and never pushes.
TEST(StageThreads, AnErrorEndsSourcesThatWaitForSomethingElse) {
  Metrics metrics;
  Mailbox<int> silent, running;
  std::stop_source stop;
  StageThreads stages(metrics, stop.get_token(), [&] { stop.request_stop(); });
  stages.source("silent camera", silent, [&]() -> std::optional<int> {
    while (!stop.stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return std::nullopt;
  });
  stages.source("camera", running, []() -> std::optional<int> { return 1; });
  stages.sink("faulty", running, [](int) { throw std::runtime_error("lamp fell down"); });
  EXPECT_THROW(stages.wait(), std::runtime_error);
}

TEST(StageThreads, DropsAreToldAsTheyHappen) {
  Metrics metrics;
  Mailbox<int> mailbox;
  std::atomic<bool> looked = false;
  StageThreads stages(metrics, {});
  for (int i = 0; i < 3; ++i) mailbox.push(i);
  stages.sink("display", mailbox, [&](int) {
    EXPECT_EQ(metrics.snapshot(1).stages.at("display").dropped.at("newer frame"), 2u);
    looked = true;
    mailbox.close();
  });
  stages.wait();
  EXPECT_TRUE(looked);
}

// While they are at work, and before the source would end by itself. What the stages held is then
// held by nobody.
TEST(StageThreads, LeavingTheScopeEndsThem) {
  Metrics metrics;
  const auto alive = std::make_shared<std::atomic<int>>(0);
  constexpr int total = 1'000'000'000;
  {
    Mailbox<std::unique_ptr<int>> mailbox;
    StageThreads stages(metrics, {});
    stages.source("camera", mailbox, count_to(total));
    stages.sink("display", mailbox, [alive](std::unique_ptr<int>) { ++*alive; });
    ASSERT_TRUE(test::wait_until("something is shown", [&] { return *alive > 0; }));
    EXPECT_GT(alive.use_count(), 1);
  }
  EXPECT_EQ(alive.use_count(), 1);
  EXPECT_LT(metrics.snapshot(1).stages.at("camera").frames, std::uint64_t{total});
}

TEST(Metrics, QuantilesAreNearestRank) {
  EXPECT_EQ(quantile({}, 0.5), 0);
  EXPECT_EQ(quantile({3}, 0.99), 3);
  EXPECT_EQ(quantile({4, 1, 3, 2}, 0.5), 2);
  std::vector<double> hundred;
  for (int i = 100; i >= 1; --i) hundred.push_back(i);
  EXPECT_EQ(quantile(hundred, 0.99), 99);
  EXPECT_EQ(quantile(hundred, 1.0), 100);
}

TEST(Metrics, JsonHasRatesDropsAndLatency) {
  Metrics metrics;
  for (int i = 0; i < 50; ++i) metrics.worked("render", 0.03);
  metrics.dropped("render", "newer frame", 7);
  metrics.dropped("render", "newer frame", 0);
  metrics.count("plate untouched: pose lost", 2);
  for (int i = 1; i <= 100; ++i) metrics.shown(0.001 * i);
  for (int i = 0; i < 2; ++i)
    metrics.passes_ran({.passes = {{"extend", 35, 5.0}, {"shade", 18, 4.0}}, .untimed = 12});
  const auto json = nlohmann::json::parse(to_json(metrics.snapshot(2.0)));
  EXPECT_EQ(json["passes"]["extend"]["runs"], 70);
  EXPECT_DOUBLE_EQ(json["passes"]["extend"]["busy_s"], 0.01);
  EXPECT_DOUBLE_EQ(json["passes"]["shade"]["busy_s"], 0.008);
  EXPECT_EQ(json["counts"][Metrics::untimed_passes], 24);
  EXPECT_EQ(json["stages"]["render"]["frames"], 50);
  EXPECT_DOUBLE_EQ(json["stages"]["render"]["frames_per_second"], 25);
  EXPECT_NEAR(json["stages"]["render"]["busy_fraction"], 0.75, 1e-12);
  EXPECT_EQ(json["stages"]["render"]["dropped"]["newer frame"], 7);
  EXPECT_EQ(json["counts"]["plate untouched: pose lost"], 2);
  EXPECT_DOUBLE_EQ(json["latency_s"]["p50"], 0.050);
  EXPECT_DOUBLE_EQ(json["latency_s"]["p99"], 0.099);
}

TEST(Metrics, JsonHasTheFitOfTheModelWhileItIsMeasured) {
  Metrics metrics;
  const auto fit = [&] {
    return nlohmann::json::parse(to_json(metrics.snapshot(1)))["model_fit_px"];
  };
  EXPECT_TRUE(fit().is_null());
  metrics.model_fit(ModelFit{ModelFit::All{0.3, 0.8, 0.5}, {{"red cube", 4}}});
  EXPECT_EQ(fit()["median"], 0.3);
  EXPECT_EQ(fit()["of_90_percent"], 0.8);
  EXPECT_EQ(fit()["shift"], 0.5);
  EXPECT_EQ(fit()["things_off"], nlohmann::json::array({{{"name", "red cube"}, {"shift", 4}}}));
  metrics.model_fit(ModelFit{{}, {{"red cube", 4}}});
  EXPECT_TRUE(fit()["median"].is_null());
  EXPECT_EQ(fit()["things_off"].size(), 1u);
  metrics.model_fit(std::nullopt);
  EXPECT_TRUE(fit().is_null());
}

// Text of foreign origin that gets into a name fills no memory; what is known goes on being
// counted.
TEST(Metrics, OfNamesWithoutEndTheFirstAreCountedByName) {
  Metrics metrics;
  for (int i = 0; i < 10'000; ++i) {
    metrics.count("event " + std::to_string(i));
    metrics.dropped("render", "cause " + std::to_string(i));
  }
  metrics.count("event 0");
  const MetricsSnapshot snapshot = metrics.snapshot(1);
  for (const auto* counts : {&snapshot.counts, &snapshot.stages.at("render").dropped}) {
    EXPECT_EQ(counts->size(), Metrics::most_names + 1);
    EXPECT_EQ(counts->at(Metrics::other_names), 10'000 - Metrics::most_names);
  }
  EXPECT_EQ(snapshot.counts.at("event 0"), 2u);
}

// The window holds the last 4096 frames: older latencies leave the figures.
TEST(Metrics, OldLatenciesLeaveTheWindow) {
  Metrics metrics;
  for (int i = 0; i < 4096; ++i) metrics.shown(9.0);
  for (int i = 0; i < 4096; ++i) metrics.shown(0.5);
  EXPECT_EQ(metrics.snapshot(1).latency_p99_s, 0.5);
}

}  // namespace previz::pipeline::stages_test
