#include "daemon/manual/pages.hpp"

#include <CLI/CLI.hpp>

#include "daemon/command_line.hpp"
#include "daemon/control/request.hpp"
#include "daemon/core/set/actions.hpp"
#include "daemon/manual/command.hpp"
#include "daemon/manual/completion.hpp"
#include "daemon/manual/farm_chapters.hpp"
#include "daemon/manual/man_page.hpp"
#include "daemon/tools/command_line.hpp"

namespace previz::manual {
namespace {

std::vector<Command> previzd_commands() {
  CLI::App app{"Path-traced previsualization for a camera rig", "previzd"};
  CommandLine said;
  add_commands(app, said);
  return commands_of(app);
}

std::vector<Command> previz_commands() {
  CLI::App app{"Tools for the takes and sets of a camera rig that runs previzd", "previz"};
  tools::CommandLine said;
  add_commands(app, said);
  return commands_of(app);
}

bool is_of_farm(const Command& command) {
  return command.path == "previz farm" || command.path.starts_with("previz farm ");
}

// Returns the commands of previz(1), where `farm` is one line: it has a page of its own.
std::vector<Command> general_commands() {
  std::vector<Command> commands = previz_commands();
  for (Command& command : commands)
    if (command.path == "previz farm")
      command = {"previz farm", command.about + ". See previz-farm(1)", {}, {}};
  std::erase_if(commands, [](const Command& command) {
    return is_of_farm(command) && command.path != "previz farm";
  });
  return commands;
}

std::vector<Command> farm_commands() {
  std::vector<Command> commands = previz_commands();
  std::erase_if(commands, [](const Command& command) { return !is_of_farm(command); });
  return commands;
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

const Chapter rig_chapter{"A RIG", R"(
A rig has a film camera, a fisheye that sees the lamps, tags, a model of what is really there, a set file, buttons and a screen. `previzd devices` lists what is plugged in, and `previzd check SET` says what is missing.

Cameras: USB and other V4L2 cameras, camera modules through libcamera, GigE Vision and USB3 Vision cameras through Aravis, or a take in place of a camera. The film camera has a calibrated lens; the light camera is a fisheye and takes brackets. An environment can stand in for it (previz(1), THE LIGHT). A camera that is missing, stalls or is unplugged is reopened when it is back, and the others continue meanwhile; `faults` in the set file rehearses that.

Tags: `previz print tags` draws AprilTags. Stick them on, film a walk past all of them, and `previz calibrate tags` finds where they are (previz(1), WHERE THE TAGS ARE). With `hide = true` in [tags] the printed tags are removed from the picture.

Model: `previz model` makes the phantom, a glTF file of what really stands there, from the tags and from corners marked in a few pictures or on the rig (previz(1), THE MODEL).

Objects: Objects and lamps can be attached to a tag on a stick or a tray and carried around (`carrier`). glTF animations play (`animation`), and an object is shown in any variant of its materials that its file has (`variant`). Lamps in a glTF file light the set, too: `previzd check` compares each with the film camera's white, and `lamp_gain` scales those of an object. Real lamps can be dimmed, tinted and switched off in the picture: those that the set declares (`gain_real`), those it knows by direction only ([[captured_light]]), and, by buttons, any that is found in the light camera's picture.

Buttons: A [[button]] maps a short, long or double press to an action, and [[gpio]] says how contacts are wired. `previzd devices --learn` shows the button that is pressed, and previzctl(1) lists the actions. A button that is pressed more than 8 times per second is treated as broken, reported, and ignored until it is quiet for a second.

Screen: `driver = "kms"` in [display], the default of the package, uses a screen on the computer's own graphics card, without a window system. An overlay shows mode, take, frame rate, tracking, light and every fault; it is never recorded. The actions `pass_times`, `guides` and `debug_view` show what each pass costs, where the model is, and any layer in place of the picture; guides also say how many pixels the model is off. In standby the screen is dark and free for other programs.

Takes: A take contains every frame that the cameras delivered, by default from two seconds before the button was pressed; lost frames are counted and reported. While a hand covers the tags, the live picture continues with the last motion for up to half a second, and says so ("predicted pose 0.3 s", `hold_s` in [tracking]); what is guessed is never recorded. A take in review can be moved and relit too, on top of how it was recorded.
)"};

const Chapter cards_chapter{"GRAPHICS CARDS", R"(
previzd needs Vulkan 1.3. Without a graphics card the processor draws, slowly. `previzd check` and `previzd bench` say which card and driver they find and what is missing; `previzd bench --page bench.html` measures them in about two minutes, and with a set also says what rate that set will hold. In Debian the drivers are:

NVIDIA: linux-headers-amd64 and nvidia-driver (contrib, non-free and non-free-firmware). A screen without a window system also needs `nvidia-drm.modeset=1` on the kernel's command line.

AMD: mesa-vulkan-drivers and firmware-amd-graphics.

Intel: For Arc mesa-vulkan-drivers and firmware-intel-graphics (Debian 13), or firmware-misc-nonfree and a kernel from bookworm-backports (Debian 12).

The service waits for a graphics card that is gone: the plate is shown and recording continues meanwhile.
)"};

const Chapter service_chapter{"THE SERVICE", R"(
previzd.service runs `previzd run --bus --loop /etc/previzd/set.toml` as the user previz. When the set file is saved, it is reloaded, or at the latest on `systemctl reload previzd`. If it has a mistake, the old one keeps running, and the journal and `previzctl status` report what is wrong. Changes made by buttons stay in effect, and the last take stays the one that `mark_good` marks; it can be reviewed as long as the text of the set is the one that it was recorded with. While a set loads, `previzctl status` says since when, and everything else is refused with these words.
`previzctl action keep` writes what buttons have changed into the set file; comments and order stay, and the old file is kept beside it. As installed, the service may not write anywhere in /etc: keep the set file in /var/lib/previzd, or let the service write (`systemctl edit previzd`, ReadWritePaths=/etc/previzd) to a folder owned by previz.
`journalctl -u previzd` shows what it reports, each line with its priority: `-p err` shows only the errors. Each loss of a device is logged, from the second on with its number ("the 3rd time in this run"). What repeats with every frame is logged only the 1st, 10th, 100th and 1000th time.
Members of the group previz (`adduser NAME previz`) may operate the rig with previzctl; members of previz-view see its state and its figures. polkit decides who operates it, by the action org.previz.Rig1.operate, so that a rule in /etc/polkit-1/rules.d can let others do some of it, or these not: its detail "verb" is what is to be done, an action of `previzctl actions`, a mode, or record. The journal names who did it, as in "bus, anna: recording".
The udev rules give the service access to cameras without root, and to no keyboard or contact that you have not named: `previzd devices --rules` prints the lines for pads, pedals and GPIO chips, for /etc/udev/rules.d. Network cameras are let in from private networks; cameras.conf (FILES) lets in yours alone, and takes-disk.conf puts takes on other disks.
The service starts with the machine, and is restarted if it fails or one of its threads hangs, however often. An upgrade keeps an edited set and waits for the end of a take; while one is recorded, the machine is not shut down or put to sleep. A purge removes everything except recordings.
)"};

const Chapter security_chapter{"SECURITY", R"(
What a command line and a set file of yours name is trusted: they may name any file. Takes, footage, models, scans, lens files and jobs of a farm are data that may come from anybody:

their files: A take or a job reads and writes nothing outside of its folder, by links or by names, unless `--out`, `--set` or `--any-paths` says more. A pipe, a device or a link in the place of a file is named and not opened; a file larger than its kind can be is refused before it is read.

their bytes: Every command that reads them, but for `run`, works in a process of its own. What crashes there, or takes ten minutes or half of the computer's memory for one file, ends with a line that names the file, and leaves nothing half done. But for `check` and the submission to a farm, this process has no network, runs no program and makes and changes files only in the folders that it was asked to write to, in ~/.cache, for compiled shaders, and in /tmp, /var/tmp, /dev and /proc (by seccomp and Landlock; where the kernel lacks them, a line of the log says so); for a new file or folder, that is the folder that it is made in. It can read what its user can, and talk to services of the same computer: render takes of strangers as a user who has no secrets and no desktop. FBX files and cameras of a network are read by processes without any file.

their words: Names and texts of others are shown with control characters as \x1b and the like.

Over D-Bus the groups previz and previz-view see the state of the rig, and root and whom polkit lets operate it (THE SERVICE). Whoever is at its buttons operates it, too.

What a package contains and was made of is in its SPDX list, /usr/share/doc/previzd/previzd.spdx.json (previz-tools has its own). A department signs a package with `debsigs --sign=origin` and an Ed25519 key, and `debsig-verify` verifies it by the policy in /etc/debsig/policies.

A fault by which a file reaches what it should not is best reported in private to whom previzd is from, with what `previzd --version` says.
)"};

const Chapter rig_examples{"EXAMPLES", R"(
previzd devices: Lists the cameras, buttons and screens that are plugged in, by the names that a set file uses.
previzd devices --learn: Prints the name of every button that is pressed.
previzd devices --rules: Prints the rules for /etc/udev/rules.d that let the service open pads, pedals and GPIO chips.
previzd check desk.toml: Lists every mistake in a set file, or what its scene asks of the renderer.
previzd check takes/12A_take003: Does the same for a take and its own set, and measures in five of its frames how many pixels the edges of phantoms and removed objects are from those of the pictures. Where that is more than 2 px it says what to look at. It also tracks five frames, and says what does not fit of tags and lens.
previzd run desk.toml: Composites live. The rig's buttons, or previzctl, do the rest.
previzd bench --page bench.html: Measures what this machine can do, in about two minutes, and writes a page about it. The first thing to run on a new machine.
previzd bench --no-hardware-rays: Measures it without the hardware that a graphics card may have for rays, to see what that brings.
previzd bench desk.toml --json bench.json: Also measures the frames of a set, whose newest take is used, and writes all figures as JSON.
previzd run desk.toml --with trade/live.toml: Composites live with the settings that trade found.
)",
                           true};

const Chapter tool_examples{"EXAMPLES", R"(
previz print board charuco:7x5:30mm:22mm:5x5_100 --out board.pdf: Draws a board for the calibration of the lenses, to be printed on A4 at 100 %.
previz print tags --ids 0-11 --size 80mm --out tags.pdf: Draws twelve tags with crop marks, and a ruler to check the printer's scale.
previz calibrate observer views --board charuco:7x5:30mm:22mm:5x5_100 --out lens.toml: Measures the film camera's lens from a folder of pictures of a board, and writes the tables for the set file.
previz calibrate observer views --board aprilgrid:6x6:88mm:26.4mm --out lens.toml: Does the same by Kalibr's AprilGrid: 6x6 tags of 88 mm with gaps of 26.4 mm, which is its tagSpacing of 0.3. The output names the form found.
previz print board aprilgrid:6x6:40mm:12mm:kalibr --paper A3 --out board.pdf: Draws an AprilGrid as Kalibr prints it, which both programs find.
previz calibrate light views --board charuco:7x5:30mm:22mm:5x5_100 --tags desk.toml: Measures the fisheye's lens, and finds its pose from the set's tags.
previz calibrate response bracket --camera observer --out response.toml: Measures the film camera's response curve, and from which code on it clips, from a folder of pictures of one view at several shutter times. The longest exposure should be two stops longer than a bright even area needs to become white.
previz calibrate from camchain.yaml --camera cam0 --out lens.toml: Takes a lens that Kalibr, OpenCV, ROS, COLMAP, Metashape or another program calibrated.
previz calibrate from cameras.txt --as observer: Turns a fisheye lens that COLMAP calibrated into the film camera's lens, and says by how many pixels the two differ at worst.
previz calibrate tags walk --set desk.toml --size 80mm --write: Finds the tags' positions, from a walk past all of them with the film camera, and writes them to the set file.
previz model takes/12A_take003 --set desk.toml --write: Makes the phantom of the boxes that were marked on the rig while this take was recorded.
previz model walk --set desk.toml --parts real.toml --write: Makes the phantom of the real scene from the walk's tags and the points marked in real.toml, and adds it to the set file.
previz render takes/12A_take003 --out renders/12A_take003: Renders a take with the settings that it was recorded with. Run again, it continues where it stopped.
previz render takes/12A_take003 --set relit.toml --spp 512 --frames 100-150 --out renders/relit: Renders a part of a take with other settings: other lamps, other objects, more samples.
previz render takes/12A_take003 --frames 40 --spp 4096 --neighbours 0 --sample-range 1/2 --out first: Renders the first half of a heavy frame's samples, while another computer renders 2/2.
previz merge takes/12A_take003 first second --frames 40 --spp 4096 --neighbours 0 --out renders/12A_take003: Makes the picture of both halves. If both computers have the same graphics card and driver, it is the picture of one, to the last bit.
previz farm takes/12A_take003 --out renders/12A_take003 --nodes 3: Divides the rendering of a take between three machines, by Slurm where it is installed, and otherwise by a script to be started on each. previz-farm(1) has the rest.
previz farm status renders/12A_take003.farm: Says how many frames are done, which tasks have failed, where and why, and how long the rest takes.
previz trade desk.toml --axes estimator,depth: Measures the cost and benefit of the estimator and the number of bounces on this set.
previz trade takes/12A_take003 --set desk.toml --fps 25 --error 2% --out trade: Finds the settings that hold 25 frames per second with the least error, and those that reach an error of 2 % in the least time.
previz trade takes/12A_take003 --set desk.toml --out trade --minutes 20: Continues the previous run of `previz trade` in that folder, with more time.
previz render takes/12A_take003 --with trade/post.toml: Renders with the settings that trade found.
previz import frames.json sessions/desk: Makes a take of your own pictures or video.
previz takes list /var/lib/previzd/takes: Lists the takes: which are good, how long they are, what is missing, and how much of each is rendered.
previz takes mark takes/12A_take003: Marks a take as good, as the rig's action mark_good does; --not removes the mark.
previz takes copy takes/12A_* --to /media/disk/day1: Copies takes, and reads the copies back. Each has its checksums in SHA256SUMS, for `previz takes check` and for `sha256sum -c`.
previz takes check takes/12A_take003 --repair repaired: Reads a take from end to end; if it was cut off or damaged, writes every complete frame and line of it into the new take repaired/12A_take003, which says what is lost. The damaged one is not changed.
previz takes delete takes/12A_take001: Deletes a take. A good one is deleted only with --good, and foreign files in its folder are kept.
previz render takes --good --out renders: Renders all good takes, each into a folder named after it.
previz track takes/12A_take003 --out poses.jsonl: Finds the camera in every frame without rendering, and reports why it is lost where it is, and what does not fit: tags of another family, printed twice, moved or scaled, another lens, a rolling shutter.
previz export takes/12A_take003 camera: Writes the take's camera for USD and Nuke, and each object where it stands.
)",
                            true};

const Chapter glossary_chapter{"GLOSSARY", R"(
bracket: Several exposures of the same view, from dark to bright, which together hold both the lamps and the room.
carrier: A thing that is moved by hand, such as a stick or a tray, with a tag on it. Objects and lamps can be attached to it.
composite: The finished picture: the plate with the virtual objects, their shadows and their light.
difference: The light that the virtual objects add to the real set or take from it.
estimator: How the change is computed: `paired` renders the real and the mixed world with the same random numbers and subtracts, `difference` follows only the light that differs; `additive` adds the change to the plate, `ratio` multiplies the plate by it.
film camera: The camera whose picture is composited; the table [observer] of a set file.
give or take: One standard deviation either way of the figure before it.
keep: To write the changes made by buttons to the set file.
knee: Of settings from fast to exact, the one from which on more time buys little.
lamp: A light source: one that was found in the light camera's picture ("found 1"), or one that the set file declares.
layer: One of the pictures that an EXR file consists of, such as mask or depth.
light camera: The fisheye that looks at the lamps and measures the light on the set.
live: The mode in which every frame is composited as it arrives.
mixed world: The set as the composite shows it, with the virtual objects and lamps.
phantom: The model of a real thing. It is never drawn, but virtual objects are hidden behind it, cast shadows on it and are reflected in it.
plate: The film camera's own picture, to which the virtual objects are added.
pose: Position and orientation, usually those of the film camera.
real world: The set as it really is, given by its phantoms and its real lamps.
refine: To freeze a frame and add samples to it until the noise is gone.
removed object: A real thing that is removed from the picture.
review: To play the last take.
rig: The cameras, buttons and screen together with the computer that previzd runs on.
sample: One light path traced for a pixel. More samples mean less noise and more time.
session: The folder that holds a recorded or imported take.
set file: The description of one set: cameras, tags, objects, lamps and settings; see previz-set(5).
slate: The name of scene and shot, from which takes are named.
standby: The mode in which the screen is dark and nothing is rendered; the cameras stay open.
tag: A printed AprilTag by which the film camera is located.
take: A recording, by default from two seconds before the button was pressed until it was pressed again.
unseen: What of the surroundings the light camera cannot see, mostly below its horizon; a rule of the set fills it.
variant: One of an object's looks that its file defines, with its own materials (KHR_materials_variants).
virtual object: A thing that exists only in the composite.
)",
                               true};

const Chapter clip_chapter{"FROM A CLIP TO A PICTURE", R"(
A clip of any camera with printed tags in it, a dozen photos of a board by the same lens at the same focus, and an HDRI of the room are enough. Each command writes its result into the set file, and keeps the old one beside it. The chapters below say more of each.

1. The tags and the board: `previz print tags --ids 0-3 --size 80mm` and `previz print board chessboard:9x6:25mm`.

2. The set file, my.toml: `[set]` with a `name`, `[tracking]` with `family = "tag36h11"`, `[lighting]` with `environment = "room.exr"`, and an `[[object]]` with `name`, `file` and `presence = "virtual"` for each virtual thing.

3. The lens: `previz calibrate observer PHOTOS --board chessboard:9x6:25mm --set my.toml --write`.

4. The tags: `previz calibrate tags CLIP --set my.toml --size 80mm --write`, if the clip walks around them. If it does not, measure their places with a ruler, and write a `[[tag]]` for each.

5. The take: frames.json says `{ "name": "first", "set": "my.toml", "observer": { "video": "clip.mp4", "exposure": 1 } }`; then `previz import frames.json take`.

6. What is really there: `previz model take --set my.toml --pictures marks`, mark corners in marks/model.toml, then `previz model take --set my.toml --parts marks/model.toml --overlay marks --grey --write`, and look at the pictures with the model's edges in marks. Walls keep light from the set where nobody sees them, too: say how high they are (`height_m`), and how far they go on (`margin_m`).

7. The light: `previz calibrate light take --rotation --set my.toml --write`, `previz calibrate balance take --set my.toml --write`, and for the colours `previz model take --set my.toml --parts marks/model.toml`.

8. The picture: `previzd check take --set my.toml`, and if nothing is left to mend, `previz render take --set my.toml`; for a look at one frame alone, `--frames 0 --spp 8 --neighbours 0`.
)"};

const Chapter tags_chapter{"WHERE THE TAGS ARE", R"(
Print tags at 100 %, measure the ruler on the sheet, and glue them onto something flat and stiff. Lay one face up on the floor or table, at the origin of the set: it defines the world (or another tag does, if the set file has its position).
Film them with the film camera, at the zoom and focus of its calibration, slowly and with a short shutter time: walk around the set, from one side to the other, near and far, so that each picture shows two tags or more, and each tag is seen from at least four places. Do not touch anything until you are done.
`previz calibrate tags FOOTAGE --set SET --size 80mm` then lists each tag with the accuracy of its position. It names a tag that moved, and the pictures between which it did; measures one that is not the given size; and says what to film again. A good map is accurate to a millimetre and a tenth of a degree, with an rms below half a pixel.
Where a tag falls off or is knocked while you shoot, the display names it and its distance as soon as two others disagree with it, and it is ignored until it is back: stick it back where it was, or film a walk and calibrate the tags again. Poses whose corners are farther off than noise explains are named with the likely cause, such as the lens, the scale of the prints or a rolling shutter.
If the set has the table `[observer.lens_fit]`, which `previz calibrate observer` prints behind the lens, the lens is refined as well: boards and tags are adjusted together, and what the boards left open at the edges of the picture is found from tags visible there. The output gives the rms before and after and how far the lens moves in the corner of the picture, or why it stays; `--write` writes lens and tags together.
The size is that of the black border, from outer edge to outer edge, as measured on the paper. A tape measure across the whole set is more accurate: `--distance 0-7:2.345m`, between the centres of two tags, sets the scale.
)"};

const Chapter model_chapter{"THE MODEL", R"(
The phantom is the model of what really stands on the set: it catches the shadows of virtual objects and hides them. `previz model FOOTAGE --set SET --parts FILE` makes it of planes, boxes, cylinders, rooms and scans. Flat tags give a plane by themselves; of everything else a few corners are marked by hand in two or more of the pictures, taken from different sides, each of which must show a tag of the set. Three pictures are usually enough: the first, the last, and one between.
The file of parts is TOML. parts.example.toml in /usr/share/doc/previz-tools/examples has every table and key, with what each is for. Pictures of a folder or a video need a lens in the set, [observer.intrinsics]; a session brings its own.
`previz model FOOTAGE --set SET --pictures marks` begins it: the folder marks gets up to eight pictures and model.toml, a file of parts that lists them and the planes of the set's flat tags. Open the pictures in any program that enlarges them ten times and shows the coordinates of a pixel, write what you see into model.toml, and name that with `--parts`; pictures without marks may stay. `--overlay FOLDER` draws the model, but for scans, over the pictures (frame_12.model.png): its green edges must lie on those of the real things, but for the border of a plane that has neither `edges` nor an `outline`; the red crosses are your marks. Until they do, add `--grey`: colours take half a minute, all else a second.
Boxes can be marked on the rig instead, by aiming the film camera. Give the actions `mark`, `next_box`, `unmark` and `marking` (and `next_corner`) to buttons, and start a take with `record`. `mark` shows a cross in the middle of the picture, and above it which corner comes next: aim at the first corner of a box's upper side, with a tag of the set in the picture, hold still and press `mark` again; then the second and the third, in order around. Go to another side, at least a tenth of the distance, and mark the three once more; a line in the picture then shows where the corner must be. The display says how far apart the marks of a corner are; a corner that was found has a small cross and its number, and a box with three such corners is complete. `next_box` continues to the next box, after the last to a new one, and then to the first; `unmark` withdraws the last mark, and pressed again the one before it. All marks of a box must be in one take.
End the take; `previz model TAKE --set SET --write` makes the model of these boxes, and of the planes of tags that carry one, without any file of parts. With `--pictures marks` those marks are in model.toml, where cylinders and walls can be added.
Sizes of a box are printed as length (first corner to second), width (second to third) and height; "side 1-2" is the one below the first two corners. Where a wall leaves a picture is another point in each picture.
A scan's unit matters: OBJ, PLY and STL hold bare numbers, and a scan in inches read as millimetres would be 25.4 times too small. Coordinates far from the origin, those of a country for example, keep their millimetres where the file has doubles or enough digits; where it has not, the scan is refused with what to subtract. Three points fit a mirrored scan as well, but upside down: that its `up` is not up shows it. Faces that are inside out are turned; open borders are reported.
A scan without points needs tags in its texture (PNG, JPEG or WebP; of OBJ, PLY, FBX or glTF, in the file or beside it) or in the colours of its vertices, each with at least 3 pixels per cell, 24 along a side of a tag36h11. The output names likely units and directions. A tag that is on the scan twice, is not flat there, or has another size than in the set is ignored, and the output says so. With points, the tags on the scan do not count.
The action `guides` of a button shows on the rig's display whether a model fits the live picture, wherever it comes from: lines along its edges, the tags, the horizon, the world's axes and the boxes of virtual objects, and how far the edges are from those of the picture, in pixels. Lines that are off everywhere mean the tags' places or the lens; those of one thing, the place of that.
All marks, tags and camera poses are adjusted together. Then the edges of boxes are looked for in the pictures, and the model follows them: they are more accurate than marks, which are needed to find them. The output lists the marks that are farthest off, how far the model is from the edges (a tenth of a pixel is good), and each face with its accuracy, one standard deviation where the face is worst; compare the sizes with a ruler. A mark that is off by more than 8 px (8 times `accuracy_px`) is refused.
With a session that has light, each part gets the colour (albedo) that the plates show under that light, and the tags are part of the model, with their paper and print; pictures alone give a grey model. The model is beside the file of parts and named as it is, real.glb of real.toml, unless `--out` says otherwise; its nodes and materials are named as the parts are. `--write` adds it to the set file and keeps the old one beside it (demo.toml.1.old).
Printed tags can be removed from the picture, with their light, shadows and reflections: by `hide = true` in the table [tags] of the set file, by the action `tags` of a button, or with `previz render --hide-tags`. For that a phantom must have them. `previz model` makes for each flat tag the nodes "tag 3 paper" and "tag 3 print", and from a session with light "under tag 3" as well: the surface that the tag lies on, in the colours that the plates have around it. Phantoms of other programs can have nodes of such names, too; without the last one, what is below the paper is shown as it is. To keep such a phantom, add `--tags-only --write`, for which no mark and no file of parts is needed: that puts the tags alone onto that phantom. The place of a hidden tag is rendered as a virtual object is, with as much noise, and covers what the model does not have, such as a hand over the tag.
)"};

const Chapter rendering_chapter{"RENDERING", R"(
`previz render` writes for every frame NNNN.exr, with all layers, and NNNN.png, as a display shows it, and review.mp4 of them all. They go where the set's `output.directory` says; the takes of a rig have a folder each in it, or in themselves. A render that was stopped continues where it stopped. A frame in which the camera's position is lost shows the plate untouched, and is reported.
Denoised pictures are averaged with two frames of the take on each side (`quality.neighbours`, `--neighbours`; `--neighbours 0` renders every frame alone, as a snapshot or a refinement shows it). Every frame then has random numbers of its own, by `estimator.seed` and its number. Whatever part of a take is rendered, and however often it was stopped, a picture is the same. What takes more than 4 GB of memory, or than nine tenths of what is free (pictures of 3840x2160: 12 GB), works in scratch files instead, in $TMPDIR or /var/tmp, with the same bits in every picture: `--memory 8GB` allows more or less, `--scratch DIR` names a folder on another local disk. The last line, and each line of frames.jsonl, says how much it was. Where even that is not free, the render is refused before it begins.
Processes that share a folder (render.lock, FORMATS) take 16 frames at a time, or half of a take that is shorter than 32, and each renders two more at both ends of what it takes: at 16, up to a quarter more work.
)"};

const Chapter light_chapter{"THE LIGHT", R"(
Virtual things are lit by what is really there, and shadows on real things are as deep as the model under that light says. Light that does not fit the picture is the first thing that a viewer sees, so previzd compares the two: `previzd check TAKE`, `previz render` and the running rig say how many times as bright as the picture the model of what is real comes out under this light, in red, green and blue, wherever nothing virtual is. A factor of 1.26, a third of a stop, is worth a word; a shadow never takes more light than the picture has.
A fisheye on the set is best: it sees the lamps as they are in every frame, with their colours, and follows them when they change. Let it take brackets of exposures, and calibrate it.
An environment from elsewhere (`environment` in [lighting], OpenEXR or Radiance .hdr, latitude-longitude or a cube cross, of any linear colours that it names) has neither the brightness, nor the white, nor the direction of your set. Three commands with a take make it fit, in this order, each of which writes its result into the set file and keeps the old one beside it: `previz calibrate light TAKE --rotation --set SET --write` turns it until the shadows and the shading of the model are those of the picture, or says that nothing in the picture tells (shading that is then off by 4 % is what the true environment leaves, and 8 % what one of another room may); `previz calibrate balance TAKE --set SET --write` gives it the brightness and white of the film camera; `previz model TAKE --set SET --parts FILE` measures the colours of what is real. The first needs a model that casts a shadow or has sides, in any colours; grey will do.
Footage of unknown exposure is imported with `"exposure": 1`: the light of the set is then in units of the camera's white, and the same commands mend it.
Without either, lamps of the set file alone light the set (`from = "set"`, and [[light]] with `gain_real = 1`); measure their places, and let the messages tell how bright they are to be.
The grey card is in the picture already: the white paper of printed tags reflects 79 % of the light in all colours, so `calibrate balance` goes by it wherever a tag shows two white cells that are three pixels wide, and so does `model`, before it measures colours. A real grey card in the model, or any surface whose colour you know, is named with `--reference`; a [[surface]] of the set file gives it the colour that you know. Without tags and without a reference, all colours of the model count as if as many were too dark as too bright; a model whose colours were measured under a wrong light then agrees with that light. Coloured, glossy or grey paper is not 79 % white: name another reference.
What it costs, measured on two sets whose truth is known: what virtual objects change on real surfaces is off by 3.3 and 2.2 % with a fisheye, and by 3.5 and 2.4 % with an environment of the place after the commands above, whether it was 0.3, 1 or 3 times as bright as the set, tinted, and turned by 70 degrees. Before them it was off by 107 %.
)"};

const Chapter lenses_chapter{"LENSES OF OTHER PROGRAMS", R"(
`previz calibrate from FILE` recognises by their content: OpenCV's YAML, XML and JSON (4, 5 or 8 coefficients, or a fisheye's 4), ROS's camera_info (plumb_bob, rational_polynomial, equidistant), Kalibr's camchain (pinhole with radtan, equidistant or none), COLMAP's cameras.txt (all models up to FULL_OPENCV and OPENCV_FISHEYE), Metashape's camera XML (frame cameras), transforms.json of nerfstudio and instant-ngp (OPENCV and OPENCV_FISHEYE), and RealSense's intrinsics as JSON (all but inverse models). The output says what is assumed or converted, such as COLMAP's pixel coordinates, which are counted from the corner of the first one and not from its centre.
A fisheye becomes the light camera's lens and a pinhole the film camera's, unless `--as` says otherwise: then the lens is fitted with the other model, and the largest difference over the picture is reported. More than 0.1 px needs `--force`.
Not supported are thin prisms and tilted sensors, Kalibr's omni, eucm, ds and fov, COLMAP's FOV and THIN_PRISM_FISHEYE, Metashape's fisheyes, Nuke's LensDistortion and the lenses of 3DEqualizer, PFTrack and SynthEyes: calibrate with another model, or from pictures of a board. Files of RealityCapture, Meshroom, OpenSfM, OpenMVG, Pix4D and Lensfun, profiles of Adobe and the reports of Kalibr are refused by name, with the way to convert them and what their numbers mean.
)"};

const Chapter previzd_status{"EXIT STATUS", R"(
0: Done.
1: Error; one line on standard error says what is wrong.
2: The command line cannot be understood.
75: The service ended to be restarted, outside a take: another version was installed, or the driver of a graphics card was loaded after the service started.
128+N: Stopped by signal N, within two seconds. Files that were not complete are removed; (Stopping a live rig is not an error: 0.)
)"};

const Chapter previz_status{"EXIT STATUS", R"(
0: Done.
1: Error; one line on standard error says what is wrong.
2: The command line cannot be understood.
3: `previz takes check`: a take is incomplete, because frames did not reach the disk while it was recorded, and none is damaged since (that is 1).
75: `previz farm task`: this machine could not do it, and another may.
128+N: Stopped by signal N, within two seconds. Files that were not complete are removed; finished frames are on disk, and the same render command continues there.
)"};

const Chapter previzd_cameras{"NETWORK CAMERAS", R"(
A GigE Vision camera obeys whoever asks first and has no authentication: any host that reaches it can take it over, and any host that answers with its serial number or address is accepted in its place. Connect such cameras to a network port of the rig's computer that nothing else is connected to, without a router and without forwarding (`sysctl net.ipv4.ip_forward` is 0, `net.ipv4.conf.all.rp_filter` is 1), and name them in the set file by their addresses.
Each aravis camera has its own receiving process, previzd-aravis. It can open no file and start no program, and packets from other hosts or incomplete packets do not reach it, from the moment that it has a socket. A process that ends or stops responding is replaced: the camera is reported lost, and found again within two seconds. A take continues meanwhile.
The process of a camera on the USB opens files below /dev/bus/usb, /sys and /run/udev only, which needs a kernel with Landlock (Linux 5.13 or later; Debian's has it). Without Landlock such a camera is refused.
)"};

const Chapter previzd_files{"FILES", R"(
/etc/previzd/set.toml: The set file that the service runs; as installed, a demonstration that needs no camera.
/usr/libexec/previzd/previzd-aravis: Receives from one aravis camera; previzd starts it.
/usr/share/previzd/demo: The take that the demonstration plays.
/usr/share/doc/previzd/examples: A set file to start from, and a reference of every key.
/var/lib/previzd: Takes and snapshots, unless the set file says otherwise. The file graphics-device in it names the rig's last graphics card, which it waits for if missing; without the file, the rig renders on the CPU instead.
/run/previzd: The newest picture (picture.png) and metrics.json, written every second.
/usr/share/doc/previzd/examples/takes-disk.conf, cameras.conf: Drop-ins for the service: takes on separate disks, and cameras with known addresses.
)"};

// What is written beside the pictures, and what a take consists of.
const Chapter previz_formats{"FORMATS", R"(
session.toml: In a take: its name, slate, number and timecode, whether it is good, the calibrations, what was lost, and a verbatim copy of the set file. Versions of previzd that do not know k4, k5 and k6 of a calibration read it without them.
observer.mkv, light.mkv, composite.mkv: In a take: the cameras' pictures, and the composite as shown; lossless (FFV1). The lines of observer.jsonl and so on give the time and exposure of each frame. They also name each picture by its checksum, by which it is found in a video whose head is torn.
track.jsonl: In a take: the camera's pose in each frame that was tracked live, and what was moved, relit or carried; world_from_camera is 16 numbers, row by row.
events.jsonl: In a take: button presses and other events, in order.
assets: In a take: the files that the set uses, each named by its SHA-256.
frames.jsonl: Beside rendered pictures, one line per frame: whether it was rendered or why not, samples, seconds, the camera's pose with its error in pixels and the tags used for it, the light frames, and size and SHA-256 of its files. A render that continues checks them, and renders a frame again whose file is missing or was changed, or that has no line; it says which and why.
0007.exr: The composite as R, G, B and A (1 everywhere), and beside it mixed, real, diff, mask, depth, normal and variance as layers: linear Rec. 709, 32-bit floats. timeCode counts at most 30 frames per second: from 31 to 60, frames are counted in pairs, and the field mark says which of the two it is (SMPTE ST 12-1: frame 47 of 48 is 23 with the mark); above 60 it is absent, and previz.timestamp_ns tells frames apart.
0007.sums.exr: What `previz render --sample-range 2/4` writes in place of the picture of frame 7: the sums of the second quarter of its samples. `previz merge` needs the folders of all ranges and the options with which they were rendered. Frames of 128 samples or more can be divided, unless a target error or time decides how many they get, they are adaptive, or they are averaged with their neighbours.
render.json: Beside rendered pictures: the settings that they were rendered with.
render.lock: Beside rendered pictures: the processes that are at work there, one line each, with the frames they have. Several `previz render` of one take may share a folder, on several computers over NFS as well: each renders frames that no other has, and the one that finishes last makes the review video. One that ends while others still render names them and exits with 0. Use --force with the first of them only. Where the disk has no locks that other computers see (NFS with local_lock, Lustre without flock, sshfs), they know each other by files in render.leases, and the frames of one that died are free after three minutes.
poses.jsonl: Written by `previz track --out`, one line per frame: frame, timestamp_ns, tracked; world_from_camera (4 rows of 4, metres, OpenCV axes, world Z up; as in the track of FRAMES.json), covariance, tags and reprojection_rms_px, or the reason why there is no pose; and carriers that were found.
camera.chan: Written by `previz export`: frame, position, rotation and vertical angle of view. The rotation order is ZXY, as in Nuke; set Blender's import to it. The angle is Nuke's, 2 atan(height / (2 fy)). It has neither the lens distortion nor the principal point; camera.usda has both, the distortion as text.
)",
                             true};

const Chapter previzctl_status{"EXIT STATUS", R"(
0: Done.
1: The rig refused, is loading a set, is not running or does not respond; one line on standard error says which and why.
2: The command line cannot be understood.
)"};

const Chapter set_description{"DESCRIPTION", R"(
A set file describes one set: its cameras, the tags' positions, what is real and what is virtual, and how it is lit. It is TOML. `previzd check FILE` lists every mistake in it, with its line. The terms are explained in previzd(8), GLOSSARY.
Units are at the end of each key's name; the world is right-handed, Z up; colours are linear Rec. 709. A table in double brackets appears once for each thing that it describes. Each key is shown with its default.
)"};

Chapter see_also(const std::string& pages) {
  return {"SEE ALSO", pages};
}

}  // namespace

std::vector<Page> man_pages() {
  return {
      {"previzd.8", man_page(previzd_commands(), 8,
                             {rig_chapter, service_chapter, cards_chapter, security_chapter,
                              rig_examples, glossary_chapter, previzd_cameras, previzd_files,
                              previzd_status, see_also("previz(1), previzctl(1), previz-set(5)")})},
      {"previz.1",
       man_page(general_commands(), 1,
                {tool_examples, clip_chapter, tags_chapter, model_chapter, light_chapter,
                 lenses_chapter, rendering_chapter, previz_formats, previz_status,
                 see_also("previzd(8), previz-farm(1), previz-set(5)")})},
      {"previz-farm.1", man_page(farm_commands(), 1, farm_chapters())},
      {"previzctl.1",
       man_page(
           previzctl_commands(), 1,
           {{"ACTIONS", actions_text()}, previzctl_status, see_also("previzd(8), previz-set(5)")})},
      {"previz-set.5",
       set_man_page(set_description, see_also("previzd(8), previz(1), previzctl(1)"))}};
}

std::vector<Page> bash_completions() {
  return {{"previzd", bash_completion(previzd_commands())},
          {"previz", bash_completion(previz_commands())},
          {"previzctl", bash_completion(previzctl_commands())}};
}

}  // namespace previz::manual
