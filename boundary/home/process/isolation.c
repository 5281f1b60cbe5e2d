#define _GNU_SOURCE
#include "isolation.h"

#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/landlock.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <signal.h>
#include <stddef.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#if defined(__x86_64__)
#define ARCHITECTURE AUDIT_ARCH_X86_64
#elif defined(__aarch64__)
#define ARCHITECTURE AUDIT_ARCH_AARCH64
#else
#error "the boundary's process runs on x86-64 and aarch64"
#endif

#ifndef SYS_memfd_secret
#define SYS_memfd_secret 447
#endif

void *rt_key_memory(uint32_t size, uint32_t *measures) {
    long file = syscall(SYS_memfd_secret, 0);
    if (file >= 0) {
        void *secret = MAP_FAILED;
        if (ftruncate((int)file, size) == 0)
            secret = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, (int)file, 0);
        close((int)file);
        if (secret != MAP_FAILED) {
            *measures |= RT_SECRET_MEMORY | RT_LOCKED_MEMORY;
            return secret;
        }
    }
    void *plain = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (plain == MAP_FAILED)
        return NULL;
    if (mlock(plain, size) == 0)
        *measures |= RT_LOCKED_MEMORY;
    (void)madvise(plain, size, MADV_DONTDUMP);
    return plain;
}

static int no_files(void) {
    struct landlock_ruleset_attr every = {0};
    long abi = syscall(SYS_landlock_create_ruleset, NULL, 0, LANDLOCK_CREATE_RULESET_VERSION);
    if (abi < 1)
        return 0;
    every.handled_access_fs = LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_READ_FILE |
                              LANDLOCK_ACCESS_FS_READ_DIR | LANDLOCK_ACCESS_FS_REMOVE_DIR | LANDLOCK_ACCESS_FS_REMOVE_FILE |
                              LANDLOCK_ACCESS_FS_MAKE_CHAR | LANDLOCK_ACCESS_FS_MAKE_DIR | LANDLOCK_ACCESS_FS_MAKE_REG |
                              LANDLOCK_ACCESS_FS_MAKE_SOCK | LANDLOCK_ACCESS_FS_MAKE_FIFO | LANDLOCK_ACCESS_FS_MAKE_BLOCK |
                              LANDLOCK_ACCESS_FS_MAKE_SYM;
    long rules = syscall(SYS_landlock_create_ruleset, &every, sizeof every.handled_access_fs, 0);
    if (rules < 0)
        return 0;
    long done = syscall(SYS_landlock_restrict_self, (int)rules, 0);
    close((int)rules);
    return done == 0;
}

#define ALLOW(name)                                                                                                              \
    BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_##name, 0, 1), BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)
#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "the filter reads the lower half of an argument first"
#endif

static int few_calls(void) {
    struct sock_filter filter[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, arch)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ARCHITECTURE, 1, 0),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
        ALLOW(recvfrom), ALLOW(sendto), ALLOW(pwrite64), ALLOW(fdatasync), ALLOW(clock_gettime), ALLOW(getrandom),
        ALLOW(exit_group), ALLOW(rt_sigreturn), ALLOW(restart_syscall), ALLOW(futex),
        ALLOW(getppid), ALLOW(timer_settime), ALLOW(adjtimex), /* which sets nothing without CAP_SYS_TIME */
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_prctl, 0, 3), /* PR_SET_PDEATHSIG alone: rt_end_with */
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, args)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, PR_SET_PDEATHSIG, 0, 1), BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
    };
    struct sock_fprog program = {sizeof filter / sizeof *filter, filter};
    return syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &program) == 0;
}

/* Whether the network namespace has only its loopback, as systemd makes one: two header lines, and one for `lo`. */
static int no_network(void) {
    char text[1024];
    int file = open("/proc/self/net/dev", O_RDONLY | O_CLOEXEC);
    ssize_t size = file < 0 ? -1 : read(file, text, sizeof text - 1);
    if (file >= 0) close(file);
    text[size < 0 ? 0 : size] = 0;
    const char *line = text;
    for (int head = 0; head < 2 && line != NULL; head++) line = strchr(line, '\n') == NULL ? NULL : strchr(line, '\n') + 1;
    if (line == NULL) return 0;
    const char *after = strchr(line, '\n');
    return strncmp(line + strspn(line, " "), "lo:", 3) == 0 && after != NULL && after[1] == 0;
}

uint32_t rt_isolate(uint32_t user, uint32_t group) {
    uint32_t measures = 0;
    const struct rlimit none = {0, 0};
    if (unshare(CLONE_NEWNET) == 0 || no_network())
        measures |= RT_OWN_NETWORK;
    if (user != 0 && setgroups(0, NULL) == 0 && setresgid(group, group, group) == 0 && setresuid(user, user, user) == 0)
        measures |= RT_OWN_USER;
    (void)setrlimit(RLIMIT_CORE, &none);
    if (prctl(PR_SET_DUMPABLE, 0, 0, 0, 0) == 0) /* after a change of user, which makes it dumpable again */
        measures |= RT_NOT_DUMPABLE;
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0)
        return measures;
    if (no_files())
        measures |= RT_LANDLOCK;
    if (few_calls())
        measures |= RT_SECCOMP;
    return measures;
}

int rt_is_anothers(int connection) {
    struct ucred peer;
    socklen_t size = sizeof peer;
    return getsockopt(connection, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 && peer.uid != geteuid();
}

int rt_end_with(int parent) {
    (void)prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0);
    return getppid() == parent; /* it may have ended before that */
}
