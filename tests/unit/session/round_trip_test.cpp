#include "daemon/core/session/crc32.hpp"
#include "drivers/plate.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::session::session_round_trip_test {

struct Picture {
  PixelFormat format;
  int width, height;
};

// A session of these frames and records, written and opened again.
Session session_of(const TemporaryDirectory& directory, const auto&... what) {
  SessionWriter writer(directory.path(), {});
  (writer.write(what), ...);
  writer.close();
  return open_session(directory.path());
}

class RoundTrip : public testing::TestWithParam<std::tuple<Picture, VideoCodec>> {};

TEST_P(RoundTrip, EveryFrameComesBackBitForBit) {
  const auto [picture, codec] = GetParam();
  const auto [format, width, height] = picture;
  const TemporaryDirectory directory;
  {
    SessionWriter writer(directory.path(), {}, std::chrono::seconds(1), codec);
    for (int i = 0; i < 3; ++i) writer.write(noise_frame("observer", i, format, width, height));
    writer.close();
  }
  Session session = open_session(directory.path());
  const auto stream = open_stream(session, "observer");
  ASSERT_TRUE(stream);
  EXPECT_TRUE(session.missing.empty()) << session.missing.front();
  ASSERT_EQ(stream->records().size(), 3u);
  for (const int i : {0, 1, 2, 1, 0, 2, 2}) {
    const FramePtr frame = stream->read(i);
    EXPECT_EQ(frame->format, format);
    EXPECT_EQ(frame->width, width);
    EXPECT_EQ(frame->height, height);
    EXPECT_TRUE(is_frame(*frame, i)) << "frame " << i;
  }
  EXPECT_THROW(stream->read(3), Error);
}

std::vector<Picture> pictures() {
  using enum PixelFormat;
  return {{rgb8, 160, 120},     {rgb16, 160, 120}, {gray8, 160, 120}, {gray16, 160, 120},
          {yuv422p8, 160, 120}, {rgb8, 8, 8},      {rgb16, 8, 9},     {gray8, 9, 8},
          {gray16, 8, 8},       {yuv422p8, 9, 9},  {yuv422p8, 35, 8}, {rgb8, 2000, 8},
          {yuv422p8, 8, 2000},  {rgb16, 8, 2000},  {gray8, 37, 21},   {rgb8, 643, 481},
          {gray16, 643, 481}};
}

INSTANTIATE_TEST_SUITE_P(Formats, RoundTrip,
                         testing::Combine(testing::ValuesIn(pictures()),
                                          testing::Values(VideoCodec::ffv1, VideoCodec::raw)));

// By the check value of the CRC-32 of IEEE 802.3, in one piece and in two.
TEST(Session, NamesPacketsByTheStandardChecksum) {
  constexpr std::array<std::uint8_t, 9> digits = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
  const std::span<const std::uint8_t> all(digits);
  EXPECT_EQ(crc32(all), 0xcbf43926u);
  EXPECT_EQ(crc32(all.subspan(4), crc32(all.first(4))), 0xcbf43926u);
}

// An earlier previzd, which knows FFV1 alone, reads what it can and refuses the rest in words.
TEST(Session, OnlyATakeWithRawVideoNeedsANewerPrevizd) {
  for (const VideoCodec codec : {VideoCodec::ffv1, VideoCodec::raw}) {
    const TemporaryDirectory directory;
    SessionWriter writer(directory.path(), {}, std::chrono::seconds(1), codec);
    writer.write(noise_frame("observer", 0, PixelFormat::rgb8, 24, 18));
    writer.write(noise_frame("composite", 0, PixelFormat::rgb8, 24, 18));
    writer.close();
    const std::string text = content_of(directory / "session.toml");
    const bool is_raw = codec == VideoCodec::raw;
    EXPECT_THAT(text, HasSubstr(is_raw ? "format_version = 2\n" : "format_version = 1\n"));
    EXPECT_EQ(text.find("codec = \"raw\"") != std::string::npos, is_raw);
    EXPECT_EQ(text.find("codec"), text.rfind("codec"));  // not the composite's
    Session session = open_session(directory.path());
    EXPECT_TRUE(is_frame(*open_stream(session, "observer")->read(0), 0));
    EXPECT_TRUE(is_frame(*open_stream(session, "composite")->read(0), 0));
  }
}

// To libav such a relative name is an address of the protocol "12".
TEST(Session, AColonInARelativePathIsNoProtocol) {
  const TemporaryDirectory directory;
  struct Return {
    std::filesystem::path to = std::filesystem::current_path();
    ~Return() { std::filesystem::current_path(to); }
  } const comes_back;
  std::filesystem::current_path(directory.path());
  write_small_session("12:A/take", 2);
  Session session = open_session("12:A/take");
  const auto stream = open_stream(session, "observer");
  ASSERT_TRUE(stream);
  EXPECT_EQ(stream->records().size(), 2u);
  EXPECT_TRUE(is_frame(*stream->read(1), 1));
  EXPECT_TRUE(std::filesystem::exists(directory / "12:A/take/observer.mkv"));
}

// As the sensor counted, with the pattern that makes colours of it.
TEST(Session, ABayerMosaicComesBackBitForBit) {
  for (const PixelFormat format : {PixelFormat::gray8, PixelFormat::gray16}) {
    const TemporaryDirectory directory;
    Frame mosaic = noise_frame("observer", 0, format, 24, 18);
    mosaic.bayer = BayerPattern::gbrg;
    SessionWriter writer(directory.path(), {});
    writer.write(mosaic);
    Frame other = noise_frame("observer", 1, format, 24, 18);
    EXPECT_THROW(writer.write(other), Error);  // the pattern is the stream's
    writer.close();
    Session session = open_session(directory.path());
    const auto stream = open_stream(session, "observer");
    EXPECT_EQ(stream->bayer(), BayerPattern::gbrg);
    const FramePtr frame = stream->read(0);
    EXPECT_TRUE(is_frame(*frame, 0));
    EXPECT_EQ(frame->bayer, BayerPattern::gbrg);
    EXPECT_EQ(to_plate(*frame).samples, to_plate(mosaic).samples);
  }
}

TEST(Session, WhatWasMovedAndRelitComesBackBitForBit) {
  const TemporaryDirectory directory;
  TrackRecord record;
  record.scene.objects["card"] = glm::dmat4(1.0 / 3);
  record.scene.objects["a \"b\""].emplace()[3] = {1e-9, -7, 0.1, 1};
  record.scene.objects["not there yet"] = std::nullopt;
  record.scene.lights["key"] =
      LightState{{0.1, 0.2, 0.3}, {0, 0, -1}, {0, 1, 0}, 1.0 / 7, {1.1, 1, 0.9}};
  record.scene.lights["torch"] = std::nullopt;
  record.scene.variants = {{"card", "a \"b\""}, {"vase", ""}};
  record.scene.hides_tags = false;
  record.scene.environment_turn_rad = -1.0 / 3;
  record.scene.animation_s = 1.0 / 3;
  CarrierState& stick = record.carriers["stick"];
  stick.world_from_carrier = glm::dmat4(1.0 / 7);
  stick.covariance[7] = 1e-9 / 3;
  stick.tags = {7, 11};
  TrackRecord plain;
  plain.frame = 1;
  const Session session = session_of(directory, record, plain);
  ASSERT_EQ(session.track.size(), 2u);
  EXPECT_EQ(session.track[0].scene, record.scene);
  EXPECT_EQ(session.track[0].carriers, record.carriers);
  EXPECT_EQ(session.track[1].scene, SceneState{});
  EXPECT_TRUE(session.track[1].carriers.empty());
}

TEST(Session, TheTakeIsKnownAndCanBeMarkedAfterwards) {
  const TemporaryDirectory directory;
  const TakeInfo take{7, "12A \"close\"", "14:03:27:12", 23.976, "two\nlines", false};
  {
    SessionInfo info;
    info.take = take;
    info.take->timecode = "";
    SessionWriter writer(directory.path(), info);
    writer.write(noise_frame("observer", 0, PixelFormat::rgb8, 24, 18));
    writer.set_take(take);
    writer.write_event(17, "record \"on\"");
  }
  EXPECT_EQ(open_session(directory.path()).info.take, take);
  change_take(directory.path(), [](TakeInfo& info) { info.good = true; });
  Session session = open_session(directory.path());
  EXPECT_TRUE(session.info.take->good);
  EXPECT_TRUE(session.missing.empty());
  EXPECT_EQ(open_stream(session, "observer")->records().size(), 1u);
  EXPECT_EQ(content_of(directory / "events.jsonl"),
            "{\"timestamp_ns\":17,\"event\":\"record \\\"on\\\"\"}\n");
}

TEST(Session, TwoStreamsAndTrackInOneSession) {
  const TemporaryDirectory directory;
  TrackRecord tracked;
  tracked.frame = 0;
  tracked.timestamp_ns = 17;
  tracked.tracked = true;
  for (int i = 0; i < 16; ++i) tracked.world_from_camera[i % 4][i / 4] = 1.0 / (3.0 + i);
  for (int i = 0; i < 36; ++i) tracked.covariance[i] = 1e-300 * i / 7.0;
  tracked.tags = {0, 2, 17};
  tracked.captured_light = {{{3, {0.6, 0, 0.8}, 0.1 / 3, {1e-300, 2.0 / 7, 1e30}}},
                            2,
                            {{0, 1.0f / 3, 1e-30f}, {1, 2, 3}, {4, 5, 6}, {7, 8, 9}}};
  TrackRecord lost;
  lost.frame = 1;
  lost.timestamp_ns = std::numeric_limits<std::int64_t>::max();
  Session session = session_of(directory, noise_frame("light", 0, PixelFormat::gray16, 32, 32),
                               noise_frame("observer", 0, PixelFormat::rgb8, 40, 30), tracked,
                               noise_frame("light", 1, PixelFormat::gray16, 32, 32), lost);
  EXPECT_TRUE(session.missing.empty());
  ASSERT_EQ(session.track.size(), 2u);
  EXPECT_EQ(session.track[0].world_from_camera, tracked.world_from_camera);
  EXPECT_EQ(session.track[0].covariance, tracked.covariance);
  EXPECT_EQ(session.track[0].tags, tracked.tags);
  EXPECT_EQ(session.track[0].captured_light, tracked.captured_light);
  EXPECT_FALSE(session.track[1].captured_light);
  EXPECT_EQ(session.track[1].timestamp_ns, lost.timestamp_ns);
  EXPECT_FALSE(session.track[1].tracked);
  EXPECT_TRUE(is_frame(*open_stream(session, "light")->read(1), 1));
  EXPECT_TRUE(is_frame(*open_stream(session, "observer")->read(0), 0));
  EXPECT_TRUE(session.missing.empty());
}

TEST(Session, AStreamThatIsNotThereIsNull) {
  const TemporaryDirectory directory;
  write_small_session(directory / "take", 1);
  Session session = open_session(directory / "take");
  EXPECT_EQ(open_stream(session, "light"), nullptr);
  EXPECT_TRUE(session.missing.empty());
}

// Two frames in a millisecond, and a device clock that jumps back: Matroska time must not collide.
TEST(Session, TimestampsMayBeCloseOrJump) {
  const TemporaryDirectory directory;
  const std::int64_t second = 1'000'000'000;
  const std::int64_t times[] = {5 * second, 5 * second + 1, 5 * second + 2,
                                4 * second, INT64_MAX,      0};
  {
    SessionWriter writer(directory.path(), {});
    for (std::size_t i = 0; i < std::size(times); ++i) {
      Frame frame = noise_frame("observer", i, PixelFormat::gray8, 8, 8);
      frame.timestamp_ns = times[i];
      writer.write(frame);
    }
  }
  Session session = open_session(directory.path());
  const auto stream = open_stream(session, "observer");
  EXPECT_TRUE(session.missing.empty());
  ASSERT_EQ(stream->records().size(), std::size(times));
  for (std::size_t i = 0; i < std::size(times); ++i) {
    EXPECT_EQ(stream->read(i)->timestamp_ns, times[i]);
    EXPECT_EQ(stream->read(i)->bytes, noise_frame("", i, PixelFormat::gray8, 8, 8).bytes);
  }
}

TEST(Session, AssetsAreKeptByContent) {
  const TemporaryDirectory directory;
  write_content(directory / "ball.glb", "glTF-like");
  const std::filesystem::path take = directory / "take";
  {
    SessionWriter writer(take, {});
    writer.add_asset("models/ball.glb", directory / "ball.glb");
    writer.add_asset("the same \"ball\".glb", directory / "ball.glb");
    EXPECT_THROW(writer.add_asset("x", directory / "absent.glb"), Error);
  }
  const Session session = open_session(take);
  EXPECT_TRUE(session.missing.empty());
  // Reference: printf 'glTF-like' | sha256sum
  const std::string path =
      "assets/373e953a74bded1677eb56b6088c62e68bad6de08da97af804fea097553c60f5.glb";
  EXPECT_EQ(session.info.assets.at("models/ball.glb"), path);
  EXPECT_EQ(session.info.assets.at("the same \"ball\".glb"), path);
  EXPECT_EQ(content_of(take / path), "glTF-like");

  write_content(take / path, "glTF-lick");
  EXPECT_TRUE(mentions(open_session(take).missing, "was changed"));
  std::filesystem::remove(take / path);
  EXPECT_TRUE(mentions(open_session(take).missing, "missing"));
}

TEST(Session, WhatCannotBeRecordedIsRefused) {
  const TemporaryDirectory directory;
  SessionWriter writer(directory.path(), {});
  const Frame good = noise_frame("observer", 0, PixelFormat::rgb8, 8, 8);
  const auto refuses = [&](auto change) {
    Frame frame = good;
    change(frame);
    EXPECT_THROW(writer.write(frame), Error);
  };
  refuses([](Frame& f) { f.source = "../escape"; });
  refuses([](Frame& f) { f.bytes.pop_back(); });
  refuses([](Frame& f) { f.width = 0; });
  refuses([](Frame& f) {
    f.width = 7;
    f.bytes.resize(7 * 8 * 3);
  });
  refuses([](Frame& f) { f.exposure = 0; });
  refuses([](Frame& f) { f.exposure = std::numeric_limits<double>::quiet_NaN(); });
  refuses([](Frame& f) { f.exposure_s = std::numeric_limits<double>::infinity(); });
  writer.write(good);
  EXPECT_THROW(writer.write(noise_frame("observer", 1, PixelFormat::rgb8, 8, 9)), Error);
  EXPECT_THROW(writer.write(noise_frame("observer", 1, PixelFormat::gray8, 8, 8)), Error);
  TrackRecord record;
  record.tracked = true;
  record.covariance[3] = std::numeric_limits<double>::infinity();
  EXPECT_THROW(writer.write(record), Error);
  writer.close();
  EXPECT_THROW(writer.write(good), Error);
  EXPECT_THROW(SessionWriter(directory.path(), {}), Error);  // not empty
}

TEST(Session, TheSameFramesMakeTheSameFiles) {
  const TemporaryDirectory directory;
  write_small_session(directory / "a", 3);
  write_small_session(directory / "b", 3);
  for (const char* file : {"session.toml", "observer.mkv", "observer.jsonl"})
    EXPECT_EQ(content_of(directory / "a" / file), content_of(directory / "b" / file));
}

}  // namespace previz::session::session_round_trip_test
