// Pictures are lent again once nobody holds them, and never while somebody does.
#include "daemon/core/render/device/plate_pool.hpp"
#include "tests/support/test.hpp"

namespace previz::test::plate_pool_test {

TEST(PlatePool, LendsAPictureAgainOnlyOnceNobodyHoldsIt) {
  render::PlatePool pool;
  std::shared_ptr<Plate> first = pool.lend(4, 3, 8);
  EXPECT_EQ(first->samples.size(), 36u);
  const Plate* const place = first.get();
  const PlatePtr held = first;
  first.reset();
  EXPECT_NE(pool.lend(4, 3, 8).get(), place) << "somebody holds it";
}

TEST(PlatePool, GivesAPictureThatCameBackTheSizeThatIsAskedFor) {
  render::PlatePool pool;
  const Plate* const place = pool.lend(8, 6, 8).get();
  const std::shared_ptr<Plate> again = pool.lend(4, 3, 16);
  EXPECT_EQ(again.get(), place);
  EXPECT_EQ(again->width, 4);
  EXPECT_EQ(again->height, 3);
  EXPECT_EQ(again->bits, 16);
  EXPECT_EQ(again->samples.size(), 36u);
}

TEST(PlatePool, TakesPicturesBackFromOtherThreadsAndAfterItsEnd) {
  std::shared_ptr<Plate> last;
  {
    render::PlatePool pool;
    std::vector<std::thread> threads;
    for (int i = 0; i < 8; ++i)
      threads.emplace_back([picture = pool.lend(16, 9, 8)]() mutable { picture.reset(); });
    for (std::thread& thread : threads) thread.join();
    last = pool.lend(16, 9, 8);
  }
  EXPECT_EQ(last->samples.size(), 432u);
}

}  // namespace previz::test::plate_pool_test
