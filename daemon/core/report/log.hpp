// Writes the program's log to systemd's journal if it listens, otherwise to the terminal.
#pragma once

#include "daemon/core/report/report.hpp"

namespace previz::report {

enum class Destination { journal, terminal };

// Returns the journal if standard error is connected to it (JOURNAL_STREAM of systemd.exec(5)),
// otherwise the terminal.
Destination destination();

// Makes log() write reports of at least this severity to `destination` from now on. In the journal
// a report has the priority of its severity (`journalctl -p err` finds the errors) and no prefix;
// on the terminal, which is standard error, the time and the severity stand in front.
void start_log(Severity least, Destination destination = report::destination());

// May be called from any thread.
void log(const Report& report);

}  // namespace previz::report
