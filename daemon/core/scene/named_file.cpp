#include "daemon/core/scene/named_file.hpp"

#include <algorithm>
#include <charconv>
#include <climits>
#include <cstdint>
#include <fstream>
#include <utility>

#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/letters.hpp"

namespace previz::scene {
namespace {

namespace fs = std::filesystem;

bool leads_out(const fs::path& path, NameRules rules) {
  return path.is_absolute() || (!rules.may_lead_up && std::ranges::find(path, "..") != path.end());
}

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

// Returns the files below the folder whose path differs at most by the case of its letters.
std::vector<fs::path> alike_files(const fs::path& folder, const fs::path& name) {
  std::vector<fs::path> alike{folder};
  for (const fs::path& part : name.lexically_normal()) {
    std::vector<fs::path> below;
    const std::string lower = lower_case(part.string());
    for (const fs::path& above : alike) {
      if (part == ".." || part == ".") {
        below.push_back(above / part);
        continue;
      }
      std::error_code error;
      for (fs::directory_iterator entry(above, error), last; !error && entry != last;
           entry.increment(error))
        if (lower_case(entry->path().filename().string()) == lower) below.push_back(entry->path());
    }
    alike = std::move(below);
  }
  std::erase_if(alike, [](const fs::path& path) { return !is_file(path); });
  return alike;
}

}  // namespace

std::optional<NamedFile> find_named_file(const fs::path& file, const std::string& name,
                                         NameRules rules) {
  std::vector<std::string> spellings{name, without_escapes(name)};
  if (rules.is_uri) std::swap(spellings[0], spellings[1]);
  for (std::size_t i = 0; i < 2; ++i) {
    spellings.push_back(spellings[i]);
    std::ranges::replace(spellings.back(), '\\', '/');
  }
  std::erase_if(spellings, [](const std::string& spelling) {
    return spelling.empty() || spelling.size() >= PATH_MAX ||
           spelling.find('\0') != std::string::npos;
  });

  const fs::path folder = file.parent_path();
  std::vector<fs::path> names, bare_names;
  for (const fs::path spelling : spellings) {
    if (!leads_out(spelling, rules)) names.push_back(spelling);
    bare_names.push_back(spelling.filename());
  }
  for (const fs::path& written : names)
    if (is_file(folder / written)) return NamedFile{folder / written};
  names.insert(names.end(), bare_names.begin(), bare_names.end());
  for (const fs::path& bare : bare_names)
    if (is_file(folder / bare)) return NamedFile{folder / bare, true};
  for (const fs::path& written : names) {
    const std::vector<fs::path> alike = alike_files(folder.empty() ? "." : folder, written);
    if (alike.size() == 1) return NamedFile{alike[0], true};
  }
  const std::size_t path_end = name.find_first_of("?#");  // RFC 3986, 3: a query or a fragment
  if (!rules.is_uri || path_end == std::string::npos) return {};
  std::optional<NamedFile> found = find_named_file(file, name.substr(0, path_end), rules);
  if (found) found->has_other_name = true;
  return found;
}

std::string without_escapes(const std::string& text) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned char decoded = 0;
    const char* const digits = text.data() + i + 1;
    if (text[i] == '%' && text.size() - i > 2 &&
        std::from_chars(digits, digits + 2, decoded, 16).ptr == digits + 2) {
      plain += static_cast<char>(decoded);
      i += 2;
    } else {
      plain += text[i];
    }
  }
  return plain;
}

std::string note_of_other_name(const NamedFile& found, const std::string& what,
                               const std::string& name) {
  if (!found.has_other_name) return "";
  return what + " \"" + set::one_line(name) + "\": is read from " +
         set::one_line(found.path.filename().string());
}

std::string read_regular_file(const fs::path& file, std::vector<unsigned char>& bytes) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) return "file not found";
  if (!fs::is_regular_file(status)) return "it is not a regular file";
  const std::uint64_t size = fs::file_size(file, error);
  if (error) return "its size cannot be read";
  if (size > max_file_bytes) return "it is larger than 4 GiB";
  std::ifstream stream(file, std::ios::binary);
  bytes.resize(size);
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  return stream.good() || size == 0 ? "" : "it cannot be read";
}

}  // namespace previz::scene
