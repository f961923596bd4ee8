// A wall clock of one's own for a process: CLOCK_REALTIME plus an offset that another one writes.
//
// LD_PRELOAD=soak_clock.so SOAK_CLOCK=FILE command
//
// FILE holds one double, s. Monotonic clocks are left as they are, as when a computer's clock is
// set. Waits until a moment of the wall clock are put into the kernel's time as they begin; one
// that has begun is not moved by a step.
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

namespace {

constexpr long kSecond = 1000000000L;
// A moment before 2001 is none of the wall clock: somebody waits by the monotonic one.
constexpr time_t kWallClock = 1000000000;

const volatile double *shared() {
  static const volatile double *offset = [] {
    static const double none = 0.0;
    const volatile double *found = &none;
    const char *path = getenv("SOAK_CLOCK");
    int file = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    if (file >= 0) {
      void *page = mmap(nullptr, sizeof(double), PROT_READ, MAP_SHARED, file, 0);
      if (page != MAP_FAILED) found = static_cast<const volatile double *>(page);
      close(file);
    }
    return found;
  }();
  return offset;
}

void add(timespec *when, double seconds) {
  long more = static_cast<long>(seconds * 1e9);
  when->tv_sec += more / kSecond;
  when->tv_nsec += more % kSecond;
  if (when->tv_nsec >= kSecond) when->tv_nsec -= kSecond, ++when->tv_sec;
  if (when->tv_nsec < 0) when->tv_nsec += kSecond, --when->tv_sec;
}

timespec kernel_time(const timespec *until) {
  timespec moved = *until;
  if (moved.tv_sec >= kWallClock) add(&moved, -*shared());
  return moved;
}

template <typename Function>
Function next(const char *name, const char *version) {
  // Without the version an old condition variable may be found, of another layout.
  void *found = version ? dlvsym(RTLD_NEXT, name, version) : nullptr;
  return reinterpret_cast<Function>(found ? found : dlsym(RTLD_NEXT, name));
}

bool is_wall(clockid_t clock) {
  return clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE;
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec *now) noexcept {
  static auto real = next<int (*)(clockid_t, timespec *)>("clock_gettime", nullptr);
  int failed = real ? real(clock, now)
                    : static_cast<int>(syscall(SYS_clock_gettime, clock, now));
  if (!failed && is_wall(clock)) add(now, *shared());
  return failed;
}

int gettimeofday(timeval *now, void *) noexcept {
  timespec exact;
  if (clock_gettime(CLOCK_REALTIME, &exact)) return -1;
  now->tv_sec = exact.tv_sec;
  now->tv_usec = exact.tv_nsec / 1000;
  return 0;
}

time_t time(time_t *now) noexcept {
  timespec exact;
  clock_gettime(CLOCK_REALTIME, &exact);
  if (now) *now = exact.tv_sec;
  return exact.tv_sec;
}

int pthread_cond_timedwait(pthread_cond_t *one, pthread_mutex_t *mutex, const timespec *until) {
  static auto real = next<int (*)(pthread_cond_t *, pthread_mutex_t *, const timespec *)>(
      "pthread_cond_timedwait", "GLIBC_2.3.2");
  timespec moved = kernel_time(until);
  return real(one, mutex, &moved);
}

int pthread_cond_clockwait(pthread_cond_t *one, pthread_mutex_t *mutex, clockid_t clock,
                           const timespec *until) {
  static auto real =
      next<int (*)(pthread_cond_t *, pthread_mutex_t *, clockid_t, const timespec *)>(
          "pthread_cond_clockwait", nullptr);
  timespec moved = is_wall(clock) ? kernel_time(until) : *until;
  return real(one, mutex, clock, &moved);
}

int pthread_mutex_timedlock(pthread_mutex_t *mutex, const timespec *until) noexcept {
  static auto real =
      next<int (*)(pthread_mutex_t *, const timespec *)>("pthread_mutex_timedlock", nullptr);
  timespec moved = kernel_time(until);
  return real(mutex, &moved);
}

int sem_timedwait(sem_t *one, const timespec *until) {
  static auto real = next<int (*)(sem_t *, const timespec *)>("sem_timedwait", nullptr);
  timespec moved = kernel_time(until);
  return real(one, &moved);
}

int sem_clockwait(sem_t *one, clockid_t clock, const timespec *until) {
  static auto real =
      next<int (*)(sem_t *, clockid_t, const timespec *)>("sem_clockwait", nullptr);
  timespec moved = is_wall(clock) ? kernel_time(until) : *until;
  return real(one, clock, &moved);
}

}  // extern "C"
