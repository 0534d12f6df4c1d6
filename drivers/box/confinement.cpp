#include "drivers/box/confinement.hpp"

#include <fcntl.h>
#include <linux/landlock.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <string>

#include "drivers/box/bpf.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::box {
namespace {

constexpr std::uint64_t read_rights = LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR;
// All of Landlock's first version, and the move of a file to another folder, of its second.
constexpr std::uint64_t first_rights = (LANDLOCK_ACCESS_FS_MAKE_SYM << 1) - 1;
constexpr std::uint64_t move_right = LANDLOCK_ACCESS_FS_MAKE_SYM << 1;
constexpr std::uint64_t rights_of_a_file =
    LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_WRITE_FILE;

// What is to be done so that Landlock's first call does not end with this error.
std::string way_to_landlock(int error) {
  if (error == ENOSYS) return "this kernel has no Landlock; install Linux 5.13 or later with it";
  if (error == EOPNOTSUPP)
    return "Landlock is switched off; add landlock to lsm= on the kernel's command line";
  return std::string(std::strerror(error)) +
         "; allow the service the system calls landlock_create_ruleset, landlock_add_rule and"
         " landlock_restrict_self";
}

[[noreturn]] void fail() {
  throw Error(way_to_landlock(errno));
}

void give_up_new_privileges() {
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0)
    throw Error(std::string("privileges cannot be given up: ") + std::strerror(errno));
}

}  // namespace

void confine_files(const Reach& reach) {
  give_up_new_privileges();
  const long version =
      ::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  landlock_ruleset_attr handled{};
  handled.handled_access_fs = first_rights | (version >= 2 ? move_right : 0);
  const OwnedDescriptor rules(static_cast<int>(
      ::syscall(SYS_landlock_create_ruleset, &handled, sizeof handled.handled_access_fs, 0)));
  if (!rules) fail();
  const auto allow = [&](const std::filesystem::path& place, std::uint64_t rights) {
    const OwnedDescriptor open(::open(place.c_str(), O_PATH | O_CLOEXEC));
    if (!open) return;
    landlock_path_beneath_attr beneath{};
    std::error_code unknown;
    beneath.allowed_access = std::filesystem::is_directory(place, unknown)
                                 ? rights & handled.handled_access_fs
                                 : rights & rights_of_a_file;
    beneath.parent_fd = open.get();
    ::syscall(SYS_landlock_add_rule, rules.get(), LANDLOCK_RULE_PATH_BENEATH, &beneath, 0);
  };
  for (const std::filesystem::path& place : reach.read) allow(place, read_rights);
  for (const std::filesystem::path& place : reach.write)
    allow(place, (first_rights | move_right) & ~(read_rights | LANDLOCK_ACCESS_FS_EXECUTE));
  for (const std::filesystem::path& place : reach.change)
    allow(place, LANDLOCK_ACCESS_FS_WRITE_FILE);
  if (::syscall(SYS_landlock_restrict_self, rules.get(), 0) != 0) fail();
}

void leave_network_and_programs() {
  give_up_new_privileges();
  using bpf::all;
  const auto refuse = [](int error) {
    return bpf::verdict(SECCOMP_RET_ERRNO | static_cast<std::uint32_t>(error));
  };
  const auto on = [](long call, const bpf::Program& rule) {
    return bpf::when(BPF_JEQ, static_cast<std::uint32_t>(call), rule);
  };
  const bpf::Program allow = bpf::verdict(SECCOMP_RET_ALLOW);
  const bpf::Program local_sockets =  // as libraries of graphics cards use them
      all({bpf::load(BPF_W, offsetof(seccomp_data, args)), bpf::when(BPF_JEQ, AF_UNIX, allow),
           bpf::when(BPF_JEQ, AF_NETLINK, allow), refuse(EAFNOSUPPORT)});
  const auto unless_truncated = [&](std::size_t flags) {  // the number of the argument
    return all({bpf::load(BPF_W, offsetof(seccomp_data, args) + flags * sizeof(std::uint64_t)),
                bpf::mask(O_ACCMODE | O_TRUNC),
                bpf::when(BPF_JEQ, O_RDONLY | O_TRUNC, refuse(EACCES)), allow});
  };
  bpf::Program filter = all({
    bpf::load(BPF_W, offsetof(seccomp_data, arch)),
        bpf::when_not(BPF_JEQ, bpf::architecture, bpf::verdict(SECCOMP_RET_KILL_PROCESS)),
        bpf::load(BPF_W, offsetof(seccomp_data, nr)),
#if defined(__x86_64__)
        bpf::when(BPF_JGE, 0x40000000, refuse(EPERM)),  // the same calls by other numbers (x32)
#endif
#if defined(SYS_open)
        on(SYS_open, unless_truncated(1)),
#endif
        on(SYS_openat, unless_truncated(2)),
        on(SYS_openat2, refuse(ENOSYS)),  // whose flags are in memory
        on(SYS_truncate, refuse(EACCES)), on(SYS_socket, local_sockets),
        on(SYS_execve, refuse(EPERM)), on(SYS_execveat, refuse(EPERM)),
#if !defined(__SANITIZE_ADDRESS__)  // whose look for leaks is one into its own process
        on(SYS_ptrace, refuse(EPERM)),
#endif
        on(SYS_process_vm_readv, refuse(EPERM)), on(SYS_process_vm_writev, refuse(EPERM)),
        on(SYS_pidfd_getfd, refuse(EPERM)),
        on(SYS_io_uring_setup, refuse(ENOSYS)),  // by which files and sockets would be opened
        allow,
  });
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  if (::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) != 0)
    throw Error(std::string("system calls cannot be limited: ") + std::strerror(errno));
}

}  // namespace previz::box
