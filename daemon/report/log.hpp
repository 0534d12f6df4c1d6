// The program's log: systemd's journal where it listens, otherwise the terminal.
#pragma once

#include "daemon/report/report.hpp"

namespace previz::report {

enum class Destination { journal, terminal };

// The journal where standard error is connected to it (JOURNAL_STREAM of systemd.exec(5)).
Destination destination();

// From now on log() writes there what is at least this severe. In the journal a report has the
// priority of its severity (`journalctl -p err` finds the errors) and no prefix; on the terminal,
// that is standard error, it has the time and the severity in front.
void start_log(Severity least, Destination destination = report::destination());

// From any thread.
void log(const Report& report);

}  // namespace previz::report
