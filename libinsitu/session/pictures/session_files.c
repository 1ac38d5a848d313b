#include "session_files.h"

#include <time.h>

#include "memory.h"
#include "session_deep.h"
#include "session_image.h"
#include "session_news.h"

int64_t session_files_bytes(const session_files *files)
{
    const int64_t frame = (int64_t)files->frame.width * files->frame.height * 4 * (int64_t)sizeof(float);
    return (int64_t)files->memory.bytes + (files->channels.normals ? 2 * frame : 0) +
           session_deep_bytes(&files->deep, files->frame.width, files->frame.height);
}

static insitu_image_format find_image_format(const scene_output *output)
{
    if (output->is_deep) return INSITU_DEEP_EXR;
    switch (output->format) {
    case SCENE_PNG8: return INSITU_PNG8;
    case SCENE_PNG16: return INSITU_PNG16;
    case SCENE_EXR: return INSITU_EXR;
    }
    return INSITU_PNG8;
}

static void write_output(session_files *files, const scene_output *output)
{
    const session_decorations *decorations = files->decorations;
    char *path = scene_expand_placeholders(output->path, &files->moment);
    if (!path) {
        base_fail(&files->error, INSITU_ERROR_MEMORY, "no memory for the name of a picture");
        return;
    }
    const insitu_deep deep = {files->deep.samples, files->deep.first, files->deep.counts};
    const insitu_image picture = {.width = files->frame.width,
                                  .height = files->frame.height,
                                  .rgba = files->frame.rgba,
                                  .depth = output->format == SCENE_EXR ? files->frame.depth : NULL,
                                  .channel_count = output->has_data ? SESSION_CHANNELS : 0,
                                  .channels = files->channels.items,
                                  .deep = output->is_deep ? &deep : NULL,
                                  .decorations = !decorations              ? NULL
                                                 : output->has_decorations ? &decorations->decorations
                                                                           : &decorations->background};
    base_error reason = {0};
    if (output->montage >= 0) {
        if (session_add_panel(files->montages, files->scene, &files->image, output, &picture, decorations, path,
                              &reason))
            base_fail(&files->error, reason.status, "image \"%s\": %.900s", files->image.name, reason.message);
        return;
    }
    if (session_write_image(&picture, find_image_format(output), path, &reason) != INSITU_OK)
        base_fail(&files->error, reason.status, "image \"%s\": %.900s", files->image.name, reason.message);
    else if (output->database >= 0)
        session_record_picture(files->cinema, files->scene, &files->image, output, &files->moment, &files->error);
    base_free(path);
}

/* Returns the time in milliseconds. MPI_Wtime() is not used, because the writing thread must not call MPI. */
static double read_clock_milliseconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
}

/* Writes the files that are written after all pictures of a step: montages and the tables of databases. */
static void write_montages_and_tables(session_files *files)
{
    base_error reason = {0};
    session_write_montages(files->montages, files->scene, &reason);
    session_write_cinema(files->cinema, &files->error);
    if (reason.status && !files->error.status) files->error = reason;
}

void session_write_files(session_files *files)
{
    const double start = read_clock_milliseconds();
    if (files->news)
        session_write_report_json(files->scene, files->news, &files->error);
    else if (!files->has_picture)
        write_montages_and_tables(files);
    for (int i = 0; files->has_picture && i < files->image.output_count; i++)
        write_output(files, &files->image.outputs[i]);
    files->ms = read_clock_milliseconds() - start;
}

void session_files_free(session_files *files)
{
    if (!files) return;
    session_drop_picture(&files->memory);
    session_free_channels(&files->channels);
    session_free_deep_image(&files->deep);
    session_free_decorations(files->decorations);
    base_free(files->news);
    base_free(files);
}
