// Makes the plan of a job, and its folder.
#pragma once

#include "daemon/tools/farm/folder.hpp"
#include "daemon/tools/farm/job.hpp"
#include "daemon/tools/farm/options.hpp"

namespace previz::farm {

// Makes the plan; nothing is written. Every take and set is opened, so that what is wrong with them
// is found here and not in the night. Throws previz::Error.
Job make_job(const FarmOptions& options);

// Makes the folder, with the plan and what tasks read beside the takes. Throws previz::Error, also
// if a job is there.
void make_folder(const FarmOptions& options, const JobFolder& folder, const Job& job);

}  // namespace previz::farm
