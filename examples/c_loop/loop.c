/* An exported model as the controller of a loop: targets [um] from standard input, one a line, voltages [V] to standard
   output, one for each tick of 20 kHz (or the rate the model was exported for). What the clock did is told at the end.

       fomrc export --model M.yaml --output stage --name stage --rate 20000 --direction inverse
       cc -std=c99 -O2 -Istage examples/c_loop/loop.c stage/stage.c -lm -o loop
       ./loop < targets.txt > voltages.txt            with real-time priority, where it may: chrt -f 80 ./loop ...

   The loop itself reads and writes memory only: a file or a terminal would keep it waiting. Targets are read before,
   voltages are written behind it; a converter takes the place of both. */
#define _GNU_SOURCE

#include "stage.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#ifdef __linux__
#include <sys/prctl.h>
#endif
#include <time.h>

enum { N_TICKS_MAX = 1 << 20 };

static double targets_um[N_TICKS_MAX];
static double voltages_v[N_TICKS_MAX];
static long late_ns[N_TICKS_MAX];
static long worked_ns[N_TICKS_MAX];

static long nanoseconds_between(const struct timespec *from, const struct timespec *to)
{
    return (long)(to->tv_sec - from->tv_sec) * 1000000000L + (to->tv_nsec - from->tv_nsec);
}

static void add_nanoseconds(struct timespec *time, long nanoseconds)
{
    time->tv_nsec += nanoseconds;
    while (time->tv_nsec >= 1000000000L) {
        time->tv_nsec -= 1000000000L;
        time->tv_sec++;
    }
}

static int by_size(const void *first, const void *second)
{
    const long a = *(const long *)first, b = *(const long *)second;
    return (a > b) - (a < b);
}

/* The value below which so many thousandths of the sorted values lie. */
static double quantile_us(const long *sorted, long n, long thousandths)
{
    long at = n * thousandths / 1000;
    if (at >= n) at = n - 1;
    return (double)sorted[at] * 1e-3;
}

int main(void)
{
    const long period_ns = (long)(STAGE_SAMPLE_TIME_S * 1e9 + 0.5);
    stage_inverse state;
    struct timespec due, woken, done;
    long n_ticks = 0, n_missed = 0;

    while (n_ticks < N_TICKS_MAX && scanf("%lf", &targets_um[n_ticks]) == 1) n_ticks++;
    if (n_ticks == 0) {
        fprintf(stderr, "no targets: one displacement [um] a line, up to %d\n", (int)N_TICKS_MAX);
        return EXIT_FAILURE;
    }

    /* Memory that is touched for the first time inside the loop would be fetched there. */
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0)
        for (long k = 0; k < n_ticks; k++) voltages_v[k] = (double)(late_ns[k] = worked_ns[k] = 1);

#ifdef __linux__
    prctl(PR_SET_TIMERSLACK, 1UL); /* Linux wakes an ordinary program up to 50 us late on purpose */
#endif
    stage_inverse_init(&state);
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (long k = 0; k < n_ticks; k++) {
        add_nanoseconds(&due, period_ns);
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR) continue;
        clock_gettime(CLOCK_MONOTONIC, &woken);
        voltages_v[k] = (double)stage_inverse_step_fixed_limited(
            &state, &stage_default_limits, (stage_real)targets_um[k]);
        clock_gettime(CLOCK_MONOTONIC, &done);
        late_ns[k] = nanoseconds_between(&due, &woken);
        worked_ns[k] = nanoseconds_between(&woken, &done);
        /* A tick is missed where its voltage comes after the next one is due. */
        if (late_ns[k] + worked_ns[k] > period_ns) n_missed++;
    }

    for (long k = 0; k < n_ticks; k++) printf("%.9g\n", voltages_v[k]);
    qsort(late_ns, (size_t)n_ticks, sizeof late_ns[0], by_size);
    qsort(worked_ns, (size_t)n_ticks, sizeof worked_ns[0], by_size);
    fprintf(stderr, "%ld ticks of %.6g us: late by %.1f us in the median, %.1f us p99.9, %.1f us at most; ", n_ticks,
            (double)period_ns * 1e-3, quantile_us(late_ns, n_ticks, 500), quantile_us(late_ns, n_ticks, 999),
            quantile_us(late_ns, n_ticks, 1000));
    fprintf(stderr, "step %.2f us in the median, %.2f us p99.9; %ld missed (%.3f %%)\n",
            quantile_us(worked_ns, n_ticks, 500), quantile_us(worked_ns, n_ticks, 999), n_missed,
            100.0 * (double)n_missed / (double)n_ticks);
    return EXIT_SUCCESS;
}
