// Pages to read, each of which is one HTML file that needs no other: how they look, and their
// tables.
#pragma once

#include <initializer_list>
#include <string>
#include <vector>

namespace previz::output {

// Escapes text for HTML and SVG.
std::string escaped(const std::string& text);

struct Column {
  const char* name;
  bool is_number = false;
};

class Table {
 public:
  // Without any name there is no head. `style` is a CSS class, like those of rows.
  explicit Table(std::vector<Column> columns, const std::string& style = {});
  // Adds a row with a text for each column, which is escaped.
  void row(const std::vector<std::string>& cells, const std::string& style = {});
  std::string html() const { return html_ + "</table>\n"; }

 private:
  std::vector<Column> columns_;
  std::string html_;
};

// Returns a page. `title` is text; `body` is HTML, and `style` CSS besides the common one.
std::string page(const std::string& title, const std::string& body, const std::string& style = {});

}  // namespace previz::output
