/* The boundary as a process of its own: it answers the calls of `enforcement/calls.h` that come over one socket, with what it was
   given at its start: the trust root, the identity of the vehicle, the keys and one file of its own.

       rtshcua-boundary --socket FD --root FD --pin HEX --vehicle IDENTITY --kept FD [--link-key FD] [--boundary-key FD] [--log-key FD]
                        [--user UID --group GID] [--settings FD] [--owed FD] [--utc-error US] [--paced]
       rtshcua-boundary --socket FD --folder PATH [--keys PATH] [--utc-error US] [--paced]
       rtshcua-boundary --socket FD --measures [--user UID --group GID]

   SETTINGS are the parameters that are set of the vehicle before a flight, OWED those that an earlier run set and did not put back,
   each as the body of a preparation (wire/preparation.h).

   It holds to the time of day that the machine has, where the kernel says that this is synchronised; else to that of the vehicle, where
   its link has a key; else, with `--utc-error`, to the machine's all the same, which is off by so many us at most. With `--paced` it
   has no clock: time is simulated.

   With `--folder` somebody else listened, as systemd does, and another user connected. The address of the socket ends in the identity
   of the vehicle, and PATH/IDENTITY, which nobody else may look into, holds what the other options say: `root.trust`, `root.pin`,
   `kept`, and, there or in the folder of `--keys`, `log.seed`, `boundary.seed` and `link.key`; the last two may be missing.

   With `--measures` it takes the measures of isolation.h, sends its first message, and ends.

   Every other file is opened by who starts it, so that it needs no path. Once it began, it has no right to open one. It first sends
   one message: the measures that are in force (4 octets, isolation.h), the name of the link's key (8), and the public halves of the
   log's key and of its own (32 each), zeros for keys that it does not have, and whether it decides by a clock of its own (1). Where it
   does not begin, that message is the octet that it ends with: 64 for a wrong command line, 65 where the root is not to be trusted, 66
   where the link's key is none, 72 where a file is missing or cannot be read, or others may look into its
   folder, 74 where its file cannot be read or written, 75 where another boundary holds that file, 78 where it is damaged. It ends
   with 0 when the socket is closed. */
#define _GNU_SOURCE
#include "isolation.h"

#include "../common.h"
#include "enforcement/calls.h"
#include "crypto/crypto.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/timex.h>
#include <sys/types.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

enum { FINE = 0, USAGE = 64, UNTRUSTED = 65, NO_KEY = 66, MISSING = 72, IO = 74, IN_USE = 75, DAMAGED = 78 };
/* how long a call may take, and the beginning or loading a bundle, in s: the runtime waits for 1.2 s and 20 s (rtshcua/adapters/boundary/process.py),
   and a machine that stands still for a moment ends nothing; and how often one wakes that waits for a call */
#define CALL_S 3
#define BEGINNING_S 20
#define WAKING_S 1

static rt_boundary boundary;
static rt_kept slots[2];
static uint8_t call[RT_MAX_CALL], result[RT_MAX_RESULT];

typedef struct {
    int socket, root, kept, link_key, boundary_key, log_key, settings, owed;
    const char *vehicle, *pin, *folder, *keys;
    uint32_t user, group;
    int64_t utc_error;
    int paced, measures;
} options;

static int number(const char *text, uint32_t *value) {
    char *end;
    unsigned long found = strtoul(text, &end, 10);
    *value = (uint32_t)found;
    return *text != 0 && *end == 0 && found <= 0x7FFFFFFF;
}

/* A time in us for which an error may be stated. */
static int number_of_us(const char *text, int64_t *value) {
    char *end;
    errno = 0;
    const unsigned long long found = strtoull(text, &end, 10);
    *value = (int64_t)found;
    return *text != 0 && *end == 0 && errno == 0 && found <= RT_UTC_UNKNOWN_US;
}

static int read_options(int count, char **words, options *given) {
    *given = (options){-1, -1, -1, -1, -1, -1, -1, -1, NULL, NULL, NULL, NULL, 0, 0, -1, 0, 0};
    struct { const char *name; int *file; } files[] = {
        {"--socket", &given->socket}, {"--root", &given->root}, {"--kept", &given->kept},
        {"--link-key", &given->link_key}, {"--boundary-key", &given->boundary_key}, {"--log-key", &given->log_key},
        {"--settings", &given->settings}, {"--owed", &given->owed},
    };
    for (int at = 1; at < count; at++) {
        uint32_t value;
        int known = 0;
        if (strcmp(words[at], "--paced") == 0) {
            given->paced = 1;
            continue;
        }
        if (strcmp(words[at], "--measures") == 0) {
            given->measures = 1;
            continue;
        }
        if (at + 1 == count)
            return 0;
        const char *name = words[at++], *said = words[at];
        for (size_t each = 0; each < sizeof files / sizeof *files; each++)
            if (strcmp(name, files[each].name) == 0) {
                known = number(said, &value);
                *files[each].file = (int)value;
            }
        if (strcmp(name, "--vehicle") == 0)
            known = 1, given->vehicle = said;
        else if (strcmp(name, "--pin") == 0)
            known = 1, given->pin = said;
        else if (strcmp(name, "--folder") == 0)
            known = 1, given->folder = said;
        else if (strcmp(name, "--keys") == 0)
            known = 1, given->keys = said;
        else if (strcmp(name, "--utc-error") == 0)
            known = number_of_us(said, &given->utc_error);
        else if (strcmp(name, "--user") == 0)
            known = number(said, &given->user);
        else if (strcmp(name, "--group") == 0)
            known = number(said, &given->group);
        if (!known)
            return 0;
    }
    const int handed = given->root >= 0 && given->kept >= 0 && given->vehicle != NULL;
    return given->socket >= 0 && (given->measures || given->folder != NULL || handed);
}

/* A regular file of a folder, for reading; -1 if there is none, and `errno` is ENOENT if nothing has that name. */
static int open_file(int folder, const char *name) {
    struct stat found;
    int file = openat(folder, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (file >= 0 && (fstat(file, &found) != 0 || !S_ISREG(found.st_mode))) {
        close(file);
        errno = EINVAL;
        return -1;
    }
    return file;
}

/* The same for an optional file. False if it exists but cannot be read: a boundary never continues as if there were no such key. */
static int open_if_there(int folder, const char *name, int *file) {
    *file = open_file(folder, name);
    return *file >= 0 || errno == ENOENT;
}

static size_t read_all(int file, void *into, size_t most) {
    size_t done = 0;
    ssize_t got = 1;
    while (done < most && (got = read(file, (uint8_t *)into + done, most - done)) > 0)
        done += (size_t)got;
    close(file);
    return got < 0 ? 0 : done;
}

/* The contents of the vehicle's folder; the socket is named after the vehicle. The connected user chooses none of it. */
static int open_folder(options *given) {
    static struct sockaddr_un address;
    static char pin[2 * RT_KEY_BYTES + 2];
    socklen_t size = sizeof address - 1;
    if (getsockname(given->socket, (struct sockaddr *)&address, &size) != 0 || address.sun_family != AF_UNIX) return USAGE;
    const char *end = strrchr(address.sun_path, '/');
    if (end == NULL || end[1] == 0) return USAGE;
    given->vehicle = end + 1;
    struct stat found;
    int all = open(given->folder, O_PATH | O_DIRECTORY | O_CLOEXEC);
    int folder = openat(all, given->vehicle, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    int keys = given->keys == NULL ? folder : open(given->keys, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0 || keys < 0 || fstat(folder, &found) != 0 || found.st_uid != geteuid() || (found.st_mode & 077) != 0) return MISSING;
    given->root = open_file(folder, "root.trust");
    given->log_key = open_file(keys, "log.seed");
    if (!open_if_there(keys, "boundary.seed", &given->boundary_key) || !open_if_there(keys, "link.key", &given->link_key))
        return MISSING;
    int pinned = open_file(folder, "root.pin");
    if (given->root < 0 || given->log_key < 0 || pinned < 0) return MISSING;
    (void)read_all(pinned, pin, sizeof pin - 1);
    given->pin = pin;
    given->kept = openat(folder, "kept", O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (given->kept < 0 && errno == ENOENT) return DAMAGED; /* who provisioned the folder made it */
    if (given->kept < 0 || fstat(given->kept, &found) != 0 || !S_ISREG(found.st_mode)) return IO;
    return flock(given->kept, LOCK_EX | LOCK_NB) == 0 ? FINE : errno == EWOULDBLOCK ? IN_USE : IO;
}

/* If another user connected, the kernel ends a process that hangs or is stopped, once the time that is renewed regularly has passed. */
static timer_t patience;
static int is_timed;

static int give_time(int seconds) {
    const struct itimerspec from_now = {{0, 0}, {seconds, 0}};
    return !is_timed || timer_settime(patience, 0, &from_now, NULL) == 0;
}

static int start_timer(int socket) {
    const struct timeval waking = {WAKING_S, 0};
    struct sigevent event = {0};
    event.sigev_notify = SIGEV_SIGNAL;
    event.sigev_signo = SIGKILL;
    is_timed = timer_create(CLOCK_MONOTONIC, &event, &patience) == 0;
    return is_timed && give_time(BEGINNING_S) && setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &waking, sizeof waking) == 0;
}

static int write_kept(int file, rt_kept *kept) {
    rt_seal_kept(kept);
    off_t at = (off_t)((kept->turn & 1) * sizeof *kept);
    size_t done = 0;
    while (done < sizeof *kept) {
        ssize_t put = pwrite(file, (const uint8_t *)kept + done, sizeof *kept - done, at + (off_t)done);
        if (put < 0 && errno != EINTR)
            return 0;
        done += put > 0 ? (size_t)put : 0;
    }
    return fdatasync(file) == 0;
}

/* A disk may be slow: another thread waits for it, so that calls are answered meanwhile. */
static struct {
    pthread_mutex_t lock;
    pthread_cond_t turn;
    int file, running;
    rt_kept next;
    uint64_t given, done, failed; /* how many writes were started and finished, and the last one that failed */
} keeper = {.lock = PTHREAD_MUTEX_INITIALIZER, .turn = PTHREAD_COND_INITIALIZER};

static void *keep(void *nothing) {
    static rt_kept writing;
    pthread_mutex_lock(&keeper.lock);
    keeper.running = 1;
    for (;;) {
        pthread_cond_broadcast(&keeper.turn);
        while (keeper.done == keeper.given) pthread_cond_wait(&keeper.turn, &keeper.lock);
        uint64_t number = keeper.given;
        writing.turn = keeper.done == 0 ? keeper.next.turn : writing.turn;
        uint64_t turn = writing.turn;
        writing = keeper.next;
        writing.turn = turn;
        pthread_mutex_unlock(&keeper.lock);
        int fine = write_kept(keeper.file, &writing);
        pthread_mutex_lock(&keeper.lock);
        keeper.done = number;
        if (!fine) keeper.failed = number;
    }
    return nothing;
}

/* Start a write; wait for it if required. False if it failed. */
static int give(const rt_kept *kept, int must) {
    pthread_mutex_lock(&keeper.lock);
    keeper.next = *kept;
    uint64_t number = ++keeper.given;
    pthread_cond_broadcast(&keeper.turn);
    while (must && keeper.done < number) pthread_cond_wait(&keeper.turn, &keeper.lock);
    int fine = !must || keeper.failed < number;
    pthread_mutex_unlock(&keeper.lock);
    return fine;
}

static int start_keeper(int file) {
    pthread_t thread;
    keeper.file = file;
    if (pthread_create(&thread, NULL, keep, NULL) != 0) return 0;
    pthread_mutex_lock(&keeper.lock);
    while (!keeper.running) pthread_cond_wait(&keeper.turn, &keeper.lock);
    pthread_mutex_unlock(&keeper.lock);
    return 1;
}

/* The newer intact slot; or a beginning, if the file says that it has no state, or was half written after that. */
static rt_kept *read_kept(int file) {
    off_t size = 0;
    rt_kept_first first;
    rt_kept *newer = NULL;
    for (int slot = 0; slot < 2; slot++) {
        ssize_t got = pread(file, &slots[slot], sizeof *slots, (off_t)(slot * (off_t)sizeof *slots));
        size += got > 0 ? got : 0;
        if (got == (ssize_t)sizeof *slots && rt_is_whole_kept(&slots[slot]) && (newer == NULL || slots[slot].turn > newer->turn))
            newer = &slots[slot];
    }
    if (newer == NULL && size < (off_t)(2 * sizeof *slots) && pread(file, &first, sizeof first, 0) == (ssize_t)sizeof first &&
        rt_first_kept(&first, &slots[0]))
        newer = &slots[0];
    if (newer != NULL) rt_upgrade_kept(newer);
    return newer;
}

static int64_t own_time_us(clockid_t clock) {
    struct timespec now;
    /* monotonic time continues while the machine is suspended, as the runtime's does (adapters/clock.py) */
    clock_gettime(clock == CLOCK_MONOTONIC ? CLOCK_BOOTTIME : clock, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

/* The machine's clock, with the error reported by the kernel: `kernel_error_us` of adapters/utc.py. */
static rt_now machine_now(void) {
    struct timex asked;
    rt_now now = {own_time_us(CLOCK_MONOTONIC), own_time_us(CLOCK_REALTIME), RT_UTC_UNKNOWN_US};
    memset(&asked, 0, sizeof asked); /* no mode: reads only */
    long state = syscall(SYS_adjtimex, &asked);
    if (state >= 0 && state != TIME_ERROR && (asked.status & STA_UNSYNC) == 0 && asked.maxerror >= 0) now.utc_error_us = asked.maxerror;
    return now;
}

static int digit(uint8_t sign) {
    if (sign >= '0' && sign <= '9') return sign - '0';
    sign |= 0x20;
    return sign >= 'a' && sign <= 'f' ? sign - 'a' + 10 : -1;
}

/* The number of octets in pairs of digits, with spaces between them at most; 0 for anything else, and for more than `most`. */
static uint32_t from_hex(const uint8_t *text, size_t size, uint8_t *into, uint32_t most) {
    uint32_t found = 0;
    for (size_t at = 0; at < size; at++) {
        if (text[at] == ' ' || (text[at] >= '\t' && text[at] <= '\r')) continue;
        int high = digit(text[at]), low = at + 1 < size ? digit(text[at + 1]) : -1;
        if (high < 0 || low < 0 || found == most) return 0;
        into[found++] = (uint8_t)(high << 4 | low);
        at++;
    }
    return found;
}

/* A key in a file: 32 octets or 64 hexadecimal digits, not all 0, as in `read_link_key` of adapters/store/signing.py. */
static int read_key(int file, uint8_t key[RT_KEY_BYTES]) {
    uint8_t data[1024], any = 0;
    size_t size = read_all(file, data, sizeof data);
    uint32_t found = RT_KEY_BYTES;
    if (size == RT_KEY_BYTES) memcpy(key, data, RT_KEY_BYTES);
    else found = from_hex(data, size, key, RT_KEY_BYTES);
    rt_wipe(data, sizeof data);
    for (int octet = 0; octet < RT_KEY_BYTES; octet++) any |= key[octet];
    return found == RT_KEY_BYTES && any != 0;
}

/* Parameters in a file; `*listed` is NULL without a file. 0 for a file that lists none. */
static int read_writes(int file, rt_preparation *into, const rt_preparation **listed) {
    static uint8_t data[RT_MAX_PREPARATION];
    *listed = NULL;
    if (file < 0) return 1;
    *listed = into;
    return rt_read_preparation((rt_bytes){data, (uint32_t)read_all(file, data, sizeof data)}, into);
}

static int greet(const options *given, uint32_t measures, const rt_setup *setup) {
    uint8_t greeting[RT_GREETING_BYTES];
    rt_greet(setup, measures, !given->paced, greeting);
    return send(given->socket, greeting, sizeof greeting, MSG_NOSIGNAL) == sizeof greeting;
}

static const char MODE[] = "process";

/* What of this program can be measured from inside: its file, as it was started. */
static int measure_code(uint8_t digest[RT_DIGEST_BYTES]) {
    uint8_t block[4096];
    rt_sha256 hash;
    ssize_t got;
    int file = open("/proc/self/exe", O_RDONLY | O_CLOEXEC);
    if (file < 0) return 0;
    rt_sha256_begin(&hash);
    while ((got = read(file, block, sizeof block)) > 0) rt_sha256_add(&hash, (rt_bytes){block, (uint32_t)got});
    close(file);
    rt_sha256_end(&hash, digest);
    return got == 0;
}

/* Everything before the first message. */
static int begin(options *given, rt_keys *keys, uint32_t *measures, rt_setup *setup) {
    static uint8_t root[1 << 20];
    if (given->folder != NULL) {
        int code = start_timer(given->socket) ? open_folder(given) : IO;
        if (code != FINE) return code;
    }
    rt_kept *kept = read_kept(given->kept);
    if (keys == NULL || getrandom(keys->session, sizeof keys->session, 0) != sizeof keys->session)
        return IO;
    if (kept == NULL)
        return DAMAGED;
    rt_bytes root_bytes = {root, (uint32_t)read_all(given->root, root, sizeof root)};
    if (given->link_key >= 0 && !read_key(given->link_key, keys->link))
        return NO_KEY;
    if (given->boundary_key >= 0 && !read_key(given->boundary_key, keys->boundary))
        return USAGE;
    if (given->log_key >= 0 && !read_key(given->log_key, keys->log))
        return USAGE;
    static rt_preparation settings, owed;
    const rt_preparation *meant, *left;
    if (!read_writes(given->settings, &settings, &meant) || !read_writes(given->owed, &owed, &left))
        return USAGE;
    uint8_t own[RT_KEY_BYTES];
    if (given->boundary_key >= 0) rt_ed25519_public(keys->boundary, own);
    if (!rt_kept_is_of(kept, given->boundary_key >= 0 ? own : NULL)) return DAMAGED;
    uint8_t code[RT_DIGEST_BYTES];
    if (!measure_code(code))
        return IO;
    kept->restarts++;
    if (!write_kept(given->kept, kept))
        return IO;
    if (!start_keeper(given->kept))
        return IO;
    if (given->folder != NULL && rt_is_anothers(given->socket))
        *measures |= RT_OWN_USER;
    *measures |= rt_isolate(given->user, given->group);
    static uint8_t pin[RT_KEY_BYTES];
    const uint32_t pinned =
        given->pin == NULL ? 0 : from_hex((const uint8_t *)given->pin, strlen(given->pin), pin, sizeof pin);
    if (given->folder != NULL && pinned == 0)
        return UNTRUSTED; /* without a pin any development root would be accepted */
    *setup = (rt_setup){
        keys, kept, root_bytes, {pin, pinned},
        {(const uint8_t *)given->vehicle, (uint32_t)strlen(given->vehicle)}, given->link_key >= 0, given->boundary_key >= 0,
        given->log_key >= 0, meant, left, machine_now(), given->utc_error,
        {{(const uint8_t *)MODE, sizeof MODE - 1}, {0}, *measures & RT_NOT_DUMPABLE ? RT_DEBUG_DISABLED : RT_DEBUG_ENABLED, *measures}};
    memcpy(setup->home.code, code, sizeof code);
    return rt_boundary_begin(&boundary, setup) == NULL ? FINE : UNTRUSTED;
}

int main(int count, char **words) {
    options given;
    rt_setup setup = {0};
    uint32_t measures = 0;
    const int runtime = getppid();
    if (!read_options(count, words, &given))
        return USAGE;
    rt_keys *keys = rt_key_memory(sizeof *keys, &measures);
    if (given.measures) {
        measures |= rt_isolate(given.user, given.group);
        return greet(&given, measures, &setup) ? FINE : IO;
    }
    int code = begin(&given, keys, &measures, &setup);
    if (code != FINE) {
        const uint8_t why = (uint8_t)code;
        (void)!send(given.socket, &why, sizeof why, MSG_NOSIGNAL);
        return code;
    }
    if (!give_time(CALL_S) || !greet(&given, measures, &setup))
        return IO;
    rt_kept *kept = boundary.kept;
    int64_t kept_us = own_time_us(CLOCK_MONOTONIC);
    bool flies = false;
    for (;;) {
        ssize_t size = recv(given.socket, call, sizeof call, 0);
        if (!give_time(size > 0 && call[0] == RT_CALL_LOAD ? BEGINNING_S : CALL_S))
            return IO;
        if (size < 0 && (errno == EINTR || errno == EAGAIN))
            continue;
        if (size <= 0) {
            rt_gather_link(&boundary, 0); /* an orderly end keeps the exact figures */
            (void)rt_give_back(&boundary);
            return give(kept, 1) && size == 0 ? FINE : IO;
        }
        int64_t now_us = own_time_us(CLOCK_MONOTONIC);
        if (call[0] == RT_CALL_TIME && !given.paced && boundary.clock.source == RT_UTC_UNKNOWN) { /* it may be synchronised by now */
            const rt_now machine = machine_now();
            rt_clock_look(&boundary.clock, &machine);
        }
        uint32_t answered = rt_answer(&boundary, (rt_bytes){call, (uint32_t)size}, given.paced ? -1 : now_us, result);
        /* state that must survive this process is on the disk before the answer is sent */
        if (rt_is_to_be_kept(&boundary, now_us, kept_us)) {
            bool must = boundary.to_keep;
            rt_gather_link(&boundary, RT_RESERVE);
            if (!give(kept, must))
                answered = rt_take_back(&boundary, result);
            boundary.to_keep = false;
            kept_us = now_us;
        }
        if (given.folder == NULL && !flies && rt_may_fly(&boundary)) {
            flies = true; /* nothing is released any more, and a restart must not find the vehicle locked by this process */
            if (!rt_end_with(runtime))
                return IO;
        }
        if (!give_time(CALL_S))
            return IO;
        /* if the peer is gone, the next `recv` reports it */
        if (send(given.socket, result, answered, MSG_NOSIGNAL) != (ssize_t)answered && errno != EPIPE && errno != ECONNRESET)
            return IO;
    }
}
