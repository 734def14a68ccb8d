// Starts this program again with the guard preloaded, then runs its tests.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
  if (std::getenv("DRIVEBENCH_GUARDED") == nullptr) {
    setenv("DRIVEBENCH_GUARDED", "1", 1);
    setenv("LD_PRELOAD", DRIVEBENCH_GUARD, 1);
    execv("/proc/self/exe", argv);
    std::perror("cannot start again with the guard");
    return 1;
  }
  if (dlsym(RTLD_DEFAULT, "guard_begin") == nullptr) {
    std::fprintf(stderr, "the guard %s could not be preloaded\n", DRIVEBENCH_GUARD);
    return 1;
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
