/* Finished pixels are packed and sent in the same format as fragments (sheets, comp_sheet.h). Owners send all strips of
 * their blocks; a strip without fragments takes only a header. A block without fragments has no owner, and rank 0 fills
 * it with the background. A rank that receives pixels from other ranks (its children in the tree of comp_gather.h)
 * forwards their messages as they arrive, through a buffer allocated beforehand, and finally sends a message that marks
 * the end. Rank 0 therefore needs no counts and receives only from its own children, and its memory does not grow with
 * the image or the number of ranks. */
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

int comp_count_gather_children(const comp_route *route, int place)
{
    const int ranks = route->nodes.ranks, nodes = route->owners / ranks, node = place / ranks;
    if (place % ranks) return 0;
    const int64_t first = (int64_t)node * COMP_GATHER_FAN + 1, left = nodes - first;
    const int below = left <= 0 ? 0 : left < COMP_GATHER_FAN ? (int)left : COMP_GATHER_FAN;
    return ranks - 1 + below;
}

/* ---- sending to the parent in the gather tree ------------------------------------------------------------------- */

/* The connection to the parent in the gather tree. */
typedef struct parent_link {
    comp_transport *transport;
    int parent; /* rank of the parent in the gather tree */
    int code;   /* error code of the first MPI call that has failed; MPI_SUCCESS: none has failed */
} parent_link;

static void send_to_parent(parent_link *link, const unsigned char *message, int bytes)
{
    if (link->code != MPI_SUCCESS) return;
    link->code = MPI_Send(message, bytes, MPI_BYTE, link->parent, TAG_PIXELS, link->transport->comm);
    link->transport->sent_bytes += bytes;
    link->transport->sent_messages++;
}

/* Sends this rank's finished pixels, in batches of COMP_MAX_DENSE_RANKS messages because the request buffer has no more
 * entries. */
static void send_own_pixels(parent_link *link, const comp_messages *finished)
{
    MPI_Request *const requests = link->transport->reserved_requests;
    for (comp_message *m = finished->first; m && link->code == MPI_SUCCESS;) {
        int count = 0;
        for (; m && count < COMP_MAX_DENSE_RANKS && link->code == MPI_SUCCESS; m = m->next) {
            m->data[0] = 1;
            link->code = MPI_Isend(m->data, m->bytes, MPI_BYTE, link->parent, TAG_PIXELS, link->transport->comm,
                                   &requests[count]);
            count += link->code == MPI_SUCCESS;
            link->transport->sent_bytes += m->bytes;
            link->transport->sent_messages++;
        }
        const int code = MPI_Waitall(count, requests, MPI_STATUSES_IGNORE);
        if (link->code == MPI_SUCCESS) link->code = code;
    }
}

/* ---- receiving from the children in the gather tree ------------------------------------------------------------- */

static int receive_message(comp_transport *transport, int *bytes)
{
    MPI_Status status;
    const int code = MPI_Recv(transport->receive_buffer, COMP_MESSAGE_BYTES, MPI_BYTE, MPI_ANY_SOURCE, TAG_PIXELS,
                              transport->comm, &status);
    if (code == MPI_SUCCESS) MPI_Get_count(&status, MPI_BYTE, bytes);
    return code;
}

static void store_pixels_of_message(comp_transport *transport, int bytes, const comp_canvas *canvas)
{
    for (const unsigned char *at = transport->receive_buffer + COMP_MESSAGE_HEAD,
                             *end = transport->receive_buffer + bytes;
         at < end;) {
        uint32_t head[3];
        memcpy(head, at, sizeof head);
        at += sizeof head;
        for (const unsigned char *parcel_end = at + head[2]; at < parcel_end;) {
            at = comp_sheet_read(at, COMP_PIXEL_WORDS, transport->sheet);
            comp_sheet_store(transport->sheet, canvas->grid, canvas->background, canvas->out);
        }
    }
}

static int receive_at_root(comp_transport *transport, int children, const comp_canvas *canvas)
{
    int code = MPI_SUCCESS;
    while (children > 0 && code == MPI_SUCCESS) {
        int bytes = 0;
        code = receive_message(transport, &bytes);
        if (code != MPI_SUCCESS) break;
        children -= !transport->receive_buffer[0];
        store_pixels_of_message(transport, bytes, canvas);
    }
    return code;
}

static void forward_messages_of_children(parent_link *link, int children)
{
    comp_transport *const transport = link->transport;
    while (children > 0 && link->code == MPI_SUCCESS) {
        int bytes = 0;
        link->code = receive_message(transport, &bytes);
        if (link->code != MPI_SUCCESS) break;
        children -= !transport->receive_buffer[0];
        if (bytes == COMP_MESSAGE_HEAD) continue;
        transport->receive_buffer[0] = 1;
        send_to_parent(link, transport->receive_buffer, bytes);
    }
    memset(transport->receive_buffer, 0, COMP_MESSAGE_HEAD);
    send_to_parent(link, transport->receive_buffer, COMP_MESSAGE_HEAD);
}

insitu_status comp_gather(comp_transport *transport, const comp_route *route, const comp_canvas *canvas,
                          comp_messages *finished, insitu_status status, base_error *error)
{
    const int place = comp_find_place_of_rank(route, transport->rank);
    int code = MPI_SUCCESS;
    if (place < route->owners && place > 0) {
        parent_link link = {transport, comp_find_rank_at_place(route, comp_gather_parent(route, place)), MPI_SUCCESS};
        if (!status) send_own_pixels(&link, finished);
        forward_messages_of_children(&link, comp_count_gather_children(route, place));
        code = link.code;
    } else if (place == 0) {
        code = receive_at_root(transport, comp_count_gather_children(route, place), canvas);
    }
    comp_messages_free(finished);
    return status ? status : comp_convert_mpi_error(code, error);
}
