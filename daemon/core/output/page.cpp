#include "daemon/core/output/page.hpp"

#include <algorithm>
#include <utility>

namespace previz::output {
namespace {

// The page's look: a system font, one column, and colours that follow the reader's light or dark.
// The six hues stay apart for readers who see no red or no green; names stand at the curves too.
constexpr const char* page_style = R"(
:root { color-scheme: light dark; --paper: #fdfdfc; --ink: #1c1d1f; --soft: #62666d; --line: #e3e4e6;
  --doubt: #f1efe8; --accent: #c2410c; --s1: #0f6cbd; --s2: #b4540a; --s3: #12805c; --s4: #8a3ea8;
  --s5: #a8862a; --s6: #c0356b; }
@media (prefers-color-scheme: dark) { :root { --paper: #17181a; --ink: #e9e9e6; --soft: #9a9fa7;
  --line: #2f3237; --doubt: #24231f; --accent: #ff8a4c; --s1: #5fb0ff; --s2: #f0a35e; --s3: #4fc79b;
  --s4: #cf94e8; --s5: #d9bd62; --s6: #ff85ae; } }
body { margin: 0 auto; max-width: 61rem; padding: 2.5rem 1.25rem 5rem; background: var(--paper);
  color: var(--ink); font: 16px/1.55 system-ui, sans-serif; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .6rem; font-weight: 650; }
h2 { font-size: 1.25rem; margin: 3.2rem 0 .4rem; font-weight: 650; }
body { overflow-wrap: break-word; } pre { overflow-x: auto; }
p { max-width: 44rem; margin: .4rem 0 1rem; } .soft, figcaption, th { color: var(--soft); }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: .8rem 0 0; width: 100%; }
th, td { text-align: left; padding: .35rem 1.2rem .35rem 0; border-bottom: 1px solid var(--line); }
th { font-weight: 500; font-size: .87rem; } td.n, th.n { text-align: right; } td.n { white-space: nowrap; }
.bend td { color: var(--accent); font-weight: 600; }
.charts, .pictures { display: grid; gap: 1.4rem; grid-template-columns: repeat(auto-fit, minmax(20rem, 1fr)); }
figure { margin: 0; } figcaption { font-size: .9rem; margin-top: .35rem; }
figcaption b { color: var(--ink); font-weight: 600; }
img { width: 100%; display: block; image-rendering: pixelated; }
svg { width: 100%; height: auto; display: block; font: 11.5px system-ui, sans-serif; }
svg .grid { stroke: var(--line); } svg .doubt { fill: var(--doubt); }
svg .tick, svg .label { fill: var(--soft); } svg .title { fill: var(--ink); font-weight: 600; }
svg g polyline { fill: none; stroke: var(--c); stroke-width: 1.8; } svg g circle { fill: var(--c); }
svg g.own polyline, svg g.front polyline { stroke-width: 2.6; } svg .name { fill: var(--c); }
svg .own, svg .name.own { --c: var(--ink); } svg .front { --c: var(--accent); }
svg .cloud { --c: var(--soft); opacity: .45; } .s1 { --c: var(--s1); } .s2 { --c: var(--s2); }
.s3 { --c: var(--s3); } .s4 { --c: var(--s4); } .s5 { --c: var(--s5); } .s6 { --c: var(--s6); }
@media (max-width: 40rem) { body { padding-top: 1.5rem; } th, td { padding-right: .7rem; }
  table, .scroll { display: block; overflow-x: auto; } .scroll svg { min-width: 42rem; } .answers tr { display: block; padding: .5rem 0;
  border-bottom: 1px solid var(--line); } .answers td { display: block; border: 0; padding: 0; }
  .answers td:first-child { font-weight: 600; } .answers th { display: none; }
  .answers td:nth-child(n+3) { text-align: left; } .answers td:nth-child(3)::before { content: "a frame: "; }
  .answers td:nth-child(4)::before { content: "error: "; } .answers td:nth-child(5)::before { content: "file: "; } }
)";

std::string row_of(const std::string& style) {
  return style.empty() ? "<tr>" : "<tr class=\"" + style + "\">";
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text)
    result += c == '&'   ? "&amp;"
              : c == '<' ? "&lt;"
              : c == '>' ? "&gt;"
              : c == '"' ? "&quot;"
                         : std::string(1, c);
  return result;
}

Table::Table(std::vector<Column> columns, const std::string& style)
    : columns_(std::move(columns)),
      html_(style.empty() ? "<table>\n" : "<table class=\"" + style + "\">\n") {
  if (std::ranges::all_of(columns_, [](const Column& each) { return *each.name == '\0'; })) return;
  html_ += "<tr>";
  for (const Column& column : columns_)
    html_ += (column.is_number ? "<th class=\"n\">" : "<th>") + escaped(column.name) + "</th>";
  html_ += "</tr>\n";
}

void Table::row(const std::vector<std::string>& cells, const std::string& style) {
  html_ += row_of(style);
  for (std::size_t i = 0; i < cells.size(); ++i)
    html_ += (columns_.at(i).is_number ? "<td class=\"n\">" : "<td>") + escaped(cells[i]) + "</td>";
  html_ += "</tr>\n";
}

std::string page(const std::string& title, const std::string& body, const std::string& style) {
  return "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta "
         "name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" +
         escaped(title) + "</title>\n<style>" + page_style + style + "</style>\n</head>\n<body>\n" +
         body + "</body>\n</html>\n";
}

}  // namespace previz::output
