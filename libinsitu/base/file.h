/* Reads, replaces and appends to files. The library itself accesses files only through these functions. They open only
 * regular files, so that no call blocks on a pipe or reads a device without end. A new file replaces the old one by
 * renaming, so that no reader sees a partial file and no symbolic link is followed. Pictures are written by the same
 * rules (adaptors/image/picture_file.cpp). */
#ifndef BASE_FILE_H
#define BASE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/stat.h>

/* The reason why a call failed. */
typedef struct file_failure {
    /* set if there is no such file; also set if the path is a symbolic link that must not be read or extended, but that
     * file_replace() may replace */
    bool is_missing;
    bool is_out_of_memory; /* set if memory ran out */
    char reason[128];      /* text for messages, such as "Permission denied" */
} file_failure;

typedef struct file_content {
    char *text; /* the file's `size` bytes and a NUL, allocated with base_alloc() */
    size_t size;
    struct stat stamp; /* result of fstat() when the file was opened */
} file_content;

/* Reads a file that the user names, of at most limit bytes. Symbolic links are followed. Returns false on a failure;
 * out->text is then NULL, and out->stamp is the result of stat() for the path if something exists there. */
bool file_read(const char *path, size_t limit, file_content *out, file_failure *failure);

/* Reads a file that the library itself has written and will extend, with the rules of file_read() except for symbolic
 * links: a link that does not lead to a regular file counts as a missing file, because file_replace() replaces the link
 * itself. */
bool file_read_written_by_library(const char *path, size_t limit, file_content *out, file_failure *failure);

/* Replaces a file by these bytes, and creates missing folders. If the path is a link, the link is replaced and its
 * target remains unchanged; a folder, pipe, socket or device is an error. Returns false on a failure: the old file is
 * unchanged. */
bool file_replace(const char *path, const char *bytes, size_t size, file_failure *failure);

/* Appends to a file. If there is no file, or if the path is a link, the failure has is_missing set. Returns false on a
 * failure; the file is then unchanged, unless some bytes were written and the file system fails to cut them off. */
bool file_append(const char *path, const char *bytes, size_t size, file_failure *failure);

/* Returns whether anything exists at the path: a file, a folder or another object. Symbolic links are followed. */
bool file_exists(const char *path);

#endif
