/* What a hostile FMU does to the process that it runs in: part of oscillator_fmu.c when it is built with -DHOSTILE. The
 * parameter "fault" says what, from "fault_time" on; -DAT_LOAD=1|2 crashes or hangs when the library is loaded. */
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/resource.h>
#include <sys/stat.h>

enum {
    SEGMENT = 10, ABORT, EXIT, STACK, DIVIDE, CLOSE_ALL, CLOSE_AND_HANG, FORK_AND_CRASH, DAEMON, FORK_MANY, STOP_SELF,
    KILL_PARENT, KILL_GROUP, DEAF_AND_HANG, GARBAGE, HALF_ANSWER, OVERRUN, INFINITE, STATUS, EXEC, SPIN, REMOVE_SCRATCH,
    TERMINATE_SELF, NO_FILES, BROKEN_PIPE, CLOSE_LINK_ONLY,
    START_CRASH = 50, START_HANG, START_NAN, END_HANG, END_CRASH, START_FORK
};

static void hang(void) {
    for (;;) sleep(1);
}

static int deep(volatile char *before) {
    volatile char room[65536];
    room[0] = before ? before[0] : 0;
    return deep(room) + room[0];
}

static void close_from(int first) {
    for (int d = first; d < 1024; d++) close(d);
}

static void write_everywhere(const void *data, size_t size) {
    for (int d = 3; d < 64; d++)
        if (write(d, data, size) < 0) continue;
}

static void crash(void) { *(volatile int *)8 = 1; }

/* A child that leaves its parent and its session, as daemons do. */
static void leave_daemon(void) {
    if (fork()) return;
    setsid();
    if (fork()) _exit(0);
    for (int s = 1; s < 32; s++) signal(s, SIG_IGN);
    hang();
}

/* Returns a status to return, or -1 to go on as if nothing were. */
static int misbehave(int fault, double *x) {
    static volatile int zero;
    struct rlimit none = {0, 0};
    switch (fault) {
        case SEGMENT: crash(); break;
        case ABORT: abort();
        case EXIT: exit(0);
        case STACK: return deep(NULL);
        case DIVIDE: raise(SIGFPE); break;
        case CLOSE_ALL: close_from(0); break;
        case CLOSE_AND_HANG: close_from(0); hang();
        case FORK_AND_CRASH: if (!fork()) hang(); crash(); break;
        case DAEMON: leave_daemon(); break;
        case FORK_MANY: for (int k = 0; k < 40; k++) if (!fork()) hang(); hang();
        case STOP_SELF: raise(SIGSTOP); break;
        case KILL_PARENT: kill(getppid(), SIGKILL); hang();
        case KILL_GROUP: kill(0, SIGKILL); break;
        case DEAF_AND_HANG: for (int s = 1; s < 65; s++) signal(s, SIG_IGN); hang();
        case GARBAGE: for (int k = 0; k < 100; k++) write_everywhere("nonsense nonsense", 17); break;
        case HALF_ANSWER: write_everywhere("\0\0", 2); hang();
        case OVERRUN: memset(malloc(16), 7, 1 << 20); abort();
        case INFINITE: *x = INFINITY; return 0;
        case STATUS: return 77;
        case EXEC: execl("/bin/true", "true", (char *)NULL); break;
        case SPIN: while (!zero); break;
        case REMOVE_SCRATCH: if (getenv("TMPDIR")) rmdir(getenv("TMPDIR")); chmod(getenv("TMPDIR"), 0); raise(SIGKILL); break;
        case TERMINATE_SELF: raise(SIGTERM); break;
        case NO_FILES: setrlimit(RLIMIT_NOFILE, &none); setrlimit(RLIMIT_FSIZE, &none); return 3;
        case BROKEN_PIPE: signal(SIGPIPE, SIG_DFL); raise(SIGPIPE); break;
        case CLOSE_LINK_ONLY: close_from(3); break;
    }
    return -1;
}

static void at_start(int fault, double *x) {
    if (fault == START_CRASH) crash();
    if (fault == START_HANG) hang();
    if (fault == START_NAN) *x = NAN;
    if (fault == START_FORK) leave_daemon();
}

static void at_end(int fault) {
    if (fault == END_HANG) hang();
    if (fault == END_CRASH) crash();
}

__attribute__((constructor)) static void loaded(void) {
#if AT_LOAD == 1
    crash();
#elif AT_LOAD == 2
    hang();
#endif
}
