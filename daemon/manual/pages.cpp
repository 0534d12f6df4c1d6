#include "daemon/manual/pages.hpp"

#include <CLI/CLI.hpp>

#include "daemon/command_line.hpp"
#include "daemon/control/request.hpp"
#include "daemon/manual/command.hpp"
#include "daemon/manual/completion.hpp"
#include "daemon/manual/man_page.hpp"
#include "daemon/set/actions.hpp"

namespace previz::manual {
namespace {

std::vector<Command> previzd_commands() {
  CLI::App app{"Path-traced previsualization for a camera rig", "previzd"};
  CommandLine said;
  add_commands(app, said);
  return commands_of(app);
}

std::vector<Command> previzctl_commands() {
  CLI::App app{"Operates a camera rig that runs previzd", "previzctl"};
  control::Request asked;
  control::add_requests(app, asked);
  return commands_of(app);
}

std::string actions_text() {
  std::string text;
  for (const set::Action& action : set::actions())
    text += std::string(action.name) + ": " + action.about + "\n";
  return text;
}

const Chapter service_chapter{"THE SERVICE", R"(
previzd.service runs `previzd run --bus --loop /etc/previzd/set.toml` as the user previz. When the set file is saved, it is loaded again, at the latest on `systemctl reload previzd`. If it has a mistake, the old one keeps running, and the journal and `previzctl status` say what is wrong. What buttons have moved and relit stays.
`previzctl action keep` writes what buttons have changed into the set file. As installed, the service may write nowhere in /etc: keep the set file in /var/lib/previzd, or let the service write (`systemctl edit previzd`, ReadWritePaths=/etc/previzd) into a folder that belongs to previz.
`journalctl -u previzd` shows what it reports, each line with the priority of its severity: with `-p err` only the errors. Each loss of a device is a line, from the second on with its number ("the 3rd time in this run"); what repeats with every frame is a line the first, the 10th, 100th and 1000th time.
Members of the group previz may operate the rig with previzctl.
)"};

const Chapter examples_chapter{"EXAMPLES",
                               R"(
previzd devices: Lists the cameras, buttons and screens that are plugged in, by the names that a set file uses.
previzd devices --learn: Prints the name of every button that is pressed.
previzd devices --rules: Prints the lines by which the service may open pads, pedals and GPIO chips, for /etc/udev/rules.d.
previzd print board charuco:7x5:30mm:22mm:5x5_100 --out board.pdf: Draws a board for the calibration of the lenses, to be printed on A4 at 100 %.
previzd print tags --ids 0-11 --size 80mm --out tags.pdf: Draws twelve tags with crop marks, and a ruler by which the printer's scale is checked.
previzd calibrate observer views --board charuco:7x5:30mm:22mm:5x5_100 --out lens.toml: Measures the film camera's lens from a folder of pictures of a board, and writes the tables for the set file.
previzd calibrate observer views --board aprilgrid:6x6:88mm:26.4mm --out lens.toml: Does the same by Kalibr's AprilGrid: 6x6 tags of 88 mm with gaps of 26.4 mm, which is its tagSpacing of 0.3. The output names the form found.
previzd print board aprilgrid:6x6:40mm:12mm:kalibr --paper A3 --out board.pdf: Draws an AprilGrid as Kalibr prints it, which both programs find.
previzd calibrate light views --board charuco:7x5:30mm:22mm:5x5_100 --tags desk.toml: Measures the fisheye's lens, and finds where it stands by the set's tags.
previzd calibrate response bracket --camera observer --out response.toml: Measures the film camera's response curve, and from which code on it clips, from a folder of pictures of one view at several shutter times. The longest exposure should be two stops longer than a bright even area needs to become white.
previzd calibrate from camchain.yaml --camera cam0 --out lens.toml: Takes a lens that Kalibr, OpenCV, ROS or COLMAP calibrated.
previzd calibrate from cameras.txt --as observer: Makes a fisheye of COLMAP the film camera's lens, and says by how many pixels it is off at worst.
previzd calibrate tags walk --set desk.toml --size 80mm --write: Finds where the tags are, from a walk with the film camera past all of them, and writes that into the set file.
previzd check desk.toml: Lists every mistake in a set file, or what its scene asks of the renderer.
previzd run desk.toml: Composites live. The rig's buttons, or previzctl, do the rest.
previzd render takes/12A_take003 --out renders/12A_take003: Renders a take with the settings that it was recorded with. Called again, it continues where it stopped.
previzd render takes/12A_take003 --set relit.toml --spp 512 --frames 100-150 --out renders/relit: Renders a part of a take with other settings: other lamps, other objects, more samples.
previzd trade desk.toml --axes estimator,depth: Measures what the estimator and the number of bounces cost and bring on this set.
previzd trade takes/12A_take003 --set desk.toml --fps 25 --error 2% --out trade: Finds the settings that hold 25 pictures a second with the least error, and those that reach an error of 2 % in the least time.
previzd trade takes/12A_take003 --set desk.toml --out trade --minutes 20: Goes on from what the last one measured there, with more time.
previzd run desk.toml --with trade/live.toml: Composites live with what the trade has found.
previzd render takes/12A_take003 --with trade/post.toml: Renders with what the trade has found.
previzd import frames.json sessions/desk: Makes a take of your own pictures or video.
previzd takes list /var/lib/previzd/takes: Lists the takes: which are good, how long they are, what they lack, and how much of each is rendered.
previzd takes mark takes/12A_take003: Marks a take as good, as the rig's action mark_good does; with --not the mark goes.
previzd takes copy takes/12A_* --to /media/disk/day1: Copies takes, and reads the copies back. Each has its checksums in SHA256SUMS, for `previzd takes check` and for `sha256sum -c`.
previzd takes check takes/12A_take003 --repair repaired: Reads a take from end to end; if it was cut off or damaged, writes every frame and line of it that is whole into the new take repaired/12A_take003, which says what is lost. The damaged one stays as it is.
previzd takes delete takes/12A_take001: Deletes a take. A good one is deleted with --good only, and what is not the take's own stays.
previzd render takes --good --out renders: Renders all good takes, each into a folder of its name.
previzd track takes/12A_take003 --out poses.jsonl: Finds the camera in every frame without rendering, and says why it is lost where it is.
previzd export takes/12A_take003 camera: Writes the take's camera for USD and Nuke, and each object where it stands.
)",
                               true};

const Chapter glossary_chapter{"GLOSSARY", R"(
bracket: Several exposures of the same view, from dark to bright, which together hold both the lamps and the room.
carrier: A thing that is moved by hand, such as a stick or a tray, with a tag on it. Objects and lamps can be attached to it.
composite: The finished picture: the plate with the virtual objects, their shadows and their light.
difference: The light that the virtual objects add to the real set or take from it.
film camera: The camera whose picture is composited; the table [observer] of a set file.
keep: To write what buttons have changed into the set file.
lamp: A light source: one that was found in the light camera's picture ("found 1"), or one that the set file declares.
layer: One of the pictures that an EXR file consists of, such as mask or depth.
light camera: The fisheye that looks at the lamps and measures the light on the set.
live: The mode in which every frame is composited as it comes.
mixed world: The set as the composite shows it, with the virtual objects and lamps.
phantom: The model of a real thing. It is not seen, but virtual objects are hidden behind it, cast shadows on it and are reflected in it.
plate: The film camera's own picture, to which the virtual objects are added.
pose: Position and orientation, usually those of the film camera.
real world: The set as it stands there, by its phantoms and its real lamps.
refine: To freeze a frame and add samples to it until the noise is gone.
removed object: A real thing that is taken out of the picture.
review: To play the last take.
rig: The cameras, buttons and screen together with the computer that previzd runs on.
sample: One path of light that is followed for a pixel. More samples mean less noise and more time.
session: The folder that holds a recorded or imported take.
set file: The description of one stage: cameras, tags, objects, lamps and settings; see previz-set(5).
slate: The name of scene and shot, from which the names of takes are made.
standby: The mode in which the screen is dark and nothing is rendered; the cameras stay open.
tag: A printed AprilTag by which the film camera is located.
take: A recording, by default from two seconds before the button was pressed until it was pressed again.
variant: One of the looks of an object that its file names, with materials of its own (KHR_materials_variants).
virtual object: A thing that exists only in the composite.
)",
                               true};

const Chapter tags_chapter{"WHERE THE TAGS ARE", R"(
Print tags at 100 %, measure the ruler on the sheet, and glue them onto something flat and stiff. Lay one on the floor or table where the origin of the set is to be, face up: it defines the world (or another, whose place the set file has).
Film them with the film camera, at the zoom and focus of its calibration, slowly and with a short shutter time: walk around the set, from one side to the other, near and far, so that each picture shows two tags or more, and each tag is seen from at least four places. Nothing may be touched meanwhile.
`previzd calibrate tags FOOTAGE --set SET --size 80mm` then lists each tag with how certain its place is. A tag that moved is named, with the pictures between which it did; one that is not as large as stated is measured; and what the walk lacks is said. A good map is certain to a millimetre and a tenth of a degree, with an rms below half a pixel.
If the set has the table `[observer.lens_fit]`, which `previzd calibrate observer` prints behind the lens, the lens is refined as well: boards and tags are adjusted together, and what the boards left open at the edges of the picture is found from tags that are seen there. The output gives the rms before and after and how far the lens moves in the corner of the picture, or why it stays; `--write` writes lens and tags together.
The size is that of the black border, from outer edge to outer edge, as measured on the paper. Better than the size of one tag is a tape across the whole set: with `--distance 0-7:2.345m` the distance between the middles of two tags gives all lengths.
)"};

const Chapter lenses_chapter{"LENSES OF OTHER PROGRAMS", R"(
`previzd calibrate from FILE` recognises by their content: OpenCV's YAML, XML and JSON (4, 5 or 8 coefficients, or a fisheye's 4), ROS's camera_info (plumb_bob, rational_polynomial, equidistant), Kalibr's camchain (pinhole with radtan, equidistant or none), and COLMAP's cameras.txt (all models up to FULL_OPENCV and OPENCV_FISHEYE). What is assumed or converted is said, such as COLMAP's pixels, which are counted from the corner of the first one and not from its centre.
A fisheye becomes the light camera's lens and a pinhole the film camera's, unless `--as` says otherwise: then the one is fitted by the other's model, and the worst difference over the picture is said. More than 0.1 px needs `--force`.
Not supported are thin prisms and tilted sensors, Kalibr's omni, eucm, ds and fov, COLMAP's FOV and THIN_PRISM_FISHEYE, Nuke's LensDistortion and the lenses of 3DEqualizer: calibrate with another model, or from pictures of a board.
)"};

const Chapter previzd_status{"EXIT STATUS", R"(
0: Done.
1: An error; one line on standard error says which.
2: The command line cannot be understood.
75: The service ended after a take, because another version was installed meanwhile, or to open a graphics card whose driver was loaded after its start, and is started again.
128+N: Stopped by signal N. Finished frames are on disk, and a render that is called again continues there. (A rig that is stopped has done its work: 0.)
)"};

const Chapter previzd_cameras{"NETWORK CAMERAS", R"(
A GigE Vision camera obeys whoever asks first and proves nothing of itself: any host that reaches the camera can take it over, and one that answers under its serial number or address is taken for it. Connect such cameras to a network port of the rig's computer that nothing else is connected to, without a router and without forwarding (`sysctl net.ipv4.ip_forward` is 0, `net.ipv4.conf.all.rp_filter` is 1), and name them in the set file by their addresses.
What aravis cameras send is received by a process of its own for each camera, previzd-aravis. It can open no file and start no program, packets of other hosts and packets that are not whole do not reach it, from the moment that it has a socket, and one that ends or does not answer is replaced: the camera is reported lost, and found again within two seconds. A take goes on meanwhile.
The process of a camera on the USB opens files below /dev/bus/usb, /sys and /run/udev only, which takes a kernel with Landlock (Linux 5.13 or later; Debian's has it). Without Landlock such a camera is refused.
)"};

const Chapter previzd_files{"FILES", R"(
/etc/previzd/set.toml: The set file that the service runs; as installed, a demonstration that needs no camera.
/usr/libexec/previzd/previzd-aravis: Receives from one aravis camera; previzd starts it.
/usr/share/previzd/demo: The take that the demonstration plays.
/usr/share/doc/previzd/examples: A set file to start from, and a reference of every key.
/var/lib/previzd: Takes and snapshots, unless the set file says otherwise. The file graphics-device in it names the graphics card that the rig had last, which it waits for if it is missing; without the file, the CPU draws then.
/run/previzd: The newest picture (picture.png) and metrics.json, of each second.
/usr/share/doc/previzd/examples/takes-disk.conf, cameras.conf: How the service is changed for takes on disks of their own, and for cameras of known addresses.
)"};

// What is written beside the pictures, and what a take consists of.
const Chapter previzd_formats{"FORMATS", R"(
session.toml: In a take: its name, slate, number and timecode, whether it is good, the calibrations, what was lost, and the set file word for word. Versions of previzd that do not know k4, k5 and k6 of a calibration read it without them.
observer.mkv, light.mkv, composite.mkv: In a take: the cameras' pictures, and what was shown; lossless (FFV1). The lines of observer.jsonl and so on have the time and exposure of each frame. They also name each picture by its checksum, by which it is found in a video whose head is torn.
track.jsonl: In a take: the camera's pose in each frame that was tracked while it was shown, and what was moved, relit or carried; world_from_camera are 16 numbers, row by row.
events.jsonl: In a take: buttons and whatever else happened, in order.
assets: In a take: the files that the set names, each under the SHA-256 of its content.
frames.jsonl: Beside rendered pictures, a line a frame: whether it was rendered or why not, samples, seconds, the camera's pose with its error in pixels and the tags it is from, the light frames, and size and SHA-256 of its files. A render that goes on checks them, and renders a frame again whose file is missing or was changed, or that has no line; it says which and why.
render.json: Beside rendered pictures: the settings they were made with.
render.lock: Beside rendered pictures: the processes that are at work there, a line each, with the frames they have. Several `previzd render` of one take may share a folder, on several computers over NFS as well: each renders frames that no other has, and the one that finishes last makes the review video. One that ends while others still render names them and exits with 0. Use --force with the first of them only.
poses.jsonl: Written by `previzd track --out`, a line a frame: frame, timestamp_ns, tracked; world_from_camera (4 rows of 4, metres, OpenCV axes, world Z up; as the track of FRAMES.json takes it), covariance, tags and reprojection_rms_px, or the reason why there is no pose; and carriers that were found.
camera.chan: Written by `previzd export`: frame, position, rotation and vertical angle of view. The rotation order is ZXY, Nuke's own; Blender's import must be set to it. It holds neither the lens's distortion nor its principal point; camera.usda has both, the distortion in words.
)",
                              true};

const Chapter previzctl_status{"EXIT STATUS", R"(
0: Done.
1: The rig refused, or no rig answers; one line on standard error says why.
2: The command line cannot be understood.
)"};

const Chapter set_description{"DESCRIPTION", R"(
A set file describes one stage: which cameras there are, where the tags hang, what is real and what is not, and how the set is lit. It is TOML. `previzd check FILE` lists every mistake in it, with its line. The terms are explained in previzd(8), GLOSSARY.
Lengths are in the unit in which the key's name ends; the world is right-handed, Z up; colours are linear Rec. 709. A table in double brackets appears once for each thing that it describes. Each key is shown with its default.
)"};

Chapter see_also(const std::string& pages) {
  return {"SEE ALSO", pages};
}

}  // namespace

std::vector<Page> man_pages() {
  return {{"previzd.8", man_page(previzd_commands(), 8,
                                 {service_chapter, examples_chapter, tags_chapter, lenses_chapter,
                                  glossary_chapter, previzd_cameras, previzd_files, previzd_formats,
                                  previzd_status, see_also("previzctl(1), previz-set(5)")})},
          {"previzctl.1", man_page(previzctl_commands(), 1,
                                   {{"ACTIONS", actions_text()},
                                    previzctl_status,
                                    see_also("previzd(8), previz-set(5)")})},
          {"previz-set.5", set_man_page(set_description, see_also("previzd(8), previzctl(1)"))}};
}

std::vector<Page> bash_completions() {
  return {{"previzd", bash_completion(previzd_commands())},
          {"previzctl", bash_completion(previzctl_commands())}};
}

}  // namespace previz::manual
