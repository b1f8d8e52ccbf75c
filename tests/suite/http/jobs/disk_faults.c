// A disk that fails or is slow, for files under FAULT_DIR: preloaded into a server, it looks into the file FAULT_MODE
// before each call. "ro": writes fail with EROFS; "full": with ENOSPC; "slow": syncs take two seconds.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static char mode(void) {
    const char *path = getenv("FAULT_MODE");
    int file = path ? (int)syscall(SYS_openat, AT_FDCWD, path, O_RDONLY) : -1;
    char first = 'o';
    if (file >= 0) {
        if (syscall(SYS_read, file, &first, 1) != 1) first = 'o';
        syscall(SYS_close, file);
    }
    return first;
}

static int is_under(const char *path) {
    const char *folder = getenv("FAULT_DIR");
    return folder && path && strncmp(path, folder, strlen(folder)) == 0;
}

static int is_ours(int file) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    long length = syscall(SYS_readlinkat, AT_FDCWD, link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return is_under(path);
}

// The error of a write at this moment; 0: none.
static int fault(void) {
    char now = mode();
    return now == 'r' ? EROFS : now == 'f' ? ENOSPC : 0;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define FAIL_IF(ours) \
    do { \
        int error = (ours) ? fault() : 0; \
        if (error) { errno = error; return -1; } \
    } while (0)

static int sync_slowly(int file, int (*real)(int)) {
    if (is_ours(file)) {
        FAIL_IF(1);
        struct timespec two = {2, 0};
        if (mode() == 's') nanosleep(&two, NULL);
    }
    return real(file);
}

int fsync(int file) { return sync_slowly(file, REAL(fsync)); }
int fdatasync(int file) { return sync_slowly(file, REAL(fdatasync)); }

ssize_t pwrite64(int file, const void *bytes, size_t count, off64_t at) {
    FAIL_IF(is_ours(file));
    return REAL(pwrite64)(file, bytes, count, at);
}

int ftruncate64(int file, off64_t size) {
    FAIL_IF(is_ours(file));
    return REAL(ftruncate64)(file, size);
}

int open64(const char *path, int flags, ...) {
    va_list rest;
    va_start(rest, flags);
    mode_t bits = va_arg(rest, mode_t);
    va_end(rest);
    FAIL_IF((flags & O_ACCMODE) != O_RDONLY && is_under(path));
    return (int)syscall(SYS_openat, AT_FDCWD, path, flags, bits);
}

int rename(const char *from, const char *to) {
    FAIL_IF(is_under(to));
    return REAL(rename)(from, to);
}

int unlink(const char *path) {
    FAIL_IF(is_under(path));
    return REAL(unlink)(path);
}
