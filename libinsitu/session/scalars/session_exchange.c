/* MPI counts are ints: words are 8 bytes, so that a rank may send and receive 16 GiB in one exchange; beyond that it is
 * an error on all ranks, not an overflow. */
#include "session_exchange.h"

#include <string.h>

#include "memory.h"
#include "session_agree.h"

static uint64_t mix(uint64_t x)
{
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

uint64_t session_key_hash(const session_key *key)
{
    return mix(key->words[0] ^ mix(key->words[1] ^ mix(key->words[2])));
}

bool session_keys_create(session_key_table *table, int64_t most)
{
    uint64_t slots = 16;
    while (slots < 2 * (uint64_t)most) slots *= 2;
    *table = (session_key_table){.mask = slots - 1};
    table->keys = base_alloc((size_t)most * sizeof *table->keys);
    table->slots = base_alloc(slots * sizeof *table->slots);
    if (!table->keys || !table->slots) {
        session_keys_free(table);
        return false;
    }
    memset(table->slots, 0xff, slots * sizeof *table->slots);
    return true;
}

int64_t session_keys_find(const session_key_table *table, const session_key *key)
{
    uint64_t slot = session_key_hash(key) & table->mask;
    for (; table->slots[slot] >= 0; slot = (slot + 1) & table->mask)
        if (memcmp(&table->keys[table->slots[slot]], key, sizeof *key) == 0) return table->slots[slot];
    return -1;
}

int64_t session_keys_add(session_key_table *table, const session_key *key)
{
    uint64_t slot = session_key_hash(key) & table->mask;
    for (; table->slots[slot] >= 0; slot = (slot + 1) & table->mask)
        if (memcmp(&table->keys[table->slots[slot]], key, sizeof *key) == 0) return table->slots[slot];
    table->keys[table->count] = *key;
    return table->slots[slot] = table->count++;
}

void session_keys_free(session_key_table *table)
{
    base_free(table->keys);
    base_free(table->slots);
    *table = (session_key_table){0};
}

void session_mail_free(session_mail *mail)
{
    base_free(mail->counts);
    base_free(mail->words);
    *mail = (session_mail){0};
}

/* counts and starts as MPI has them, of both directions. */
typedef struct mail_places {
    int *out_counts, *out_starts, *in_counts, *in_starts; /* in one block, from out_counts */
} mail_places;

static bool places_create(mail_places *places, int ranks)
{
    places->out_counts = base_calloc((size_t)ranks * 4, sizeof(int));
    if (!places->out_counts) return false;
    places->out_starts = places->out_counts + ranks;
    places->in_counts = places->out_starts + ranks;
    places->in_starts = places->in_counts + ranks;
    return true;
}

static bool fill_places(const int64_t *counts, int ranks, int *mpi_counts, int *starts, int64_t *total)
{
    *total = 0;
    for (int rank = 0; rank < ranks; rank++) {
        if (counts[rank] > INT32_MAX - *total) return false;
        mpi_counts[rank] = (int)counts[rank];
        starts[rank] = (int)*total;
        *total += counts[rank];
    }
    return true;
}

static insitu_status prepare_in(const session_mail *out, session_mail *in, mail_places *places, int ranks,
                                base_error *error)
{
    int64_t out_total = 0;
    if (!fill_places(out->counts, ranks, places->out_counts, places->out_starts, &out_total) ||
        !fill_places(in->counts, ranks, places->in_counts, places->in_starts, &in->total))
        return base_fail(error, INSITU_ERROR_MEMORY, "more than 16 GiB of data between ranks at once");
    in->words = base_alloc((size_t)in->total * sizeof *in->words);
    if (!in->words)
        return base_fail(error, INSITU_ERROR_MEMORY, "no memory for %lld bytes of data between ranks",
                         (long long)in->total * 8);
    return INSITU_OK;
}

static insitu_status exchange(MPI_Comm comm, const session_mail *out, session_mail *in, mail_places *places,
                              base_error *error)
{
    int ranks = 1;
    MPI_Comm_size(comm, &ranks);
    in->counts = base_calloc((size_t)ranks, sizeof *in->counts);
    if (!places_create(places, ranks) || !in->counts)
        base_fail(error, INSITU_ERROR_MEMORY, "no memory for counts of %d ranks", ranks);
    insitu_status status = session_agree(comm, error);
    if (status) return status;
    status =
        session_mpi(error, MPI_Alltoall(out->counts, 1, MPI_INT64_T, in->counts, 1, MPI_INT64_T, comm), "MPI_Alltoall");
    if (status) return status;
    prepare_in(out, in, places, ranks, error);
    status = session_agree(comm, error);
    if (status) return status;
    return session_mpi(error,
                       MPI_Alltoallv(out->words, places->out_counts, places->out_starts, MPI_UINT64_T, in->words,
                                     places->in_counts, places->in_starts, MPI_UINT64_T, comm),
                       "MPI_Alltoallv");
}

insitu_status session_mail_exchange(MPI_Comm comm, const session_mail *out, session_mail *in, base_error *error)
{
    mail_places places = {0};
    *in = (session_mail){0};
    const insitu_status status = exchange(comm, out, in, &places, error);
    base_free(places.out_counts);
    if (status) session_mail_free(in);
    return status;
}
