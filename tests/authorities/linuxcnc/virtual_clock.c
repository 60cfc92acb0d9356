/* A clock shared by a group of processes that stands still while any of them computes.

   Preloaded (LD_PRELOAD) into LinuxCNC's simulator and its driver.  Until virtual_clock_start() is
   called every sleep and every look at the clock is the real one.  Afterwards a sleeping thread only
   writes down when it wants to wake; as soon as no thread of the group runs, the time jumps to the
   earliest of those wishes and that one thread is woken.  So a program takes as long as its arithmetic
   takes, and the motion does not depend on how busy the computer is.

       thread A  ====zzzz......========zzzz        = runs   z asleep, time stands
       thread B  zzzzzzzz======zzzzzzzz====        . woken by the jump to its wish

   A thread belongs to the group from its first sleep on.  One that waits in the kernel for something
   else for more than PATIENCE_NS of real time is left out until it sleeps again.

   Build: cc -O2 -shared -fPIC virtual_clock.c -o virtual_clock.so -ldl -lpthread
   The group shares the file named by VIRTUAL_CLOCK_FILE, made by whoever comes first. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/select.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define SECOND_NS 1000000000LL
#define PATIENCE_NS 100000000LL
#define LOOK_ROUND_NS 2000000LL     /* how often a sleeper checks that the group is still alive */
#define SHORTEST_NS 1000LL          /* a sleep of nothing still lets the others run */
#define POLL_STEP_NS 1000000LL      /* virtual time between two looks at file descriptors */
#define BUSY_LOOKS 20000            /* looks at a clock that stands still before it is nudged */
#define MEMBERS 128

typedef int64_t ns_t;

struct member {
    int used, left_out, process, thread;
    volatile int asleep;            /* futex */
    ns_t wake, woken_real, turn;    /* turn: order of waking, for fairness among equal wishes */
};

struct group {
    volatile int ready, on, gathering;
    pthread_mutex_t mutex;
    volatile ns_t now, began, began_realtime;
    ns_t turns;
    struct member members[MEMBERS];
};

static struct group *group;
static __thread struct member *self;
static __thread unsigned looks;
static pthread_key_t leaving;

static struct {
    int (*clock_gettime)(clockid_t, struct timespec *);
    int (*clock_nanosleep)(clockid_t, int, const struct timespec *, struct timespec *);
    int (*select)(int, fd_set *, fd_set *, fd_set *, struct timeval *);
    int (*poll)(struct pollfd *, nfds_t, int);
} libc;

/* ---- small pieces ---- */

static ns_t to_ns(const struct timespec *t) { return t->tv_sec * SECOND_NS + t->tv_nsec; }

static struct timespec from_ns(ns_t n)
{
    return (struct timespec){ .tv_sec = n / SECOND_NS, .tv_nsec = n % SECOND_NS };
}

static ns_t real_now(clockid_t which)
{
    struct timespec t;
    libc.clock_gettime(which, &t);
    return to_ns(&t);
}

static int is_wall_clock(clockid_t c) { return c == CLOCK_REALTIME || c == CLOCK_REALTIME_COARSE; }

static int is_steady_clock(clockid_t c)
{
    return c == CLOCK_MONOTONIC || c == CLOCK_MONOTONIC_RAW || c == CLOCK_MONOTONIC_COARSE || c == CLOCK_BOOTTIME;
}

static void lock(void)
{
    if (pthread_mutex_lock(&group->mutex) == EOWNERDEAD)
        pthread_mutex_consistent(&group->mutex);
}

static void unlock(void) { pthread_mutex_unlock(&group->mutex); }

/* ---- the group; everything here is called with the lock held ---- */

static void wake(struct member *m)
{
    if (m->wake > group->now)
        group->now = m->wake;
    m->turn = ++group->turns;
    m->woken_real = real_now(CLOCK_MONOTONIC);
    m->left_out = 0;
    m->asleep = 0;
    if (m != self)
        syscall(SYS_futex, &m->asleep, FUTEX_WAKE, 1, NULL, NULL, 0);
}

/* if nobody runs, the member with the earliest wish does */
static void pass_on(void)
{
    struct member *next = NULL;
    if (group->gathering)
        return;
    for (struct member *m = group->members; m < group->members + MEMBERS; m++) {
        if (!m->used || (!m->asleep && m->left_out))
            continue;
        if (!m->asleep)
            return;
        if (!next || m->wake < next->wake || (m->wake == next->wake && m->turn < next->turn))
            next = m;
    }
    if (next)
        wake(next);
}

/* 'R' running, 'S' waiting in the kernel, ...; 0 when there is no such thread */
static char state_of(const struct member *m)
{
    char path[64], text[512];
    snprintf(path, sizeof path, "/proc/%d/task/%d/stat", m->process, m->thread);
    int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0)
        return 0;
    ssize_t n = read(file, text, sizeof text - 1);
    close(file);
    text[n > 0 ? n : 0] = 0;
    char *end_of_name = strrchr(text, ')');
    return end_of_name && end_of_name[1] ? end_of_name[2] : 0;
}

/* forget members that died, leave out those that wait for something else */
static void look_round(void)
{
    ns_t now = real_now(CLOCK_MONOTONIC);
    for (struct member *m = group->members; m < group->members + MEMBERS; m++) {
        if (!m->used || m == self || (!m->asleep && (m->left_out || now - m->woken_real < PATIENCE_NS)))
            continue;
        char state = state_of(m);
        if (state == 0 || state == 'Z' || state == 'X')
            m->used = 0;
        else if (!m->asleep && state == 'S')
            m->left_out = 1;
    }
    pass_on();
}

static struct member *enrol(void)
{
    int thread = syscall(SYS_gettid);
    struct member *free_one = NULL;
    for (struct member *m = group->members; m < group->members + MEMBERS; m++) {
        if (m->used && m->thread == thread)
            m->used = 0;            /* of a thread that died before this one got its number */
        if (!m->used && !free_one)
            free_one = m;
    }
    if (free_one) {
        *free_one = (struct member){ .used = 1, .process = getpid(), .thread = thread };
        pthread_setspecific(leaving, free_one);
    }
    return free_one;
}

/* ---- sleeping; called without the lock ---- */

static void sleep_until(ns_t when)
{
    looks = 0;
    lock();
    if (!self || !self->used)
        self = enrol();
    struct member *m = self;
    if (!m) {
        unlock();
        sched_yield();
        return;
    }
    m->wake = when > group->now ? when : group->now;
    m->left_out = 0;
    m->asleep = 1;
    pass_on();
    unlock();
    while (m->asleep) {
        struct timespec patience = from_ns(LOOK_ROUND_NS);
        syscall(SYS_futex, &m->asleep, FUTEX_WAIT, 1, &patience, NULL, 0);
        lock();
        if (!group->on)
            m->asleep = 0;
        else if (m->asleep)
            look_round();
        unlock();
    }
}

static void leave(void *member)
{
    struct member *m = member;
    lock();
    m->used = 0;
    self = NULL;
    if (group->on)
        pass_on();
    unlock();
}

static void forget_parent(void) { self = NULL; }

/* ---- start and end of a process ---- */

static int map_group(const char *path)
{
    int file = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666), is_first = file >= 0;
    struct stat info;
    if (!is_first)
        file = open(path, O_RDWR | O_CLOEXEC);
    if (file < 0 || (is_first && ftruncate(file, sizeof *group)))
        return -1;
    while (!fstat(file, &info) && info.st_size < (off_t)sizeof *group)
        sched_yield();
    struct group *mapped = mmap(NULL, sizeof *group, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (mapped == MAP_FAILED)
        return -1;
    if (is_first) {
        pthread_mutexattr_t shared;
        pthread_mutexattr_init(&shared);
        pthread_mutexattr_setpshared(&shared, PTHREAD_PROCESS_SHARED);
        pthread_mutexattr_setrobust(&shared, PTHREAD_MUTEX_ROBUST);
        pthread_mutex_init(&mapped->mutex, &shared);
        __sync_synchronize();
        mapped->ready = 1;
    }
    while (!mapped->ready)
        sched_yield();
    group = mapped;
    return 0;
}

__attribute__((constructor)) static void begin(void)
{
    if (libc.clock_gettime)
        return;
    libc.clock_gettime = dlsym(RTLD_NEXT, "clock_gettime");
    libc.clock_nanosleep = dlsym(RTLD_NEXT, "clock_nanosleep");
    libc.select = dlsym(RTLD_NEXT, "select");
    libc.poll = dlsym(RTLD_NEXT, "poll");
    pthread_key_create(&leaving, leave);
    pthread_atfork(NULL, NULL, forget_parent);
    const char *path = getenv("VIRTUAL_CLOCK_FILE");
    if (path && map_group(path))
        fprintf(stderr, "virtual clock: cannot share %s\n", path);
}

__attribute__((destructor)) static void end(void)
{
    if (!group)
        return;
    lock();
    for (struct member *m = group->members; m < group->members + MEMBERS; m++)
        if (m->used && m->process == getpid())
            m->used = 0;
    self = NULL;
    if (group->on)
        pass_on();
    unlock();
}

static int is_virtual(void)
{
    if (!libc.clock_gettime)
        begin();
    return group && group->on;
}

/* ---- what the driver calls ---- */

void virtual_clock_start(void)
{
    struct timespec gather = from_ns(PATIENCE_NS);      /* time for everybody to fall asleep in it */
    if (!group || group->on)
        return;
    group->began = group->now = real_now(CLOCK_MONOTONIC);
    group->began_realtime = real_now(CLOCK_REALTIME);
    group->gathering = 1;
    __sync_synchronize();
    group->on = 1;
    libc.clock_nanosleep(CLOCK_MONOTONIC, 0, &gather, NULL);
    lock();
    group->gathering = 0;
    pass_on();
    unlock();
}

void virtual_clock_stop(void)
{
    if (group)
        group->on = 0;
}

/* ---- what stands in for the C library ---- */

int clock_gettime(clockid_t which, struct timespec *t)
{
    if (!is_virtual() || !(is_steady_clock(which) || is_wall_clock(which)))
        return libc.clock_gettime(which, t);
    *t = from_ns(is_steady_clock(which) ? group->now : group->began_realtime + (group->now - group->began));
    if (++looks > BUSY_LOOKS && self)
        sleep_until(group->now + SHORTEST_NS);
    return 0;
}

int gettimeofday(struct timeval *restrict tv, void *restrict zone)
{
    struct timespec t;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &t);
    tv->tv_sec = t.tv_sec;
    tv->tv_usec = t.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *out)
{
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    if (out)
        *out = t.tv_sec;
    return t.tv_sec;
}

int clock_nanosleep(clockid_t which, int flags, const struct timespec *wish, struct timespec *left)
{
    if (!is_virtual())
        return libc.clock_nanosleep(which, flags, wish, left);
    ns_t when = to_ns(wish);
    if (!(flags & TIMER_ABSTIME))
        when = group->now + (when > SHORTEST_NS ? when : SHORTEST_NS);
    else if (is_wall_clock(which))
        when = when - group->began_realtime + group->began;
    sleep_until(when);
    return 0;
}

int nanosleep(const struct timespec *wish, struct timespec *left)
{
    int error = clock_nanosleep(CLOCK_MONOTONIC, 0, wish, left);
    if (error)
        errno = error;
    return error ? -1 : 0;
}

int usleep(useconds_t us)
{
    struct timespec wish = from_ns(us * 1000LL);
    return nanosleep(&wish, NULL);
}

unsigned int sleep(unsigned int seconds)
{
    struct timespec wish = from_ns(seconds * SECOND_NS);
    nanosleep(&wish, NULL);
    return 0;
}

static void wait_a_step(ns_t deadline)
{
    ns_t next = group->now + POLL_STEP_NS;
    sleep_until(next < deadline ? next : deadline);
}

int select(int n, fd_set *r, fd_set *w, fd_set *e, struct timeval *limit)
{
    if (!is_virtual() || !limit || (!limit->tv_sec && !limit->tv_usec))
        return libc.select(n, r, w, e, limit);
    ns_t deadline = group->now + limit->tv_sec * SECOND_NS + limit->tv_usec * 1000LL;
    fd_set ask[3];
    fd_set *given[3] = { r, w, e }, *asked[3] = { NULL, NULL, NULL };
    for (;;) {
        struct timeval now = { 0, 0 };
        for (int i = 0; i < 3; i++)
            if (given[i]) {
                ask[i] = *given[i];
                asked[i] = &ask[i];
            }
        int found = libc.select(n, asked[0], asked[1], asked[2], &now);
        if (found || group->now >= deadline) {
            for (int i = 0; i < 3; i++)
                if (given[i])
                    *given[i] = ask[i];
            return found;
        }
        if (n == 0)
            sleep_until(deadline);
        else
            wait_a_step(deadline);
    }
}

int poll(struct pollfd *files, nfds_t n, int limit_ms)
{
    if (!is_virtual() || limit_ms <= 0)
        return libc.poll(files, n, limit_ms);
    ns_t deadline = group->now + limit_ms * 1000000LL;
    for (;;) {
        int found = libc.poll(files, n, 0);
        if (found || group->now >= deadline)
            return found;
        wait_a_step(deadline);
    }
}
