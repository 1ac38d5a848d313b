#define _GNU_SOURCE 1 /* makes fcntl.h declare O_PATH */
#include "file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/random.h>
#include <unistd.h>

#include "memory.h"

/* ---- descriptions of failures ---------------------------------------------------------------------------------- */

static bool fail_with_errno(file_failure *failure, int code)
{
    *failure = (file_failure){.is_missing = code == ENOENT, .is_out_of_memory = code == ENOMEM};
    snprintf(failure->reason, sizeof failure->reason, "%s", strerror(code));
    return false;
}

static bool fail_for_file_type(file_failure *failure, mode_t mode)
{
    const char *kind = "a device";
    if (S_ISDIR(mode)) kind = "a directory";
    if (S_ISFIFO(mode)) kind = "a named pipe (FIFO)";
    if (S_ISSOCK(mode)) kind = "a socket";
    *failure = (file_failure){.is_missing = false};
    snprintf(failure->reason, sizeof failure->reason, "it is %s, expected a regular file", kind);
    return false;
}

static bool fail_for_file_size(file_failure *failure, size_t limit)
{
    *failure = (file_failure){.is_missing = false};
    snprintf(failure->reason, sizeof failure->reason, "it has more than %zu bytes, the most that is read", limit);
    return false;
}

/* ---- opening regular files ------------------------------------------------------------------------------------- */

/* Gets the status (struct stat) of the object at the path. Fails if the object is not a regular file. */
static bool find_file_status(const char *path, int flags, struct stat *stamp, file_failure *failure)
{
    const int look_flags = flags & O_NOFOLLOW ? AT_SYMLINK_NOFOLLOW : 0;
    if (fstatat(AT_FDCWD, path, stamp, look_flags) != 0) return fail_with_errno(failure, errno);
    return S_ISREG(stamp->st_mode) || fail_for_file_type(failure, stamp->st_mode);
}

/* Opens a regular file and returns its descriptor, or -1 on a failure. The file type is checked before opening,
 * because opening a device may have effects. Another file may replace the checked one before it is opened, so
 * O_NONBLOCK is set and the type is checked again. */
static int open_regular(const char *path, int flags, struct stat *stamp, file_failure *failure)
{
    if (!find_file_status(path, flags, stamp, failure)) return -1;
    const int file = open(path, flags | O_NONBLOCK | O_CLOEXEC);
    if (file < 0) {
        fail_with_errno(failure, errno);
        return -1;
    }
    const bool is_known = fstat(file, stamp) == 0;
    if (is_known && S_ISREG(stamp->st_mode)) return file;
    if (is_known)
        fail_for_file_type(failure, stamp->st_mode);
    else
        fail_with_errno(failure, errno);
    close(file);
    return -1;
}

static bool is_link(const char *path)
{
    struct stat found;
    return lstat(path, &found) == 0 && S_ISLNK(found.st_mode);
}

bool file_exists(const char *path)
{
    return access(path, F_OK) == 0;
}

/* ---- reading --------------------------------------------------------------------------------------------------- */

/* Reads to the end of the file, which may grow up to `limit` bytes while it is read. */
static bool read_all(int file, size_t limit, file_content *out, file_failure *failure)
{
    size_t capacity = (size_t)out->stamp.st_size + 1;
    while (true) {
        if (out->size > limit) return fail_for_file_size(failure, limit);
        if (!out->text || out->size == capacity) {
            if (out->text) capacity += capacity / 2 + 4096;
            char *more = base_realloc(out->text, capacity + 1);
            if (!more) return fail_with_errno(failure, ENOMEM);
            out->text = more;
        }
        const ssize_t count = read(file, out->text + out->size, capacity - out->size);
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) return fail_with_errno(failure, errno);
        out->text[out->size += (size_t)count] = '\0';
        if (count == 0) return true;
    }
}

bool file_read(const char *path, size_t limit, file_content *out, file_failure *failure)
{
    *out = (file_content){0};
    const int file = open_regular(path, O_RDONLY, &out->stamp, failure);
    if (file < 0) return false;
    const bool is_small = (uintmax_t)out->stamp.st_size <= limit;
    const bool is_read = is_small ? read_all(file, limit, out, failure) : fail_for_file_size(failure, limit);
    close(file);
    if (is_read) return true;
    base_free(out->text);
    out->text = NULL;
    out->size = 0;
    return false;
}

bool file_read_written_by_library(const char *path, size_t limit, file_content *out, file_failure *failure)
{
    if (file_read(path, limit, out, failure)) return true;
    failure->is_missing = failure->is_missing || (!S_ISREG(out->stamp.st_mode) && is_link(path));
    return false;
}

/* ---- writing --------------------------------------------------------------------------------------------------- */

static bool write_all(int file, const char *bytes, size_t size)
{
    while (size) {
        const ssize_t count = write(file, bytes, size);
        if (count < 0 && errno == EINTR) continue;
        if (count == 0) errno = EIO;
        if (count <= 0) return false;
        bytes += count;
        size -= (size_t)count;
    }
    return true;
}

bool file_append(const char *path, const char *bytes, size_t size, file_failure *failure)
{
    struct stat before;
    const int file = open_regular(path, O_WRONLY | O_APPEND | O_NOFOLLOW, &before, failure);
    if (file < 0) {
        failure->is_missing = failure->is_missing || is_link(path);
        return false;
    }
    bool is_written = write_all(file, bytes, size);
    int code = errno;
    if (!is_written && ftruncate(file, before.st_size) != 0) code = errno;
    if (close(file) != 0 && is_written) {
        is_written = false;
        code = errno;
    }
    return is_written || fail_with_errno(failure, code);
}

static bool make_folders(char *path)
{
    for (char *end = strchr(path + 1, '/'); end; end = strchr(end + 1, '/')) {
        *end = '\0';
        const bool is_made = mkdir(path, 0777) == 0 || errno == EEXIST || file_exists(path);
        *end = '/';
        if (!is_made) return false;
    }
    return true;
}

/* The folder and the file name of a path. The string `name` is a part of the memory at `path`. */
typedef struct folder_and_name {
    char *path;
    const char *name;
    int folder; /* descriptor of the folder; -1 until it is opened */
} folder_and_name;

/* Returns false if the file is of a kind that a rename must not replace, such as a folder, pipe or device. */
static bool check_file_type(const folder_and_name *target, file_failure *failure)
{
    struct stat found;
    if (*target->name == '\0') return fail_for_file_type(failure, S_IFDIR);
    if (fstatat(target->folder, target->name, &found, AT_SYMLINK_NOFOLLOW) != 0)
        return errno == ENOENT || fail_with_errno(failure, errno);
    return S_ISREG(found.st_mode) || S_ISLNK(found.st_mode) || fail_for_file_type(failure, found.st_mode);
}

static bool open_parent_folder(const char *path, folder_and_name *target, file_failure *failure)
{
    target->folder = -1;
    target->path = base_strdup(path);
    if (!target->path) return fail_with_errno(failure, ENOMEM);
    char *slash = strrchr(target->path, '/');
    target->name = slash ? slash + 1 : target->path;
    if (slash && !make_folders(target->path)) return fail_with_errno(failure, errno);
    if (slash) *slash = '\0';
    const char *folder = !slash ? "." : slash == target->path ? "/" : target->path;
    target->folder = open(folder, O_PATH | O_DIRECTORY | O_CLOEXEC);
    return (target->folder >= 0 || fail_with_errno(failure, errno)) && check_file_type(target, failure);
}

enum { TEMPORARY_NAME = 40, TRIES = 8 };

/* Writes the bytes to a new file with the name `temporary`, and renames this file to the target's name. */
static bool try_to_replace(const folder_and_name *target, const char *temporary, const char *bytes, size_t size)
{
    const int file = openat(target->folder, temporary, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (file < 0) return false;
    /* The file is locked because other writers of pictures delete unlocked temporary files as remains of killed runs */
    flock(file, LOCK_EX | LOCK_NB);
    bool is_written = write_all(file, bytes, size);
    int code = errno;
    if (close(file) != 0 && is_written) {
        is_written = false;
        code = errno;
    }
    if (is_written && renameat(target->folder, temporary, target->folder, target->name) == 0) return true;
    if (is_written) code = errno;
    unlinkat(target->folder, temporary, 0);
    errno = code;
    return false;
}

/* Replaces the file. Tries again if another process has deleted the temporary file. This happens if that process has
 * taken it for the remains of a killed run. */
static bool replace_file(const folder_and_name *target, const char *bytes, size_t size, file_failure *failure)
{
    for (int i = 0; i < TRIES; i++) {
        uint64_t random;
        char temporary[TEMPORARY_NAME];
        if (getrandom(&random, sizeof random, GRND_NONBLOCK) != sizeof random) return fail_with_errno(failure, errno);
        snprintf(temporary, sizeof temporary, ".insitu-%016llx.part", (unsigned long long)random);
        if (try_to_replace(target, temporary, bytes, size)) return true;
        if (errno != ENOENT && errno != EEXIST) break;
    }
    return fail_with_errno(failure, errno);
}

bool file_replace(const char *path, const char *bytes, size_t size, file_failure *failure)
{
    folder_and_name target;
    const bool is_replaced = open_parent_folder(path, &target, failure) && replace_file(&target, bytes, size, failure);
    if (target.folder >= 0) close(target.folder);
    base_free(target.path);
    return is_replaced;
}
