#include "base/headroom.h"

#include <cstdio>
#include <cstdlib>
#include <iostream>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "base/passing_error.h"
#include "tests/sanitized.h"

namespace fdi {
namespace {

constexpr std::size_t kMegabyte = 1U << 20U;

// In a process of its own with so much address space beyond what it has: ends
// with 0 if there is room, again and again, or says why not and ends with
// kExitPassing.
[[noreturn]] void TryWith(std::size_t megabytes, int threads,
                          std::size_t bytes) {
  std::size_t pages = 0;
  if (std::FILE* const statm = std::fopen("/proc/self/statm", "r")) {
    static_cast<void>(std::fscanf(statm, "%zu", &pages));
    std::fclose(statm);
  }
  const rlim_t limit = pages * 4096 + megabytes * kMegabyte;
  const rlimit limits{limit, limit};
  setrlimit(RLIMIT_AS, &limits);
  try {
    for (int i = 0; i < 5; ++i) {
      RequireHeadroom(threads, bytes);
    }
  } catch (const PassingError& error) {
    std::cerr << error.what() << '\n';
    std::_Exit(kExitPassing);
  }
  std::_Exit(0);
}

TEST(HeadroomTest, ThreadsAndMemoryOfAnUnlimitedProcessAreThere) {
  EXPECT_NO_THROW(RequireHeadroom(64, 64 * kMegabyte));
}

TEST(HeadroomTest, WithoutAddressSpaceTheFiguresAndLimitsAreNamed) {
  if (kSanitized) {
    GTEST_SKIP() << "under a sanitizer";
  }
  EXPECT_EXIT(TryWith(64, 64, kMegabyte), testing::ExitedWithCode(kExitPassing),
              "no room for 64 threads and 1 MB of memory .*: see ulimit");
  EXPECT_EXIT(TryWith(64, 1, 100 * kMegabyte),
              testing::ExitedWithCode(kExitPassing),
              "no room for 1 threads and 100 MB of memory");
}

// In a process of its own that may have so many descriptors.
[[noreturn]] void OpenWith(rlim_t limit, int count) {
  const rlimit limits{limit, limit};
  setrlimit(RLIMIT_NOFILE, &limits);
  try {
    for (int i = 0; i < 5; ++i) {
      RequireDescriptors(count);
    }
  } catch (const PassingError& error) {
    std::cerr << error.what() << '\n';
    std::_Exit(kExitPassing);
  }
  std::_Exit(0);
}

TEST(HeadroomTest, WithoutDescriptorsTheirLimitIsNamed) {
  EXPECT_EXIT(OpenWith(64, 80), testing::ExitedWithCode(kExitPassing),
              "no room for 80 files and sockets .*: see ulimit -n");
  EXPECT_EXIT(OpenWith(64, 32), testing::ExitedWithCode(0), "");
}

TEST(HeadroomTest, WhatWasTriedIsGivenBack) {
  if (kSanitized) {
    GTEST_SKIP() << "under a sanitizer";
  }
  EXPECT_EXIT(TryWith(64, 1, 40 * kMegabyte), testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace fdi
