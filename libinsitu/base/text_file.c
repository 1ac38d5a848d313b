#include "text_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "memory.h"

bool c_numbers_begin(c_numbers *numbers)
{
    numbers->own = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0);
    if (numbers->own) numbers->before = uselocale(numbers->own);
    return numbers->own != (locale_t)0;
}

void c_numbers_end(c_numbers *numbers)
{
    uselocale(numbers->before);
    freelocale(numbers->own);
}

static FILE *open_stream(int number, const char *mode)
{
    FILE *file = number < 0 ? NULL : fdopen(number, mode);
    if (!file && number >= 0) {
        close(number);
        errno = ENOMEM;
    }
    return file;
}

static bool write_file(const char *path, const char *temporary, text_writer *write, const void *what)
{
    unlink(temporary);
    FILE *file = open_stream(open(temporary, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666), "w");
    if (!file) return false;
    write(file, what);
    const bool is_written = !ferror(file);
    return fclose(file) == 0 && is_written && rename(temporary, path) == 0;
}

bool text_file_replace(const char *path, text_writer *write, const void *what)
{
    c_numbers numbers;
    const size_t size = strlen(path) + 24; /* room for "." and the number of a process */
    char *temporary = base_alloc(size);
    if (!temporary || !c_numbers_begin(&numbers)) {
        base_free(temporary);
        errno = ENOMEM;
        return false;
    }
    snprintf(temporary, size, "%s.%ld", path, (long)getpid());
    const bool is_written = write_file(path, temporary, write, what);
    const int reason = errno;
    c_numbers_end(&numbers);
    if (!is_written) unlink(temporary);
    base_free(temporary);
    errno = reason;
    return is_written;
}

bool text_file_make_folders(const char *path)
{
    char *folder = base_strdup(path);
    bool is_made = folder != NULL;
    if (!folder) errno = ENOMEM;
    for (char *end = folder ? strchr(folder + 1, '/') : NULL; end && is_made; end = strchr(end + 1, '/')) {
        *end = '\0';
        is_made = mkdir(folder, 0777) == 0 || errno == EEXIST;
        *end = '/';
    }
    const int reason = errno;
    base_free(folder);
    errno = reason;
    return is_made;
}

FILE *text_file_open(const char *path)
{
    return open_stream(open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC), "r");
}

/* Reads until the end or an error; false where memory runs out. */
static bool read_stream(FILE *file, char **text)
{
    size_t size = 0, capacity = 0;
    do {
        if (size + 1 >= capacity) {
            capacity = 2 * capacity + 4096;
            char *more = base_realloc(*text, capacity);
            if (!more) return false;
            *text = more;
        }
        size += fread(*text + size, 1, capacity - 1 - size, file);
    } while (!feof(file) && !ferror(file));
    (*text)[size] = '\0';
    return true;
}

bool text_file_read(const char *path, char **text)
{
    *text = NULL;
    FILE *file = text_file_open(path);
    if (!file) return false;
    errno = EIO; /* where fread() gives no reason */
    const bool has_memory = read_stream(file, text), is_read = has_memory && !ferror(file);
    const int reason = has_memory ? errno : ENOMEM;
    fclose(file);
    if (is_read) return true;
    base_free(*text);
    *text = NULL;
    errno = reason;
    return false;
}

size_t text_keep_below(char *text, long long number)
{
    size_t kept = 0;
    for (char *line = text, *end; (end = strchr(line, '\n')) != NULL; line = end + 1) {
        const size_t size = (size_t)(end + 1 - line);
        if (strtoll(line, NULL, 10) >= number) continue;
        memmove(text + kept, line, size);
        kept += size;
    }
    return kept;
}
