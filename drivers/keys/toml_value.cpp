#include "drivers/keys/toml_value.hpp"

namespace previz {

Position position(const toml::source_region& region) {
  return {std::max(region.begin.line, toml::source_index{1}),
          std::max(region.begin.column, toml::source_index{1})};
}

Value value_of(const toml::node& node) {
  Value out{position(node.source()), std::monostate{}};
  if (const auto* flag = node.as_boolean())
    out.data = flag->get();
  else if (const auto* whole = node.as_integer())
    out.data = whole->get();
  else if (const auto* real = node.as_floating_point())
    out.data = real->get();
  else if (const auto* text = node.as_string())
    out.data = text->get();
  else if (const auto* array = node.as_array()) {
    std::vector<Value> entries;
    for (const auto& entry : *array) entries.push_back(value_of(entry));
    out.data = std::move(entries);
  }
  return out;
}

}  // namespace previz
