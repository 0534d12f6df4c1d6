// Divides the rendering of takes between machines: makes a job of it, submits it to Slurm, and says
// how it goes. Any other scheduler, or nobody but a shell, can start the same tasks (scripts.hpp).
#pragma once

#include <iosfwd>

#include "daemon/farm/options.hpp"

namespace previz::farm {

// Makes the job's folder and submits it; prints the scheduler's numbers. Throws previz::Error;
// nothing is then left in the queue.
void submit(const FarmOptions& options, std::ostream& out);

// Prints how many frames are done, which tasks run or have failed, where and why, and the time that
// is left.
void print_status(const JobOptions& options, std::ostream& out);
// Cancels what is in the queue or runs. What is finished stays.
void cancel(const JobOptions& options, std::ostream& out);
// Submits the tasks of the frames that are missing or not whole. Throws previz::Error while tasks
// are in the queue.
void retry(const JobOptions& options, std::ostream& out);
// Does the last step (finish.hpp); returns the exit status of `previzd farm finish`.
int finish(const JobOptions& options, std::ostream& out);

}  // namespace previz::farm
