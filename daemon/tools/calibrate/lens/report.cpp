#include "daemon/tools/calibrate/lens/report.hpp"

#include <fmt/ostream.h>

#include <algorithm>
#include <sstream>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/file_edit.hpp"
#include "daemon/tools/calibrate/lens/residual_plot.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

void print_views(const Views& views, const BundleFit& fit, std::ostream& out) {
  for (std::size_t v = 0; v < views.views.size(); ++v) {
    const auto left_out = std::ranges::count(fit.used[v], false);
    if (std::ranges::find(fit.views_left_out, v) != fit.views_left_out.end())
      fmt::print(out, "  {}: rejected, most of its corners do not fit\n", views.views[v].name);
    else
      fmt::print(out, "  {}: rms {:.3f} px, {} corners{}\n", views.views[v].name,
                 view_rms_px(fit, v), fit.used[v].size() - std::size_t(left_out),
                 left_out ? fmt::format(", {} rejected", left_out) : "");
  }
}

void print_certainty(std::vector<UncertainPixel> picture, std::ostream& out) {
  if (picture.empty()) return;
  std::ranges::sort(picture, {}, &UncertainPixel::sigma_px);
  const UncertainPixel& worst = picture.back();
  fmt::print(out,
             "projection accurate to {:.3f} px over half the picture, {:.3f} px at worst "
             "(near {:.0f}, {:.0f})\n",
             picture[picture.size() / 2].sigma_px, worst.sigma_px, worst.pixel.x, worst.pixel.y);
}

}  // namespace

void print_fit(const Views& views, const BundleFit& fit, std::span<const char* const> names,
               std::vector<UncertainPixel> picture, std::ostream& out) {
  print_views(views, fit, out);
  fmt::print(out,
             "rms {:.3f} px over {} corners of {} views; {} of {} corners rejected (farther off "
             "than 4.5 robust standard deviations and 1 px)\n",
             fit.rms_px, fit.corners_used, views.views.size() - fit.views_left_out.size(),
             fit.corners - fit.corners_used, fit.corners);
  const std::vector<double> sigma = lens_sigma(fit);
  for (std::size_t p = 0; p < sigma.size(); ++p)
    fmt::print(out, "  {:<3} {:12.5f} +- {:.5f}\n", names[p], fit.bundle.lens[p], sigma[p]);
  print_certainty(std::move(picture), out);
}

std::string as_comment(const std::string& text) {
  constexpr std::size_t longest = 100;
  std::string comment;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string row = "#";
    for (std::string word; words >> word;) {
      if (row.size() > 3 && row.size() + 1 + word.size() > longest) {
        comment += row + "\n";
        row = "#  ";
      }
      row += " " + word;
    }
    comment += row + "\n";
  }
  return comment;
}

std::string insist(const std::vector<std::string>& missing, bool force, std::ostream& out) {
  if (missing.empty()) return {};
  std::string text = "these views are missing:";
  for (const std::string& what : missing) text += "\n  " + what;
  if (!force) throw Error(text + "\n(--force accepts the calibration anyway)");
  fmt::print(out, "{}\n", text);
  return as_comment(
      fmt::format("{}: accepted with --force although {}", not_to_be_relied_on, text));
}

std::string warn(const std::vector<std::string>& doubts, std::ostream& out) {
  std::string comment;
  for (const std::string& doubt : doubts) {
    fmt::print(out, "warning: {}\n", doubt);
    comment += as_comment("WITH A DOUBT: " + doubt);
  }
  return comment;
}

void write_tables(const std::string& tables, const std::optional<std::filesystem::path>& file,
                  std::ostream& out) {
  if (!file) return fmt::print(out, "\n{}", tables);
  session::replace_file(*file, tables);
  fmt::print(out, "the tables are in {}\n", file->string());
}

void write_back(const std::filesystem::path& set_file, const std::string& text, std::ostream& out) {
  const std::filesystem::path old = set::keep_beside(set_file);
  session::replace_file(set_file, text);
  fmt::print(out, "written to {}; previous version: {}\n", set_file.string(), old.string());
}

}  // namespace previz::calibrate
