/* Loads the image library at run time, by its full path, so that no other library of the same name is used. The library
 * is searched for in the folder of the object that contains this code (libinsitu), and then in the lib folder beside
 * that folder, because a program in bin may link libinsitu statically. If neither folder contains the library, the
 * dynamic loader searches for it, unless LD_LIBRARY_PATH would make it search the working directory. The library stays
 * loaded until the process ends: C++ libraries with threads and static objects cannot be unloaded safely.
 *
 * Some library that OpenImageIO uses starts threads when it is loaded. These threads sleep, but they could receive the
 * simulation's signals and run its handlers. Therefore they are started with all signals blocked. Other libraries end
 * the process if their constructors cannot allocate memory. Therefore nothing is loaded unless enough memory is
 * available. */
#define _GNU_SOURCE 1 /* makes dlfcn.h declare dladdr1() */
#include "session_image.h"

#include <dlfcn.h>
#include <limits.h>
#include <link.h>
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

static const char library[] = "libinsitu_image.so";
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static insitu_image_write_function *loaded_writer;
/* the library's function that draws a picture into a larger one; NULL: the library is not loaded, or its version lacks
 * the function */
static insitu_image_place_function *loaded_placer;
/* the library's function that finds texts which cannot be drawn; NULL: the library is not loaded, or its version lacks
 * the function */
static insitu_image_check_words_function *loaded_checker;

static void *open_library(const char *path, char *why, size_t size)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    void *handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (handle) return handle;
    const char *reason = dlerror();
    const bool is_absent =
        /* if the file itself is missing, the loader's message begins with its path; otherwise a library on which it
         * depends is missing */
        strncmp(reason, path, strlen(path)) == 0;
    if (!*why || !is_absent) snprintf(why, size, "%s", reason);
    return NULL;
}

/* Determines the folder of the object that contains this code, from the path by which the object was loaded. */
static bool find_own_folder(char folder[PATH_MAX])
{
    Dl_info object;
    struct link_map *map = NULL;
    if (!dladdr1((const void *)library, &object, (void **)&map, RTLD_DL_LINKMAP) || !map) return false;
    if (*map->l_name) return dlinfo(map, RTLD_DI_ORIGIN, folder) == 0;
    /* if the name in the link map is empty, the object is the main program */
    const ssize_t length = readlink("/proc/self/exe", folder, PATH_MAX - 1);
    if (length <= 0) return false;
    folder[length] = '\0';
    char *slash = strrchr(folder, '/');
    if (slash) *slash = '\0';
    return slash;
}

static void *open_library_beside(const char *own_folder, const char *between, char *why, size_t size)
{
    char path[PATH_MAX];
    const int length = snprintf(path, sizeof path, "%s/%s%s", own_folder, between, library);
    return length > 0 && (size_t)length < sizeof path ? open_library(path, why, size) : NULL;
}

/* Returns whether LD_LIBRARY_PATH makes the loader search the working directory. This is so if an entry is empty or a
 * relative path: it then refers to the working directory or to a folder below it. */
static bool searches_working_directory(void)
{
    const char *entries = getenv("LD_LIBRARY_PATH");
    if (!entries || !*entries) return false;
    for (const char *entry = entries;; entry++) {
        if (*entry != '/') return true;
        entry += strcspn(entry, ":;");
        if (!*entry) return false;
    }
}

static void *open_library_anywhere(char *why, size_t size)
{
    char folder[PATH_MAX];
    void *handle = NULL;
    if (find_own_folder(folder)) {
        handle = open_library_beside(folder, "", why, size);
        if (!handle) handle = open_library_beside(folder, "../lib/", why, size);
    }
    if (!handle && !searches_working_directory()) handle = open_library(library, why, size);
    return handle;
}

/* Returns whether 512 MiB of address space can be mapped and 128 MiB of it committed. Loading the libraries takes 430
 * MiB of addresses, of which 100 MiB are used. */
static bool has_memory_to_load(void)
{
    const size_t addresses = (size_t)512 << 20, memory = (size_t)128 << 20;
    void *block = mmap(NULL, addresses, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (block == MAP_FAILED) return false;
    const bool has_memory = mprotect(block, memory, PROT_READ | PROT_WRITE) == 0;
    munmap(block, addresses);
    return has_memory;
}

static insitu_status load_library(base_error *error)
{
    char why[400] = "";
    if (!has_memory_to_load())
        return base_fail(error, INSITU_ERROR_MEMORY,
                         "no memory to load %s (512 MiB of addresses); no image can be written", library);
    void *handle = open_library_anywhere(why, sizeof why);
    if (!handle)
        return base_fail(
            error, INSITU_ERROR_IO,
            "%s cannot be loaded, expected beside libinsitu or on LD_LIBRARY_PATH%s; no image can be written: %s",
            library,
            searches_working_directory() ? " (not searched: it has an entry that is not an absolute path)" : "", why);
    void *symbol = dlsym(handle, "insitu_image_write");
    if (!symbol) {
        dlclose(handle);
        return base_fail(error, INSITU_ERROR_IO, "%s has no insitu_image_write, expected the one of this version",
                         library);
    }
    memcpy(&loaded_writer, &symbol, sizeof symbol);
    symbol = dlsym(handle, "insitu_image_place");
    if (symbol) memcpy(&loaded_placer, &symbol, sizeof symbol);
    symbol = dlsym(handle, "insitu_image_check_words");
    if (symbol) memcpy(&loaded_checker, &symbol, sizeof symbol);
    return INSITU_OK;
}

bool session_writes_behind = true;

static insitu_status load_library_once(base_error *error, insitu_image_write_function **writer)
{
    pthread_mutex_lock(&lock);
    const insitu_status status = loaded_writer ? INSITU_OK : load_library(error);
    *writer = loaded_writer;
    pthread_mutex_unlock(&lock);
    return status;
}

double session_load_image_library(void)
{
    insitu_image_write_function *unused;
    struct timespec start, end;
    clock_gettime(CLOCK_MONOTONIC, &start);
    pthread_mutex_lock(&lock);
    const bool is_there = loaded_writer;
    pthread_mutex_unlock(&lock);
    load_library_once(NULL, &unused);
    clock_gettime(CLOCK_MONOTONIC, &end);
    return is_there ? 0 : 1e3 * (double)(end.tv_sec - start.tv_sec) + 1e-6 * (double)(end.tv_nsec - start.tv_nsec);
}

void session_find_text_faults(const insitu_image *image, insitu_word_faults *out)
{
    insitu_image_write_function *unused;
    *out = (insitu_word_faults){.font = ""};
    if (load_library_once(NULL, &unused) == INSITU_OK && loaded_checker && loaded_checker(image, out) != INSITU_OK)
        *out = (insitu_word_faults){.font = ""};
}

insitu_status session_write_image(const insitu_image *image, insitu_image_format format, const char *path,
                                  base_error *error)
{
    insitu_image_write_function *write;
    const insitu_status status = load_library_once(error, &write);
    if (status != INSITU_OK) return status;

    char message[sizeof error->message / 2] = "";
    const insitu_status written = write(image, format, path, message, sizeof message);
    if (written != INSITU_OK) return base_fail(error, written, "%s", message);
    return INSITU_OK;
}

insitu_status session_place_image(const insitu_image *image, const insitu_place *place, base_error *error)
{
    insitu_image_write_function *write;
    const insitu_status status = load_library_once(error, &write);
    if (status != INSITU_OK) return status;
    if (!loaded_placer)
        return base_fail(error, INSITU_ERROR_IO, "%s has no insitu_image_place, expected the one of this version",
                         library);
    char message[sizeof error->message / 2] = "";
    const insitu_status placed = loaded_placer(image, place, message, sizeof message);
    return placed ? base_fail(error, placed, "%s", message) : INSITU_OK;
}
