// Divides the rendering of takes between machines: makes a job of it, submits it to Slurm, and says
// how it goes. Any other scheduler, or nobody but a shell, can start the same tasks (scripts.hpp).
#pragma once

#include <iosfwd>

#include "daemon/tools/farm/options.hpp"

namespace previz::farm {

// Makes the job's folder and submits it; prints the scheduler's numbers. Where all frames are
// rendered already, the review videos are made at once. Throws previz::Error, which says so if a
// part is left in the queue. Where nothing was submitted no folder is left.
void submit(const FarmOptions& options, std::ostream& out);

// Prints how many frames are done, which tasks run or have failed, where and why, and the time that
// is left.
void print_status(const JobOptions& options, std::ostream& out);
// Cancels what is in the queue or runs, and stops the job, so that no task begins. What is finished
// stays. Throws previz::Error if the job was not handed to Slurm.
void cancel(const JobOptions& options, std::ostream& out);
// Submits tasks for the frames that are missing or not whole, or makes the review videos if none
// is. Throws previz::Error while tasks are in the queue.
void retry(const JobOptions& options, std::ostream& out);

}  // namespace previz::farm
