// Mailboxes keep the newest and count the rest; queues keep everything in order; both end cleanly.
#include "daemon/core/pipeline/channel.hpp"

#include "tests/support/test.hpp"

namespace previz::pipeline::channel_test {

TEST(Mailbox, KeepsTheNewestAndCountsTheRest) {
  Mailbox<int> mailbox;
  EXPECT_FALSE(mailbox.try_pop());
  for (int i = 1; i <= 5; ++i) EXPECT_TRUE(mailbox.push(i));
  EXPECT_EQ(mailbox.dropped(), 4u);
  EXPECT_EQ(mailbox.pop(), 5);
  EXPECT_FALSE(mailbox.try_pop());
}

TEST(Mailbox, WhatIsInsideSurvivesACloseButNotAnAbandon) {
  Mailbox<int> closed, abandoned;
  closed.push(1);
  abandoned.push(1);
  closed.close();
  abandoned.abandon();
  EXPECT_FALSE(closed.push(2));
  EXPECT_EQ(closed.pop(), 1);
  EXPECT_FALSE(closed.pop());
  EXPECT_FALSE(abandoned.pop());
}

// Nothing is lost silently: what came out and what was counted as dropped is what went in, and what
// came out is in order.
TEST(Mailbox, EveryValueIsTakenOrCounted) {
  constexpr int total = 20000;
  Mailbox<int> mailbox;
  std::vector<int> taken;
  std::thread reader([&] {
    while (const auto value = mailbox.pop()) taken.push_back(*value);
  });
  for (int i = 0; i < total; ++i) mailbox.push(i);
  mailbox.close();
  reader.join();
  EXPECT_EQ(taken.size() + mailbox.dropped(), std::size_t{total});
  EXPECT_TRUE(std::is_sorted(taken.begin(), taken.end()));
  EXPECT_EQ(taken.back(), total - 1);
}

TEST(BoundedQueue, EveryValueArrivesInOrder) {
  constexpr int total = 20000;
  BoundedQueue<int> queue(3);
  std::vector<int> taken;
  std::thread reader([&] {
    while (const auto value = queue.pop()) taken.push_back(*value);
  });
  for (int i = 0; i < total; ++i) ASSERT_TRUE(queue.push(i));
  queue.close();
  reader.join();
  std::vector<int> expected(total);
  std::iota(expected.begin(), expected.end(), 0);
  EXPECT_EQ(taken, expected);
  EXPECT_EQ(queue.dropped(), 0u);
}

TEST(BoundedQueue, ClosingWakesAWriterThatWaitsForRoom) {
  BoundedQueue<int> queue(1);
  ASSERT_TRUE(queue.push(1));
  bool accepted = true;
  std::thread writer([&] { accepted = queue.push(2); });
  queue.close();
  writer.join();
  EXPECT_FALSE(accepted);
  EXPECT_EQ(queue.pop(), 1);
  EXPECT_FALSE(queue.pop());
}

TEST(BoundedQueue, AnOfferNeverWaits) {
  BoundedQueue<int> queue(2);
  EXPECT_TRUE(queue.offer(1));
  EXPECT_TRUE(queue.offer(2));
  EXPECT_FALSE(queue.offer(3));
  EXPECT_EQ(queue.pop(), 1);
  EXPECT_TRUE(queue.offer(4));
  queue.close();
  EXPECT_FALSE(queue.offer(5));
  EXPECT_EQ(queue.pop(), 2);
  EXPECT_EQ(queue.pop(), 4);
  EXPECT_EQ(queue.pop(), std::nullopt);
}

TEST(BoundedQueue, TakingWithoutWaitingMakesRoom) {
  BoundedQueue<int> queue(1);
  EXPECT_FALSE(queue.try_pop());
  ASSERT_TRUE(queue.push(1));
  std::thread writer([&] { queue.push(2); });
  EXPECT_EQ(queue.pop(), 1);
  writer.join();
  EXPECT_EQ(queue.try_pop(), 2);
}

TEST(Channel, AbandoningWakesAReader) {
  Mailbox<int> mailbox;
  BoundedQueue<int> queue(1);
  std::thread reader([&] {
    EXPECT_FALSE(mailbox.pop());
    EXPECT_FALSE(queue.pop());
  });
  mailbox.abandon();
  queue.abandon();
  reader.join();
}

TEST(RecentQueue, DropsTheOldestOnceTooManyWeighTooMuchAndNeverWaits) {
  RecentQueue<int> queue(2, 10, [](int weight) { return static_cast<std::uint64_t>(weight); });
  for (const int weight : {3, 3, 3}) EXPECT_TRUE(queue.push(weight));  // more than two, and light
  EXPECT_EQ(queue.dropped(), 0u);
  EXPECT_TRUE(queue.push(5));  // 14 together
  EXPECT_EQ(queue.dropped(), 2u);
  EXPECT_TRUE(queue.push(100));  // two may wait, whatever they weigh
  EXPECT_EQ(queue.dropped(), 3u);
  EXPECT_EQ(queue.try_pop(), 5);
  EXPECT_EQ(queue.pop(), 100);
  EXPECT_EQ(queue.try_pop(), std::nullopt);
  for (int i = 0; i < 5; ++i)
    EXPECT_TRUE(queue.push(2)) << "what was taken weighs nothing any more";
  EXPECT_EQ(queue.dropped(), 3u);
  queue.close();
  EXPECT_FALSE(queue.push(1));
  EXPECT_EQ(queue.pop(), 2);
  queue.abandon();
  EXPECT_EQ(queue.pop(), std::nullopt);
}

}  // namespace previz::pipeline::channel_test
