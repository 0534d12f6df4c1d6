#!/usr/bin/env python3
"""How long a farm takes for a take: a simulated clock over tasks with measured times.

  tests/bench/farm_simulation.py [OPTIONS]      prints a table in Markdown; --help lists the options

Assumptions:
  - A node runs one task at a time. Tasks start in the order of their frames, each on the node that is free first.
  - A task costs the scheduler's delay, its own start-up (the take, the scene, the shaders), and its frames one after
    another. The first two are constant.
  - The times of the frames are independent and log-normal with the mean and the spread that are given, and the same in
    every row, so that rows differ by the farm alone.
  - A straggler is a node that is slower, by a factor, for the whole of a task; each task meets one with the same
    probability, whatever node it is on.
  - A requeued task fails at a time spread evenly over its run, loses its unfinished frame alone (finished pictures are
    kept), waits the requeue delay without occupying a node, and pays delay and start-up again. Each start of a task
    fails with the same probability.
  - The disk that all nodes share takes no time of its own, and no other job is on the farm.
  - The check runs after the last task, on one node: the scheduler's delay, its start-up, and a time for each frame.
Wall time is the mean over trials, with the slowest of them beside it; speed-up is over one `previz render` on one
computer without scheduler, stragglers and requeues; efficiency is speed-up by nodes. A row with more nodes than tasks
leaves nodes idle.
"""

import argparse
import heapq
import math
import random
import statistics

NODES = (1, 2, 3, 8, 16, 32, 64)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--frames", type=int, default=240, help="frames of the take")
    parser.add_argument("--chunks", type=int, nargs="+", default=[1, 4, 10, 30],
                        help="frames a task, a block of rows each")
    parser.add_argument("--nodes", type=int, nargs="+", default=list(NODES), help="nodes of the farm, a row each")
    parser.add_argument("--frame-s", type=float, default=60, help="mean seconds a frame")
    parser.add_argument("--spread-s", type=float, default=6, help="standard deviation of the seconds a frame")
    parser.add_argument("--startup-s", type=float, default=4, help="seconds from a task's start to its first sample")
    parser.add_argument("--delay-s", type=float, default=1,
                        help="seconds between a node's being free and a task's start")
    parser.add_argument("--check-s", type=float, default=0.1, help="seconds a frame that the check takes")
    parser.add_argument("--stragglers", type=float, default=0.02, help="probability that a task meets a slow node")
    parser.add_argument("--slower", type=float, default=3, help="how many times slower such a node is")
    parser.add_argument("--requeues", type=float, default=0.01, help="probability that a start of a task fails")
    parser.add_argument("--requeue-s", type=float, default=120, help="seconds until a failed task may start again")
    parser.add_argument("--trials", type=int, default=200, help="runs of each row")
    parser.add_argument("--seed", type=int, default=1, help="of all random numbers")
    given = parser.parse_args()
    if min([given.frames, given.trials, *given.chunks, *given.nodes]) < 1:
        parser.error("frames, chunks, nodes and trials must be at least 1")
    if given.frame_s <= 0 or min(given.spread_s, given.startup_s, given.delay_s, given.check_s, given.requeue_s) < 0:
        parser.error("times must not be negative, and --frame-s must be more than 0")
    if not (0 <= given.stragglers <= 1 and 0 <= given.requeues < 1) or given.slower < 1:
        parser.error("probabilities must be from 0 to 1, that of --requeues below 1, and --slower must be at least 1")
    return given


def frame_times(given, trial):
    """Seconds of each frame: log-normal, with its parameters from mean and standard deviation."""
    numbers = random.Random(f"{given.seed} frames {trial}")
    variance = math.log(1 + (given.spread_s / given.frame_s) ** 2)
    mean = math.log(given.frame_s) - variance / 2
    return [numbers.lognormvariate(mean, math.sqrt(variance)) for _ in range(given.frames)]


def run_task(given, numbers, frames):
    """One start of a task: the seconds that it occupies its node, and the frames that are left for another start."""
    slower = given.slower if numbers.random() < given.stragglers else 1
    start = given.startup_s * slower
    whole = start + sum(frames) * slower
    fails_at = numbers.uniform(0, whole) if numbers.random() < given.requeues else math.inf
    clock = start
    for finished, seconds in enumerate(frames):
        if clock + seconds * slower > fails_at:
            return given.delay_s + fails_at, frames[finished:]
        clock += seconds * slower
    return given.delay_s + whole, []


def wall_time(given, times, nodes, chunk, trial):
    """Seconds from the submission until the check has ended, by a queue of tasks and one of nodes that get free."""
    numbers = random.Random(f"{given.seed} farm {nodes} {chunk} {trial}")
    # The tasks by the time at which they may start; the second number keeps their order.
    waiting = [(0.0, first, times[first:first + chunk]) for first in range(0, len(times), chunk)]
    heapq.heapify(waiting)
    free = [0.0] * nodes
    end = 0.0
    while waiting:
        ready, first, frames = heapq.heappop(waiting)
        begin = max(heapq.heappop(free), ready)
        seconds, left = run_task(given, numbers, frames)
        heapq.heappush(free, begin + seconds)
        end = max(end, begin + seconds)
        if left:
            heapq.heappush(waiting, (begin + seconds + given.requeue_s, first, left))
    return end + given.delay_s + given.startup_s + given.check_s * len(times)


def readable(seconds):
    """Hours, minutes and seconds: 1:02:03."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"


def main():
    given = arguments()
    trials = [frame_times(given, trial) for trial in range(given.trials)]
    single = given.startup_s + statistics.fmean(map(sum, trials))
    print(f"{given.frames} frames of {given.frame_s:g} s (standard deviation {given.spread_s:g} s), "
          f"{given.startup_s:g} s start-up and {given.delay_s:g} s delay a task; {given.stragglers:.1%} of tasks on a node "
          f"{given.slower:g} times slower, {given.requeues:.1%} requeued after {given.requeue_s:g} s; {given.trials} trials, "
          f"seed {given.seed}. One computer without a farm: {readable(single)}.\n")
    print("| frames a task | tasks | nodes | wall time | slowest trial | speed-up | efficiency |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for chunk in given.chunks:
        for nodes in given.nodes:
            walls = [wall_time(given, times, nodes, chunk, trial) for trial, times in enumerate(trials)]
            mean = statistics.fmean(walls)
            print(f"| {chunk} | {-(-given.frames // chunk)} | {nodes} | {readable(mean)} | {readable(max(walls))} "
                  f"| {single / mean:.2f} | {single / mean / nodes:.0%} |")


if __name__ == "__main__":
    main()
