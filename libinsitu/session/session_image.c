/* The image library is looked for where a person would put it: on the loader's own path (beside libinsitu, by its
 * RUNPATH), then beside the object this code is in, then in the lib folder next to that one's, which is where it
 * stands for a program in bin that links libinsitu statically. It stays loaded until the process ends: C++ libraries
 * with threads and static objects do not survive being unloaded.
 *
 * Some library behind OpenImageIO starts threads as it is loaded. They sleep, but they would take the simulation's
 * signals and run its handlers; so they are born with every signal blocked. */
#define _GNU_SOURCE 1 /* dladdr */
#include "session_image.h"

#include <dlfcn.h>
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

static const char library[] = "libinsitu_image.so";
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static insitu_image_write_function *loaded_writer;

static void *open_library(const char *path, char *why, size_t size)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    void *handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (handle) return handle;
    const char *reason = dlerror();
    const bool is_absent = strncmp(reason, path, strlen(path)) == 0; /* else it is there, but not what it needs */
    if (!*why || !is_absent) snprintf(why, size, "%s", reason);
    return NULL;
}

/* folder: between the object's own folder and the library's name. */
static void *open_beside(const char *folder, char *why, size_t size)
{
    Dl_info object;
    if (!dladdr((const void *)library, &object) || !object.dli_fname) return NULL;
    const char *slash = strrchr(object.dli_fname, '/');
    if (!slash) return NULL;
    char path[4096];
    const int length =
        snprintf(path, sizeof path, "%.*s/%s%s", (int)(slash - object.dli_fname), object.dli_fname, folder, library);
    return length > 0 && (size_t)length < sizeof path ? open_library(path, why, size) : NULL;
}

static insitu_status load(base_error *error)
{
    char why[400] = "";
    void *handle = open_library(library, why, sizeof why);
    if (!handle) handle = open_beside("", why, sizeof why);
    if (!handle) handle = open_beside("../lib/", why, sizeof why);
    if (!handle) {
        return base_fail(
            error, INSITU_ERROR_IO,
            "%s cannot be loaded, expected beside libinsitu or on LD_LIBRARY_PATH; no image can be written: %s",
            library, why);
    }
    void *symbol = dlsym(handle, "insitu_image_write");
    if (!symbol) {
        dlclose(handle);
        return base_fail(error, INSITU_ERROR_IO, "%s has no insitu_image_write, expected the one of this version",
                         library);
    }
    memcpy(&loaded_writer, &symbol, sizeof symbol);
    return INSITU_OK;
}

insitu_status session_write_image(const insitu_image *image, insitu_image_format format, const char *path,
                                  base_error *error)
{
    pthread_mutex_lock(&lock);
    const insitu_status status = loaded_writer ? INSITU_OK : load(error);
    insitu_image_write_function *write = loaded_writer;
    pthread_mutex_unlock(&lock);
    if (status != INSITU_OK) return status;

    char message[sizeof error->message / 2] = "";
    const insitu_status written = write(image, format, path, message, sizeof message);
    return written == INSITU_OK ? INSITU_OK : base_fail(error, written, "%s", message);
}
