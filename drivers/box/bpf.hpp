// Puts together programs of the kernel's packet filter, which judges packets as well as system
// calls: see linux/filter.h.
#pragma once

#include <linux/audit.h>
#include <linux/filter.h>

#include <cstdint>
#include <initializer_list>
#include <vector>

namespace previz::bpf {

// A program, or a part of one. It has one value at a time, which loads replace and tests look at;
// a load from behind a packet's end drops the packet.
using Program = std::vector<sock_filter>;

// This processor, as a filter of system calls sees it.
#if defined(__x86_64__)
inline constexpr std::uint32_t architecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
inline constexpr std::uint32_t architecture = AUDIT_ARCH_AARCH64;
#else
#error "this processor's name in linux/audit.h is not known here"
#endif

inline Program load(unsigned size, std::uint32_t at) {
  return {sock_filter{static_cast<std::uint16_t>(BPF_LD | BPF_ABS | size), 0, 0, at}};
}
inline Program mask(std::uint32_t bits) {
  return {sock_filter{BPF_ALU | BPF_AND | BPF_K, 0, 0, bits}};
}
// Ends the program with this verdict.
inline Program verdict(std::uint32_t value) {
  return {sock_filter{BPF_RET | BPF_K, 0, 0, value}};
}

// Runs `part` if the value passes the test (BPF_JEQ: is `operand`, BPF_JGE, BPF_JGT, BPF_JSET: has
// one of its bits), or, with `when_not`, if it does not. A part has at most 255 instructions.
inline Program when(unsigned test, std::uint32_t operand, const Program& part) {
  Program program{sock_filter{static_cast<std::uint16_t>(BPF_JMP | BPF_K | test), 0,
                              static_cast<std::uint8_t>(part.size()), operand}};
  program.insert(program.end(), part.begin(), part.end());
  return program;
}
inline Program when_not(unsigned test, std::uint32_t operand, const Program& part) {
  Program program = when(test, operand, part);
  program.front().jt = program.front().jf;
  program.front().jf = 0;
  return program;
}

inline Program all(std::initializer_list<Program> parts) {
  Program program;
  for (const Program& part : parts) program.insert(program.end(), part.begin(), part.end());
  return program;
}

}  // namespace previz::bpf
