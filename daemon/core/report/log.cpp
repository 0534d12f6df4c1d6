#include "daemon/core/report/log.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>

#include "daemon/core/report/printable.hpp"

namespace previz::report {
namespace {

spdlog::level::level_enum level_of(Severity severity) {
  switch (severity) {
    case Severity::info:
      return spdlog::level::info;
    case Severity::warning:
      return spdlog::level::warn;
    case Severity::error:
      return spdlog::level::err;
  }
  return spdlog::level::err;
}

}  // namespace

Destination destination() {
  struct stat target {};
  const char* const journal = std::getenv("JOURNAL_STREAM");
  if (!journal || fstat(STDERR_FILENO, &target) != 0) return Destination::terminal;
  const std::string stream = std::to_string(target.st_dev) + ":" + std::to_string(target.st_ino);
  return stream == journal ? Destination::journal : Destination::terminal;
}

void start_log(Severity least, Destination destination) {
  spdlog::sink_ptr sink;
  if (destination == Destination::journal)
    sink = std::make_shared<spdlog::sinks::systemd_sink_mt>();
  else
    sink = std::make_shared<spdlog::sinks::stderr_color_sink_mt>();
  auto logger = std::make_shared<spdlog::logger>("previzd", std::move(sink));
  logger->set_level(level_of(least));
  logger->set_pattern("%H:%M:%S.%e %^%l%$ %v");
  spdlog::set_default_logger(std::move(logger));
}

void log(const Report& report) {
  spdlog::default_logger_raw()->log(level_of(report.severity), "{}",
                                    with_short_lines(without_commands(line_of(report))));
}

}  // namespace previz::report
