/* All files that the library itself reads, replaces and appends to. Only regular files are opened, so that no call
 * waits for a pipe or reads a device without end. Pictures have the same rules (adaptors/image/picture_file.cpp): a
 * file is replaced by a new one that takes its name, which no reader sees in part and which follows no symbolic link.
 */
#ifndef BASE_FILE_H
#define BASE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/stat.h>

/* Why a call failed. */
typedef struct file_failure {
    bool is_missing; /* there is no such file, or what is there may not be used and file_replace() would replace it */
    bool is_memory;
    char reason[128];
} file_failure;

typedef struct file_content {
    char *text; /* size bytes and a NUL, from base_alloc() */
    size_t size;
    struct stat stamp; /* state of the file when it was opened */
} file_content;

/* Read a file that the user names, of at most limit bytes. Symbolic links are followed. False: *out->text is NULL;
 * out->stamp is that of the file if there is one. */
bool file_read(const char *path, size_t limit, file_content *out, file_failure *failure);

/* As file_read(), for a file that the library writes and continues. A link that leads to no regular file is missing,
 * since file_replace() replaces the link, whatever it leads to. */
bool file_read_own(const char *path, size_t limit, file_content *out, file_failure *failure);

/* Replace a file by these bytes, and make its folders if they are missing. A link is replaced, and what it leads to
 * stays as it is; a folder, pipe, socket or device is an error. False: the old file is as it was. */
bool file_replace(const char *path, const char *bytes, size_t size, file_failure *failure);

/* Append to a file. Where there is none, or a link, the failure is_missing. False: the file is as it was, unless its
 * file system cannot even cut off what was written in part. */
bool file_append(const char *path, const char *bytes, size_t size, file_failure *failure);

/* True if the path leads to anything. */
bool file_exists(const char *path);

#endif
