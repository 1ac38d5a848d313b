/* Computes the additional channels that an EXR file may contain besides colours and depth. They describe the nearest
 * surface at each pixel: its normal, the value that colours it, the index of its layer in the scene, and its index
 * within the layer. */
#ifndef SESSION_CHANNELS_H
#define SESSION_CHANNELS_H

#include "fragment.h"
#include "insitu/image_output.h"
#include "render.h"
#include "scene.h"
#include "session_frame.h"
#include "session_team.h"

enum { SESSION_CHANNELS = 6 };

typedef struct session_channels {
    /* 4 floats per pixel, on rank 0 only. normals: the three components of the normal. values: the surface's value, the
     * index of its layer, and its index within the layer. The fourth float of each pixel is not used as a channel. */
    float *normals, *values;
    insitu_channel items[SESSION_CHANNELS];
} session_channels;

/* Returns whether an output of the image requests the additional channels. */
bool session_needs_channels(const scene_image *image);

/* Draws the channels in two frames, in which all surfaces of the job are opaque and sampled at the pixels' centres.
 * *taken receives the statistics of both frames (numbers of rays, times and sizes of messages). The channels must be
 * freed even after an error. Collective. */
insitu_status session_draw_channels(const session_frame_target *target, const session_team *team,
                                    const scene_image *image, const render_job *job, session_channels *out,
                                    session_frame *taken, base_error *error);

void session_free_channels(session_channels *channels);

#endif
