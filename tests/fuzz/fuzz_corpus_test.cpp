// Runs every target of the fuzzer over the bytes that are kept in tests/fuzz/corpus: those it began
// with, and those that once broke a reader. It also runs cuts and changes of them, the same ones on
// every run. Nothing may crash, throw what is no previz::Error, or break a promise.

extern "C" {
#include <libavutil/log.h>
}

#include "tests/fuzz/mutators.hpp"
#include "tests/fuzz/targets.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::fuzz::fuzz_corpus_test {

const std::filesystem::path corpus = std::filesystem::path(PREVIZ_SOURCE_DIR) / "tests/fuzz/corpus";

std::vector<std::filesystem::path> inputs_of(const Target& target) {
  std::vector<std::filesystem::path> inputs;
  if (!std::filesystem::exists(corpus / target.name)) return inputs;
  for (const auto& entry : std::filesystem::directory_iterator(corpus / target.name))
    inputs.push_back(entry.path());
  std::ranges::sort(inputs);
  return inputs;
}

bool accepted(const Target& target, const std::string& input) {
  return accepts(target, bytes_of(input));
}

class FuzzCorpus : public testing::TestWithParam<Target> {
 protected:
  static void SetUpTestSuite() {
    av_log_set_level(AV_LOG_QUIET);
    // Takes are written so that they survive a power cut, which takes long on a disk.
    if (std::filesystem::is_directory("/dev/shm")) ::setenv("TMPDIR", "/dev/shm", 0);
  }
};

// A target that refuses all that it has would look at nothing but its first check.
TEST_P(FuzzCorpus, HasSomethingThatIsAccepted) {
  bool some = false;
  for (const std::filesystem::path& input : inputs_of(GetParam()))
    some = accepted(GetParam(), session::content_of(input)) || some;
  EXPECT_TRUE(some);
}

TEST_P(FuzzCorpus, BreaksNoReaderCutOrChanged) {
  for (const std::filesystem::path& input : inputs_of(GetParam())) {
    SCOPED_TRACE(input);
    const std::string whole = session::content_of(input);
    for (std::size_t cut = 0; cut < 32; ++cut)
      accepted(GetParam(), whole.substr(0, whole.size() * cut / 32));
    std::mt19937 random(1);
    for (int times = 0; times < 64; ++times) accepted(GetParam(), mutate_bytes(whole, random));
  }
}

// Every folder is some target's: one that was renamed would be read by nobody.
TEST(FuzzTargets, HaveAFolderEach) {
  for (const auto& entry : std::filesystem::directory_iterator(corpus))
    EXPECT_NE(find_target(entry.path().filename().string()), nullptr) << entry.path();
  for (const Target& target : targets()) EXPECT_FALSE(inputs_of(target).empty()) << target.name;
}

INSTANTIATE_TEST_SUITE_P(Targets, FuzzCorpus, testing::ValuesIn(targets().begin(), targets().end()),
                         [](const auto& target) { return std::string(target.param.name); });

}  // namespace previz::fuzz::fuzz_corpus_test
