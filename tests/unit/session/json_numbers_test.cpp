#include "daemon/core/session/json_numbers.hpp"

#include "tests/support/test.hpp"

namespace previz::session::json_numbers_test {

using nlohmann::json;

template <typename Number>
std::string refusal(const char* text) {
  try {
    number_of<Number>(json::parse(text));
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(JsonNumbers, AreThoseThatFit) {
  EXPECT_EQ(number_of<int>(json::parse("-2147483648")), -2147483647 - 1);
  EXPECT_EQ(number_of<std::uint64_t>(json::parse("18446744073709551615")), ~0ull);
  EXPECT_EQ(number_of<double>(json::parse("3")), 3);
  EXPECT_EQ(numbers_of<int>(json::parse("[1, 2]")), (std::vector<int>{1, 2}));
  EXPECT_EQ(number_or(json::parse("{}"), "a", 7), 7);
  EXPECT_EQ(number_or(json::parse(R"({"a": 8})"), "a", 7), 8);
}

TEST(JsonNumbers, AreRefusedWhereTheyDoNotFit) {
  EXPECT_EQ(refusal<int>("2147483648"), "2147483648 is too large, or below 0");
  EXPECT_EQ(refusal<std::int64_t>("9223372036854775808"),
            "9223372036854775808 is too large, or below 0");
  EXPECT_EQ(refusal<std::uint64_t>("-1"), "-1 is too large, or below 0");
  EXPECT_EQ(refusal<int>("1e12"), "1000000000000.0 is not a whole number");
  EXPECT_EQ(refusal<int>("true"), "boolean is not a whole number");
  EXPECT_EQ(refusal<double>("\"3\""), "string is not a number");
  EXPECT_THROW(numbers_of<int>(json::parse("3")), std::invalid_argument);
  EXPECT_THROW(number_at<int>(json::parse("{}"), "a"), json::exception);
}

}  // namespace previz::session::json_numbers_test
