#include "drivers/aravis/receiver/sandbox.hpp"

#include <fcntl.h>
#include <linux/netlink.h>
#include <linux/seccomp.h>
#include <linux/sockios.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstring>
#include <string>

#include "drivers/box/bpf.hpp"
#include "drivers/box/confinement.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::aravis {
namespace {

using bpf::all;
using bpf::load;
using bpf::Program;
using bpf::verdict;
using bpf::when;
using bpf::when_not;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool sanitized = true;  // shadow memory takes terabytes of addresses
#else
constexpr bool sanitized = false;
#endif

// The frames (a gibibyte at most), Aravis' own memory, and address space that threads reserve.
constexpr rlim_t most_memory = rlim_t{3} << 30;
constexpr rlim_t most_descriptors = 256;

Program refuse(int error) {
  return verdict(SECCOMP_RET_ERRNO | static_cast<std::uint32_t>(error));
}
const Program allow = verdict(SECCOMP_RET_ALLOW);

// Loads the lower half of an argument of the system call.
Program argument(unsigned index) {
  return load(BPF_W, static_cast<std::uint32_t>(offsetof(seccomp_data, args) + 8 * index));
}
Program on(long call, const Program& rule) {
  return when(BPF_JEQ, static_cast<std::uint32_t>(call), rule);
}
template <class... Calls>
Program allowed(Calls... calls) {
  return all({on(calls, allow)...});
}

Program memory_and_threads() {
  const auto not_executable = [](unsigned protection) {
    return all({argument(protection), when(BPF_JSET, PROT_EXEC, refuse(EPERM)), allow});
  };
  return all({
      on(SYS_mmap, not_executable(2)),
      on(SYS_mprotect, not_executable(2)),
      allowed(SYS_munmap, SYS_mremap, SYS_madvise, SYS_brk, SYS_futex, SYS_set_robust_list,
              SYS_rseq, SYS_sched_yield, SYS_sched_getaffinity, SYS_getcpu, SYS_exit,
              SYS_exit_group, SYS_restart_syscall),
      on(SYS_clone, all({argument(0), when(BPF_JSET, CLONE_THREAD, allow), refuse(EPERM)})),
      on(SYS_clone3, refuse(ENOSYS)),  // its flags cannot be read; libc then falls back to clone
      on(SYS_prctl, all({argument(0), when(BPF_JEQ, PR_SET_NAME, allow), refuse(EPERM)})),
  });
}

Program signals_and_time() {
  const auto own = static_cast<std::uint32_t>(getpid());
  return all({
      allowed(SYS_rt_sigaction, SYS_rt_sigprocmask, SYS_rt_sigreturn, SYS_sigaltstack, SYS_getpid,
              SYS_gettid, SYS_getuid, SYS_geteuid, SYS_getgid, SYS_getegid, SYS_uname,
              SYS_getrandom),
      on(SYS_tgkill, all({argument(0), when(BPF_JEQ, own, allow), refuse(EPERM)})),
      allowed(SYS_clock_gettime, SYS_clock_getres, SYS_clock_nanosleep, SYS_nanosleep,
              SYS_gettimeofday),
  });
}

Program sockets(bool usb) {
  // Netlink lists the network's interfaces and reports what is plugged into the USB. What a socket
  // may not be is refused as what the kernel lacks.
  const Program netlink =
      all({argument(2), when(BPF_JEQ, NETLINK_ROUTE, allow),
           when(BPF_JEQ, NETLINK_KOBJECT_UEVENT, allow), refuse(EPROTONOSUPPORT)});
  const Program datagrams =
      all({argument(1), bpf::mask(~std::uint32_t{SOCK_CLOEXEC | SOCK_NONBLOCK}),
           when(BPF_JEQ, SOCK_DGRAM, allow), refuse(ESOCKTNOSUPPORT)});
  const Program families =
      all({argument(0), when(BPF_JEQ, AF_NETLINK, netlink),
           usb ? Program{} : when(BPF_JEQ, AF_INET, datagrams), refuse(EAFNOSUPPORT)});
  const Program network_requests =  // of sockets: FIONREAD, FIONBIO, and SIOCGIF...
      all({argument(1), when(BPF_JEQ, 0x541b, allow), when(BPF_JEQ, 0x5421, allow),
           when_not(BPF_JGE, 0x8910, refuse(EPERM)), when(BPF_JGT, 0x8933, refuse(EPERM)), allow});
  const Program usb_requests = all({argument(1), when(BPF_JEQ, FIOSETOWN, refuse(EPERM)),
                                    when(BPF_JEQ, SIOCSPGRP, refuse(EPERM)), allow});
  return all({
      on(SYS_socket, families),
      allowed(SYS_bind, SYS_getsockname, SYS_getpeername, SYS_getsockopt, SYS_setsockopt,
              SYS_sendto, SYS_sendmsg, SYS_sendmmsg, SYS_recvfrom, SYS_recvmsg, SYS_recvmmsg,
              SYS_shutdown),
      on(SYS_ioctl, usb ? usb_requests : network_requests),
  });
}

// A descriptor gets no owner, to whom the kernel would send any signal in this process's name.
Program descriptors() {
  const Program flags =
      all({argument(1), when(BPF_JEQ, F_GETFD, allow), when(BPF_JEQ, F_SETFD, allow),
           when(BPF_JEQ, F_GETFL, allow), when(BPF_JEQ, F_SETFL, allow),
           when(BPF_JEQ, F_DUPFD_CLOEXEC, allow), refuse(EPERM)});
  return all({
      on(SYS_fcntl, flags),
      allowed(SYS_read, SYS_write, SYS_readv, SYS_writev, SYS_close, SYS_ppoll, SYS_pselect6,
              SYS_eventfd2, SYS_pipe2, SYS_epoll_create1, SYS_epoll_ctl, SYS_epoll_pwait),
#ifdef SYS_poll  // newer processors do without what was replaced
      allowed(SYS_poll, SYS_select, SYS_epoll_wait),
#endif
  });
}

Program files(bool usb) {
#ifdef SYS_open
  const Program old = usb ? allowed(SYS_access, SYS_readlink, SYS_stat, SYS_lstat)
                          : all({on(SYS_open, refuse(EACCES)), on(SYS_access, refuse(EACCES)),
                                 on(SYS_readlink, refuse(EACCES)), on(SYS_stat, refuse(EACCES))});
#else
  const Program old;
#endif
  if (!usb)
    return all({old, on(SYS_openat, refuse(EACCES)), on(SYS_newfstatat, refuse(EACCES)),
                on(SYS_readlinkat, refuse(EACCES)), on(SYS_faccessat, refuse(EACCES))});
  return all({
      old,
      on(SYS_openat,
         all({argument(2), when(BPF_JSET, O_CREAT | O_TRUNC | O_APPEND, refuse(EACCES)), allow})),
      allowed(SYS_newfstatat, SYS_fstat, SYS_statx, SYS_readlinkat, SYS_faccessat, SYS_getdents64,
              SYS_lseek, SYS_pread64, SYS_statfs, SYS_fstatfs, SYS_timerfd_create,
              SYS_timerfd_settime),
  });
}

// libusb opens devices by their paths as they are plugged in, and a filter of system calls cannot
// read paths, so that without Landlock any file of the user could be opened.
void confine_to_usb() {
  try {
    box::confine_files({{"/dev/bus/usb", "/sys", "/run/udev"}, {}, {"/dev/bus/usb"}});
  } catch (const Error& error) {
    throw Error(std::string("its receiver cannot be kept from other files than the USB's: ") +
                error.what());
  }
}

}  // namespace

bool limit_resources(int parent) {
  if (prctl(PR_SET_PDEATHSIG, SIGKILL) != 0 || getppid() != parent) return false;
  // A stop of the service, or Ctrl-C, is the driver's to act on: it closes the socket.
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGPIPE}) std::signal(signal, SIG_IGN);
  const auto limit = [](__rlimit_resource_t what, rlim_t most) {
    const rlimit limits{most, most};
    setrlimit(what, &limits);
  };
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_NOFILE, most_descriptors);
  if (!sanitized) {
    limit(RLIMIT_FSIZE, 0);
    limit(RLIMIT_AS, most_memory);
  }
  const OwnedDescriptor first(open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC));
  if (first && write(first.get(), "900", 3) < 0) return true;  // then it is one like others
  return true;
}

void enter_sandbox(bool usb) {
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0)
    throw Error(std::string("privileges cannot be given up: ") + std::strerror(errno));
  if (usb) confine_to_usb();
  Program filter = all({
      load(BPF_W, offsetof(seccomp_data, arch)),
      when_not(BPF_JEQ, bpf::architecture, verdict(SECCOMP_RET_KILL_PROCESS)),
      load(BPF_W, offsetof(seccomp_data, nr)), memory_and_threads(), signals_and_time(),
      sockets(usb), descriptors(), files(usb),
      refuse(EPERM),  // all others, those of other ABIs too, whose numbers are other ones
  });
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) != 0)
    throw Error(std::string("system calls cannot be limited: ") + std::strerror(errno));
}

}  // namespace previz::aravis
