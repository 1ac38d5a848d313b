/* Finished pixels are sent in sheets (comp_sheet.h), as fragments are. Owners send all strips of their blocks; a strip
 * without fragments takes only a header. A block without fragments has no owner, and rank 0 fills it with the
 * background. A rank with children forwards their messages as they arrive, through a buffer allocated beforehand, and
 * finally sends a message that marks the end. Rank 0 therefore needs no counts and receives only from its own children,
 * and its memory does not grow with the image or the number of ranks. */
#include "comp_gather.h"

#include <string.h>

#include "comp_agree.h"

enum { TAG_PIXELS = 4 };

int comp_gather_parent(const comp_route *route, int place)
{
    const int within = place % route->nodes.ranks;
    if (within) return place - within;
    return (place / route->nodes.ranks - 1) / COMP_GATHER_FAN * route->nodes.ranks;
}

int comp_gather_children(const comp_route *route, int place)
{
    const int ranks = route->nodes.ranks, nodes = route->owners / ranks, node = place / ranks;
    if (place % ranks) return 0;
    const int64_t first = (int64_t)node * COMP_GATHER_FAN + 1, left = nodes - first;
    const int below = left <= 0 ? 0 : left < COMP_GATHER_FAN ? (int)left : COMP_GATHER_FAN;
    return ranks - 1 + below;
}

/* ---- to the parent ------------------------------------------------------------------------------------------- */

/* The connection to the parent in the gather tree. */
typedef struct upward {
    comp_mailroom *room;
    int parent; /* rank of the parent */
    int code;
} upward;

static void pass_up(upward *up, const unsigned char *message, int bytes)
{
    if (up->code != MPI_SUCCESS) return;
    up->code = MPI_Send(message, bytes, MPI_BYTE, up->parent, TAG_PIXELS, up->room->comm);
    up->room->sent_bytes += bytes;
    up->room->sent_messages++;
}

/* Sends this rank's finished pixels, in batches of COMP_LONGEST_DENSE messages because the request buffer has no more
 * entries. */
static void send_own(upward *up, const comp_messages *finished)
{
    MPI_Request *const requests = up->room->reserve;
    for (comp_message *m = finished->first; m && up->code == MPI_SUCCESS;) {
        int count = 0;
        for (; m && count < COMP_LONGEST_DENSE && up->code == MPI_SUCCESS; m = m->next) {
            m->data[0] = 1;
            up->code = MPI_Isend(m->data, m->bytes, MPI_BYTE, up->parent, TAG_PIXELS, up->room->comm, &requests[count]);
            count += up->code == MPI_SUCCESS;
            up->room->sent_bytes += m->bytes;
            up->room->sent_messages++;
        }
        const int code = MPI_Waitall(count, requests, MPI_STATUSES_IGNORE);
        if (up->code == MPI_SUCCESS) up->code = code;
    }
}

/* ---- from the children --------------------------------------------------------------------------------------- */

static int receive(comp_mailroom *room, int *bytes)
{
    MPI_Status status;
    const int code =
        MPI_Recv(room->waste, COMP_MESSAGE_BYTES, MPI_BYTE, MPI_ANY_SOURCE, TAG_PIXELS, room->comm, &status);
    if (code == MPI_SUCCESS) MPI_Get_count(&status, MPI_BYTE, bytes);
    return code;
}

static void store_message(comp_mailroom *room, int bytes, const comp_canvas *canvas)
{
    for (const unsigned char *at = room->waste + COMP_MESSAGE_HEAD, *end = room->waste + bytes; at < end;) {
        uint32_t head[3];
        memcpy(head, at, sizeof head);
        at += sizeof head;
        for (const unsigned char *parcel_end = at + head[2]; at < parcel_end;) {
            at = comp_sheet_read(at, COMP_PIXEL_WORDS, room->sheet);
            comp_sheet_store(room->sheet, canvas->grid, canvas->background, canvas->out);
        }
    }
}

static int receive_at_root(comp_mailroom *room, int children, const comp_canvas *canvas)
{
    int code = MPI_SUCCESS;
    while (children > 0 && code == MPI_SUCCESS) {
        int bytes = 0;
        code = receive(room, &bytes);
        if (code != MPI_SUCCESS) break;
        children -= !room->waste[0];
        store_message(room, bytes, canvas);
    }
    return code;
}

static void pass_on(upward *up, int children)
{
    comp_mailroom *const room = up->room;
    while (children > 0 && up->code == MPI_SUCCESS) {
        int bytes = 0;
        up->code = receive(room, &bytes);
        if (up->code != MPI_SUCCESS) break;
        children -= !room->waste[0];
        if (bytes == COMP_MESSAGE_HEAD) continue;
        room->waste[0] = 1;
        pass_up(up, room->waste, bytes);
    }
    memset(room->waste, 0, COMP_MESSAGE_HEAD);
    pass_up(up, room->waste, COMP_MESSAGE_HEAD);
}

insitu_status comp_gather(comp_mailroom *room, const comp_route *route, const comp_canvas *canvas,
                          comp_messages *finished, insitu_status status, base_error *error)
{
    const int place = comp_route_place(route, room->rank);
    int code = MPI_SUCCESS;
    if (place < route->owners && place > 0) {
        upward up = {room, comp_route_rank(route, comp_gather_parent(route, place)), MPI_SUCCESS};
        if (!status) send_own(&up, finished);
        pass_on(&up, comp_gather_children(route, place));
        code = up.code;
    } else if (place == 0) {
        code = receive_at_root(room, comp_gather_children(route, place), canvas);
    }
    comp_messages_free(finished);
    return status ? status : comp_mpi_status(code, error);
}
