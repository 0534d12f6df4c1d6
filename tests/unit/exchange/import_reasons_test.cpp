// Footage that does not fit or cannot be read is refused with the reason and what leads on.
#include "daemon/core/session/av.hpp"
#include "tests/support/import_fixture.hpp"

namespace previz::exchange::import_reasons_test {

// Calibrates the film camera for pictures of that size.
void calibrate(Shoot& shoot, int width, int height) {
  shoot.json["observer"]["intrinsics"] = {{"width", width}, {"height", height}, {"fx", width},
                                          {"fy", width},    {"cx", width / 2},  {"cy", height / 2}};
}

// The refusal of a video whose frames have another size than the calibration, 32x16.
std::string refusal(const VideoForm& form) {
  Shoot shoot;
  shoot.film("take.mov", form, {Bytes(3 * static_cast<std::size_t>(form.width * form.height), 90)});
  calibrate(shoot, 32, 16);
  return shoot.error();
}

TEST(ImportVideo, ASizeThatDoesNotFitSaysWhy) {
  VideoForm form = {.encoder = "png"};
  form.pixel_aspect = {2, 1};
  EXPECT_THAT(refusal(form),
              AllOf(HasSubstr("is 64x16; "), HasSubstr("is for 32x16"),
                    HasSubstr("its pixels, 2:1 wide to high, are resampled to square; \"read_as\": "
                              "{\"pixel_aspect\": [1, 1]} beside \"video\" keeps the file's 32x16"),
                    HasSubstr("intrinsics for 64x16 fit with fx * 2, (cx + 0.5) * 2 - 0.5")));
  form.pixel_aspect = {0, 1};
  form.display_matrix = {0, 1 << 16, 0, -(1 << 16), 0, 0, 0, 0, 1 << 30};
  EXPECT_THAT(refusal(form),
              AllOf(HasSubstr("is 16x32; "), HasSubstr("turned by 90 degrees"),
                    HasSubstr("\"read_as\": {\"rotation_deg\": 0}"),
                    HasSubstr("the calibration is for the picture turned by a quarter")));
  form.display_matrix = {};
  form.width = 64;
  form.height = 32;
  EXPECT_THAT(refusal(form), HasSubstr("intrinsics for 64x32 fit with fx * 2, (cx + 0.5) * 2 - "
                                       "0.5, fy * 2, (cy + 0.5) * 2 - 0.5"));
  form.height = 48;
  EXPECT_THAT(refusal(form), HasSubstr("crops its sensor: calibrate with pictures of this size"));
}

// Puts the tracks of both files into one.
void join_tracks(const std::vector<std::filesystem::path>& files,
                 const std::filesystem::path& target) {
  AVFormatContext* made = nullptr;
  ASSERT_GE(avformat_alloc_output_context2(&made, nullptr, nullptr, target.c_str()), 0);
  const av::Muxer muxer(made);
  std::vector<av::Demuxer> sources;
  for (const auto& file : files) {
    AVFormatContext* source = nullptr;
    ASSERT_EQ(avformat_open_input(&source, file.c_str(), nullptr, nullptr), 0);
    sources.emplace_back(source);
    AVStream* track = avformat_new_stream(made, nullptr);
    avcodec_parameters_copy(track->codecpar, source->streams[0]->codecpar);
    track->time_base = source->streams[0]->time_base;
  }
  ASSERT_GE(avio_open(&made->pb, target.c_str(), AVIO_FLAG_WRITE), 0);
  ASSERT_GE(avformat_write_header(made, nullptr), 0);
  const av::Packet packet(av_packet_alloc());
  for (std::size_t i = 0; i < sources.size(); ++i)
    while (av_read_frame(sources[i].get(), packet.get()) == 0) {
      packet->stream_index = static_cast<int>(i);
      av_packet_rescale_ts(packet.get(), sources[i]->streams[0]->time_base,
                           made->streams[i]->time_base);
      ASSERT_GE(av_interleaved_write_frame(made, packet.get()), 0);
    }
  ASSERT_EQ(av_write_trailer(made), 0);
}

TEST(ImportVideo, SeveralTracksAreSaidAndWhichIsUsed) {
  Shoot shoot;
  shoot.film("small.mov", {.encoder = "png"}, {Bytes(3 * 32 * 16, 90)});
  shoot.film("large.mov", {.width = 64, .height = 48, .encoder = "png"},
             {frame_bytes_of(noise_picture(1, CV_8UC3, 64, 48))});
  join_tracks({shoot.folder() / "large.mov", shoot.folder() / "small.mov"},
              shoot.folder() / "take.mov");
  shoot.json["observer"]["video"] = "take.mov";
  const char* words = "has 2 video tracks, 64x48 and 32x16; number 1 is used";
  calibrate(shoot, 32, 16);
  EXPECT_THAT(shoot.error(), HasSubstr(words));
  shoot.json["observer"].erase("intrinsics");
  EXPECT_THAT(shoot.import().notes, Contains(HasSubstr(words)));
}

// ------------------------------------------------------------ what cannot be decoded

// A video of that name whose container says that it is coded so.
std::string refusal_of(const std::string& name, const std::string& mark) {
  Shoot shoot;
  shoot.film("take.mov", {.encoder = "png"}, {Bytes(3 * 32 * 16, 90)});
  std::string bytes = session::content_of(shoot.folder() / "take.mov");
  bytes.replace(bytes.rfind("png ", bytes.find("stts")), 4, mark);
  session::write_content(shoot.folder() / name, bytes);
  shoot.json["observer"]["video"] = name;
  return shoot.error();
}

TEST(ImportVideo, RawFilmIsNamedWithTheWayThatLeadsOn) {
  struct Case {
    const char *name, *mark, *format;
  };
  for (const Case& film :
       {Case{"A.braw", "brhq", "Blackmagic RAW"}, Case{"B.mov", "brst", "Blackmagic RAW"},
        Case{"C.mov", "aprn", "ProRes RAW"}, Case{"D.mov", "aprh", "ProRes RAW"},
        Case{"E.CRM", "CRAW", "Canon Cinema RAW"}})
    EXPECT_THAT(refusal_of(film.name, film.mark),
                AllOf(HasSubstr(std::string(film.name) + ": is " + film.format),
                      HasSubstr("export ProRes 4444 or DNxHR"), HasSubstr("proxy")));
  EXPECT_THAT(refusal_of("F.mov", "wxyz"), HasSubstr("is coded as \"wxyz\""));
  EXPECT_THAT(refusal_of("G.mov", "encv"), HasSubstr("is encrypted"));
  EXPECT_THAT(refusal_of("H.mov", "SVQ3"), HasSubstr("svq3"));
  // No container at all.
  for (const auto& [name, bytes, format] :
       {std::tuple{"I.R3D", std::string("\0\0\1\0RED2", 8), "REDCODE RAW"},
        std::tuple{"J.bin", std::string("\0\0\1\0RED1", 8), "REDCODE RAW"},
        std::tuple{"K.ari", std::string("ARRI"), "ARRIRAW"},
        std::tuple{"L.NEV", std::string("?"), "Nikon N-RAW"}}) {
    Shoot shoot;
    session::write_content(shoot.folder() / name, bytes + std::string(1024, '\0'));
    shoot.json["observer"] = {{"video", name}, {"fps", 25}, {"exposure", 1}};
    EXPECT_THAT(shoot.error(), HasSubstr(std::string("is ") + format));
  }
}

TEST(ImportDescription, PicturesThatAreAVideoAreToldSo) {
  for (const char* name : {"x.m2ts", "x.ts", "x.MPG", "x.3gp", "x.braw", "x.r3d", "x.webm",
                           "x.h264", "x.hevc", "x.crm", "x.nut", "x.dv", "x.mp4", "x.nev"}) {
    Shoot shoot;
    shoot.json["observer"]["pictures"] = name;
    EXPECT_THAT(shoot.error(), HasSubstr("is a video; use \"video\" instead")) << name;
  }
}

}  // namespace previz::exchange::import_reasons_test
