#include "daemon/tools/written_by.hpp"

#include <CLI/CLI.hpp>

#include "daemon/core/output/take_folders.hpp"
#include "daemon/core/set/load.hpp"

namespace previz::tools {
namespace {

namespace fs = std::filesystem;

class Places {
 public:
  // A file or a folder that is made, wherever links lead.
  void add(const fs::path& made) {
    if (made.empty()) return;
    std::error_code unknown;
    const fs::path as_written = fs::absolute(made, unknown);
    if (unknown) return;  // the current folder is gone, and nothing can be made in it
    for (const auto& place :
         {as_written.lexically_normal(), fs::weakly_canonical(as_written, unknown)}) {
      if (place.empty()) continue;
      drafts_.push_back((place.has_filename() ? place : place.parent_path()).parent_path());
      reach_.push_back(output::existing_part(drafts_.back()));
    }
  }
  void add(const std::optional<fs::path>& made) { add(made.value_or(fs::path())); }
  // A folder that files are made in; where it is there already, nothing beside it is.
  void add_folder(const fs::path& folder) {
    std::error_code unknown;
    if (!fs::is_directory(folder, unknown)) add(folder);
    if (!folder.empty()) add(folder / "file");
  }
  // The folders in it as well, which may be links.
  void add_folders_in(const fs::path& folder) {
    std::error_code unreadable;
    for (const auto& entry : fs::directory_iterator(folder, unreadable))
      if (entry.is_directory(unreadable)) add_folder(entry.path());
  }
  void add_folder(const std::optional<fs::path>& folder) { add_folder(folder.value_or("")); }
  // Whatever foreign files name, as the crew allowed.
  void add_everything() { reach_.emplace_back("/"); }

  Written confined() const { return {reach_, drafts_}; }
  Written free() const { return {std::nullopt, drafts_}; }

 private:
  std::vector<fs::path> reach_, drafts_;
};

// A take's own set names no folder outside of the take (refuse_output_elsewhere()), one of the
// crew any.
void add_pictures(const std::optional<fs::path>& out, const fs::path& take,
                  const std::optional<fs::path>& set_file, bool any_paths, Places& places) {
  places.add_folder(out);
  places.add_folder(take);
  if (set_file) places.add_folder(set::output_folder(*set_file));
  if (any_paths) places.add_everything();
}

void add_render(const post::RenderOptions& options, bool of_many, Places& places) {
  add_pictures(options.directory, options.session, options.set_file, options.any_paths, places);
  places.add_folder(options.scratch);
  if (!of_many) return;
  places.add_folders_in(options.session);
  if (options.directory) places.add_folders_in(*options.directory);
}

void add_model(const model::ModelOptions& options, Places& places) {
  places.add(fs::path("a model that is named as the take is"));
  places.add(options.footage);
  places.add(options.parts_file);
  places.add(options.set_file);
  places.add(options.out);
  places.add_folder(options.pictures);
  places.add_folder(options.overlay);
}

void add_trade(const trade::TradeOptions& options, Places& places) {
  const timing::FrameSource& source = options.source;
  add_pictures(options.directory, source.set_or_session, source.set_file, source.any_paths, places);
  if (fs::is_regular_file(source.set_or_session))
    places.add_folder(set::output_folder(source.set_or_session));
}

void add_calibrate(const calibrate::Commands& commands, Places& places) {
  const auto add_table = [&](const auto&... options) { (places.add(options.table_file), ...); };
  add_table(commands.observer, commands.light, commands.response, commands.dark,
            commands.vignetting, commands.lens, commands.from, commands.balance, commands.tags);
  places.add(commands.observer.residual_plot);
  places.add(commands.light.residual_plot);
  const auto add_set = [&](const auto& options) {
    if (options.write) places.add(options.set_file);
  };
  add_set(commands.observer);
  add_set(commands.light);
  add_set(commands.balance);
  add_set(commands.tags);
}

void add_takes(const TakesCommands& commands, Places& places) {
  for (const auto* named : {&commands.marked, &commands.deleted})
    for (const fs::path& take : *named) {
      places.add(take);
      places.add_folder(take);
    }
  places.add_folder(commands.repaired);
  places.add_folder(commands.copied.folder);
}

// A job writes into its folder and those beside it (check_paths()).
void add_job(const fs::path& job, bool any_paths, Places& places) {
  places.add(job);
  for (const char* folder : {"", "state"}) places.add_folder(job / folder);
  std::error_code unreadable;
  for (const auto& take : fs::directory_iterator(job / "sums", unreadable))
    places.add_folders_in(take.path());
  places.add_folders_in(job / "..");
  if (any_paths) places.add_everything();
}

// Returns whether the farm's command is a part of a job, and starts no other program.
bool add_farm(const CLI::App& app, const farm::Commands& commands, Places& places) {
  const CLI::App& farm = *app.get_subcommand("farm");
  if (farm.got_subcommand("task"))
    return add_job(commands.task.job, commands.task.any_paths, places), true;
  if (farm.got_subcommand("finish"))
    return add_job(commands.job.job, commands.job.any_paths, places), true;
  for (const fs::path& take : commands.farm.takes) places.add_folder(take);
  places.add_folder(commands.farm.job);
  places.add_folder(commands.job.job);
  return false;
}

}  // namespace

std::optional<Written> written_by(const CLI::App& app, const CommandLine& said) {
  Places places;
  if (app.got_subcommand("check")) return places.free();  // a set may name files anywhere
  if (app.got_subcommand("farm"))
    return add_farm(app, said.farm, places) ? places.confined() : places.free();
  if (app.got_subcommand("import"))
    places.add(said.import_session.session);
  else if (app.got_subcommand("export"))
    places.add_folder(said.export_take.directory);
  else if (app.got_subcommand("track"))
    places.add(said.track.out);
  else if (app.got_subcommand("model"))
    add_model(said.model, places);
  else if (app.got_subcommand("render"))
    add_render(said.render, said.render_takes.has_value(), places);
  else if (app.got_subcommand("merge"))
    add_render(said.merge, false, places);
  else if (app.got_subcommand("trade"))
    add_trade(said.trade, places);
  else if (app.got_subcommand("calibrate"))
    add_calibrate(said.calibrate, places);
  else if (app.got_subcommand("takes"))
    add_takes(said.takes, places);
  else
    return std::nullopt;
  return places.confined();
}

}  // namespace previz::tools
