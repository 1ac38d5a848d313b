/* Pixels travel as fragments do, in blocks (comp_block.h). Only those with fragments are sent; the rest are background,
 * which rank 0 knows. A rank with children passes their messages on as they come, in a buffer allocated before, and
 * ends with a message that says that no more follow. So rank 0 need not know how many there are, hears only from its
 * own children, and its memory grows with neither the image nor the ranks. */
#include "comp_gather.h"

#include <string.h>

#include "comp_agree.h"
#include "comp_words.h"

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

/* The way to the parent: one message is written while the one before is being sent. */
typedef struct upward {
    comp_mailroom *room;
    int parent; /* its rank */
    int which;
    unsigned char *parcel, *end; /* of the open message; NULL: there is none */
    uint32_t records;
    MPI_Request requests[2];
    int code;
} upward;

static void pass_up(upward *up, unsigned char *message, int bytes, MPI_Request *request)
{
    const int code = MPI_Isend(message, bytes, MPI_BYTE, up->parent, TAG_PIXELS, up->room->comm, request);
    if (up->code == MPI_SUCCESS) up->code = code;
    up->room->sent_bytes += bytes;
    up->room->sent_messages++;
}

static void wait_for(upward *up, MPI_Request *request)
{
    const int code = MPI_Wait(request, MPI_STATUS_IGNORE);
    if (up->code == MPI_SUCCESS) up->code = code;
}

static void close_message(upward *up, uint32_t owner)
{
    if (!up->parcel) return;
    const uint32_t head[3] = {owner, up->records, (uint32_t)(up->end - up->parcel - COMP_PARCEL_HEAD)};
    memcpy(up->parcel, head, sizeof head);
    unsigned char *const message = up->room->outgoing[up->which];
    pass_up(up, message, (int)(up->end - message), &up->requests[up->which]);
    up->which = !up->which;
    up->parcel = NULL;
}

static void put_block(upward *up, uint32_t owner)
{
    comp_block *const block = up->room->block;
    if (up->parcel &&
        (size_t)(up->end - up->room->outgoing[up->which]) + comp_block_bound(block->count) > COMP_MESSAGE_BYTES)
        close_message(up, owner);
    if (!up->parcel) {
        wait_for(up, &up->requests[up->which]);
        unsigned char *const message = up->room->outgoing[up->which];
        memset(message, 0, COMP_MESSAGE_HEAD);
        message[0] = 1;
        up->parcel = message + COMP_MESSAGE_HEAD;
        up->end = up->parcel + COMP_PARCEL_HEAD;
        up->records = 0;
    }
    up->end = comp_block_write(block, up->end);
    up->records += (uint32_t)block->count;
}

static void send_own(upward *up, uint32_t owner, const comp_pixel_list *finished)
{
    comp_block *const block = up->room->block;
    for (int64_t i = 0; i < finished->count; i += block->count) {
        const int64_t left = finished->count - i;
        block->count = (int)(left < COMP_BLOCK_RECORDS ? left : COMP_BLOCK_RECORDS);
        memset(block->records, 0, (size_t)block->count * sizeof *block->records);
        for (int k = 0; k < block->count; k++)
            memcpy(block->records[k], &finished->items[i + k], sizeof *finished->items);
        put_block(up, owner);
    }
    close_message(up, owner);
    for (int which = 0; which < 2; which++) wait_for(up, &up->requests[which]);
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

static void store_block(const comp_block *block, const comp_layout *layout, uint32_t owner, image *out)
{
    for (int i = 0; i < block->count; i++) {
        comp_pixel pixel;
        memcpy(&pixel, block->records[i], sizeof pixel);
        pixel.pixel = comp_layout_pixel(layout, owner, pixel.pixel);
        comp_pixels_store(out, &pixel);
    }
}

static void store_message(comp_mailroom *room, const comp_layout *layout, int bytes, image *out)
{
    for (const unsigned char *at = room->waste + COMP_MESSAGE_HEAD, *end = room->waste + bytes; at < end;) {
        uint32_t head[3];
        memcpy(head, at, sizeof head);
        at += sizeof head;
        for (const unsigned char *parcel_end = at + head[2]; at < parcel_end;) {
            at = comp_block_read(at, room->block);
            store_block(room->block, layout, head[0], out);
        }
    }
}

static int receive_at_root(comp_mailroom *room, const comp_layout *layout, int children, image *out)
{
    int code = MPI_SUCCESS;
    while (children > 0 && code == MPI_SUCCESS) {
        int bytes = 0;
        code = receive(room, &bytes);
        if (code != MPI_SUCCESS) break;
        children -= !room->waste[0];
        store_message(room, layout, bytes, out);
    }
    return code;
}

static void pass_on(upward *up, int children)
{
    while (children > 0 && up->code == MPI_SUCCESS) {
        int bytes = 0;
        up->code = receive(up->room, &bytes);
        if (up->code != MPI_SUCCESS) break;
        children -= !up->room->waste[0];
        if (bytes == COMP_MESSAGE_HEAD) continue;
        up->room->waste[0] = 1;
        pass_up(up, up->room->waste, bytes, &up->requests[0]);
        wait_for(up, &up->requests[0]);
    }
    unsigned char *const last = up->room->outgoing[0];
    memset(last, 0, COMP_MESSAGE_HEAD);
    pass_up(up, last, COMP_MESSAGE_HEAD, &up->requests[0]);
    wait_for(up, &up->requests[0]);
}

insitu_status comp_gather(comp_mailroom *room, const comp_route *route, const comp_layout *layout,
                          const comp_pixel_list *finished, image *out, insitu_status status, base_error *error)
{
    const int place = comp_route_place(route, room->rank);
    int code = MPI_SUCCESS;
    if (place >= route->owners) return status;
    const int children = comp_gather_children(route, place);
    if (place == 0) {
        code = receive_at_root(room, layout, children, out);
    } else {
        upward up = {.room = room, .parent = comp_route_rank(route, comp_gather_parent(route, place))};
        up.requests[0] = up.requests[1] = MPI_REQUEST_NULL;
        if (!status) send_own(&up, (uint32_t)place, finished);
        pass_on(&up, children);
        code = up.code;
    }
    return status ? status : comp_mpi_status(code, error);
}
