// Says how far a set file is trusted, and which files stand in for those that it names.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace previz::set {

// Says where a set file comes from: the crew, who can mend it, a session that was recorded with
// it, or a job of the farm. Buttons that nobody can press are an error in the crew's files only. A
// session may come from anywhere, so that its set is read as data: a file that it names must be in
// its own folder, unless the crew trusts it. So may a job, which brings along what its set names.
enum class Origin { crew, session, trusted_session, job };

// As the set names them: in their place.
using Assets = std::vector<std::pair<std::string, std::filesystem::path>>;

}  // namespace previz::set
