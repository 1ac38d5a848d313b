#define _GNU_SOURCE 1 /* for RTLD_NEXT and dl_iterate_phdr */
#include "failing_heap.h"

#include <dlfcn.h>
#include <errno.h>
#include <link.h>
#include <stddef.h>
#include <string.h>

#if defined(__SANITIZE_ADDRESS__) || !defined(__GLIBC__)

void heap_start_failing(int64_t n, bool is_for_good)
{
    (void)n, (void)is_for_good;
}
int64_t heap_stop_failing(void)
{
    return 0;
}
void heap_pause(void) {}
void heap_resume(void) {}
bool heap_can_fail(void)
{
    return false;
}

#else

/* Allocators of the GNU C library under their internal names. */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *block, size_t size);
void *__libc_memalign(size_t alignment, size_t size);

static _Thread_local struct {
    bool is_armed, is_for_good;
    int pauses;
    int64_t count, fails_at;
} heap;

/* Address ranges of the code of libgomp, libomp and the loader. Allocations called from there neither count nor
 * fail. */
enum { MOST_RANGES = 16 };
static struct {
    uintptr_t begin, end;
} spared[MOST_RANGES];
static int spared_count;

static int record_library_range(struct dl_phdr_info *info, size_t size, void *context)
{
    (void)size, (void)context;
    const bool is_openmp = strstr(info->dlpi_name, "/libgomp") || strstr(info->dlpi_name, "/libomp");
    if (!is_openmp && !strstr(info->dlpi_name, "/ld-linux")) return 0;
    for (int i = 0; i < info->dlpi_phnum && spared_count < MOST_RANGES; i++) {
        const ElfW(Phdr) *segment = &info->dlpi_phdr[i];
        if (segment->p_type != PT_LOAD || !(segment->p_flags & PF_X)) continue;
        spared[spared_count].begin = info->dlpi_addr + segment->p_vaddr;
        spared[spared_count].end = spared[spared_count].begin + segment->p_memsz;
        spared_count++;
    }
    return 0;
}

static bool is_caller_exempt(const void *caller)
{
    for (int i = 0; i < spared_count; i++)
        if ((uintptr_t)caller >= spared[i].begin && (uintptr_t)caller < spared[i].end) return true;
    return false;
}

static bool should_allocation_fail(const void *caller)
{
    if (!heap.is_armed || heap.pauses || is_caller_exempt(caller)) return false;
    heap.count++;
    if (heap.count != heap.fails_at && !(heap.is_for_good && heap.count > heap.fails_at)) return false;
    errno = ENOMEM;
    return true;
}

void heap_start_failing(int64_t n, bool is_for_good)
{
    if (!spared_count) dl_iterate_phdr(record_library_range, NULL);
    heap.is_for_good = is_for_good;
    heap.count = 0;
    heap.fails_at = n;
    heap.is_armed = true;
}

int64_t heap_stop_failing(void)
{
    heap.is_armed = false;
    return heap.count;
}

void heap_pause(void)
{
    heap.pauses++;
}
void heap_resume(void)
{
    heap.pauses--;
}
bool heap_can_fail(void)
{
    return true;
}

/* ---- replacements of the C library's functions ---------------------------------------------------------------- */

#define CALLER __builtin_return_address(0)

void *malloc(size_t size)
{
    return should_allocation_fail(CALLER) ? NULL : __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    return should_allocation_fail(CALLER) ? NULL : __libc_calloc(count, size);
}

void *realloc(void *block, size_t size)
{
    return size && should_allocation_fail(CALLER) ? NULL : __libc_realloc(block, size);
}

void *memalign(size_t alignment, size_t size)
{
    return should_allocation_fail(CALLER) ? NULL : __libc_memalign(alignment, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    return should_allocation_fail(CALLER) ? NULL : __libc_memalign(alignment, size);
}

int posix_memalign(void **out, size_t alignment, size_t size)
{
    void *block = should_allocation_fail(CALLER) ? NULL : __libc_memalign(alignment, size);
    if (!block) return ENOMEM;
    *out = block;
    return 0;
}

/* Pauses the heap during dlopen(): constructors of loaded libraries may end the process if an allocation fails. */
void *dlopen(const char *path, int flags)
{
    void *(*next)(const char *, int);
    heap_pause();
    void *symbol = dlsym(RTLD_NEXT, "dlopen");
    memcpy(&next, &symbol, sizeof next);
    void *handle = next(path, flags);
    heap_resume();
    return handle;
}

#endif
