/* OpenMP's runtimes end the process where they cannot start a thread. So threads are started here first, where a
 * failure is a number: as many as the step wants and a few more, with the stacks that OpenMP would give them, and kept
 * until every rank has tried, since the ranks of a node draw on the same limits (processes of a user or a container,
 * memory, address space). What could be started is what OpenMP is asked for. The few more, and some memory, are left
 * for everybody else.
 *
 * OpenMP keeps its threads for later regions, so that a team need not be tried again unless it grows, or some of its
 * threads have ended: GNU's do where a region of the caller's has fewer. A destructor of each thread's counts these.
 *
 * How large the stacks of workers are no interface of OpenMP tells; the workers themselves are asked. */
#define _GNU_SOURCE
#include "session_team.h"

#include <omp.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "memory.h"
#include "session_agree.h"

enum {
    SPARE_THREADS = 4,
    SPARE_BYTES = 4 << 20 /* OpenMP ends the process where it gets none for a region's or a task's description */
};

/* ---- wanted -------------------------------------------------------------------------------------------------- */

typedef struct team_cap {
    int threads;
    const char *reason;
} team_cap;

/* Within a region of the caller's, GNU's OpenMP would start a team's threads anew for every region of ours. */
static team_cap cap_of_team(void)
{
    const int cores = omp_get_num_procs(), limit = omp_get_thread_limit();
    if (omp_get_level() > 0) return (team_cap){1, "insitu_step() was called within a parallel region"};
    if (limit < cores)
        return (team_cap){limit > 1 ? limit : 1, "OpenMP's thread limit (OMP_THREAD_LIMIT) is no higher"};
    return (team_cap){cores > 1 ? cores : 1, "this rank may run on no more cores"};
}

/* A rank bound to some cores has them for itself; one that is bound to none shares the node's. */
static int usual_threads(const insitu_session *session)
{
    int cores = omp_get_num_procs();
    if (cores >= (int)sysconf(_SC_NPROCESSORS_ONLN)) cores /= session->node_ranks;
    return cores < omp_get_max_threads() ? cores : omp_get_max_threads();
}

static int wanted_threads(const insitu_session *session)
{
    const int asked = session->scene.threads > 0 ? session->scene.threads : usual_threads(session);
    const int cap = cap_of_team().threads;
    return asked > cap ? cap : asked > 1 ? asked : 1;
}

/* ---- threads that ended -------------------------------------------------------------------------------------- */

static pthread_once_t key_once = PTHREAD_ONCE_INIT;
static pthread_key_t key;
static bool has_key;
static atomic_llong ended_count;

static void count_end(void *value)
{
    (void)value;
    atomic_fetch_add(&ended_count, 1);
}

static void make_key(void)
{
    has_key = pthread_key_create(&key, count_end) == 0;
}

bool session_team_grows(const insitu_session *session)
{
    const session_team *team = &session->team;
    return wanted_threads(session) > team->size || !pthread_equal(team->caller, pthread_self()) ||
           team->ended != atomic_load(&ended_count);
}

/* ---- trial --------------------------------------------------------------------------------------------------- */

typedef struct trial {
    pthread_mutex_t gate; /* held until the threads may end */
    pthread_t *threads;
    int count;
    void *room;
} trial;

static void *pass_gate(void *gate)
{
    pthread_mutex_lock(gate);
    pthread_mutex_unlock(gate);
    return NULL;
}

/* "512k", " 16 M": the runtimes' way of writing sizes. 0: none. */
static size_t parse_size(const char *text, size_t unit)
{
    static const char suffixes[] = "bkmg";
    char *end;
    const unsigned long long number = strtoull(text, &end, 10);
    if (end == text) return 0;
    while (*end == ' ') end++;
    const char *suffix = *end ? strchr(suffixes, *end | 0x20) : NULL;
    if (suffix) unit = (size_t)1 << 10 * (suffix - suffixes);
    return number > SIZE_MAX / unit ? 0 : (size_t)number * unit;
}

/* The largest stack that the environment asks for; 0: none is. */
static size_t stack_of_environment(void)
{
    static const struct {
        const char *name;
        size_t unit;
    } variables[] = {
        {"OMP_STACKSIZE", 1024}, {"OMP_STACKSIZE_ALL", 1024}, {"GOMP_STACKSIZE", 1024}, {"KMP_STACKSIZE", 1}};
    size_t most = 0;
    for (size_t i = 0; i < sizeof variables / sizeof variables[0]; i++) {
        const char *text = getenv(variables[i].name);
        const size_t size = text ? parse_size(text, variables[i].unit) : 0;
        if (size > most) most = size;
    }
    return most;
}

/* Start as many threads as can be, up to wanted ones. */
static void start_trial(trial *t, int wanted)
{
    pthread_attr_t attributes;
    sigset_t all, old;
    *t = (trial){.threads = base_calloc((size_t)wanted, sizeof *t->threads), .room = base_alloc(SPARE_BYTES)};
    pthread_mutex_init(&t->gate, NULL);
    pthread_mutex_lock(&t->gate);
    if (!t->threads || !t->room || pthread_attr_init(&attributes) != 0) return;
    const size_t stack = stack_of_environment();
    if (stack) pthread_attr_setstacksize(&attributes, stack); /* one that is refused here OpenMP does not take either */
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &old); /* the caller's signals are not for these */
    while (t->count < wanted && pthread_create(&t->threads[t->count], &attributes, pass_gate, &t->gate) == 0)
        t->count++;
    pthread_sigmask(SIG_SETMASK, &old, NULL);
    pthread_attr_destroy(&attributes);
}

static void end_trial(trial *t)
{
    pthread_mutex_unlock(&t->gate);
    for (int i = 0; i < t->count; i++) pthread_join(t->threads[i], NULL);
    pthread_mutex_destroy(&t->gate);
    base_free(t->threads);
    base_free(t->room);
}

/* As many as are known to be there. */
static int living_threads(const session_team *team)
{
    const bool is_same = team->size > 0 && pthread_equal(team->caller, pthread_self());
    return is_same && team->ended == atomic_load(&ended_count) ? team->size : 1;
}

insitu_status session_team_probe(insitu_session *session, base_error *error)
{
    const int wanted = wanted_threads(session), living = living_threads(&session->team), lacking = wanted - living;
    trial t = {.count = 0};
    pthread_once(&key_once, make_key);
    if (lacking > 0) start_trial(&t, lacking + SPARE_THREADS);
    const insitu_status status = session_agree(session->comm, error);
    if (lacking > 0) end_trial(&t);
    const int more = t.count > SPARE_THREADS ? t.count - SPARE_THREADS : 0;
    session->team = (session_team){
        .size = lacking > 0 ? living + more : living, .caller = pthread_self(), .ended = atomic_load(&ended_count)};
    return status;
}

int session_team_threads(insitu_session *session)
{
    const int asked = session->scene.threads, wanted = wanted_threads(session), size = session->team.size;
    if (asked > wanted)
        session_text_add(&session->warnings, "the scene asks for %d threads, at most %d are used: %s", asked, wanted,
                         cap_of_team().reason);
    if (size >= wanted) return wanted;
    session_text_add(&session->warnings,
                     "%d of %d threads are used: no more can be started, by the limits of memory, processes or threads",
                     size, wanted);
    return size;
}

/* ---- stacks -------------------------------------------------------------------------------------------------- */

/* From here to this thread's lowest address; where the stack is none of the system's, as much as one likes. */
static int64_t stack_left(void)
{
    pthread_attr_t attributes;
    void *lowest = NULL;
    size_t size = 0;
    if (pthread_getattr_np(pthread_self(), &attributes) != 0) return INT64_MAX;
    const int code = pthread_attr_getstack(&attributes, &lowest, &size);
    pthread_attr_destroy(&attributes);
    const uintptr_t here = (uintptr_t)__builtin_frame_address(0), low = (uintptr_t)lowest;
    return code == 0 && here > low && here - low < size ? (int64_t)(here - low) : INT64_MAX;
}

/* The least that a worker has; INT64_MAX where there is none. */
static int64_t least_worker_stack(int threads)
{
    int64_t least = INT64_MAX;
#pragma omp parallel num_threads(threads) reduction(min : least)
    if (omp_get_thread_num() > 0) {
        least = stack_left();
        if (has_key) pthread_setspecific(key, &key);
    }
    return least;
}

insitu_status session_team_check(insitu_session *session, base_error *error)
{
    const int64_t own = stack_left(), least = least_worker_stack(session->threads);
    if (own < SESSION_CALLER_STACK)
        base_fail(error, INSITU_ERROR_ARGUMENT,
                  "the thread that calls insitu_step() has %lld kB of its stack left, a step needs %d kB (ulimit -s)",
                  (long long)own >> 10, SESSION_CALLER_STACK >> 10);
    else if (least < SESSION_WORKER_STACK)
        base_fail(error, INSITU_ERROR_ARGUMENT,
                  "OpenMP's threads have %lld kB of stack, a step needs %d kB (OMP_STACKSIZE, ulimit -s)",
                  (long long)least >> 10, SESSION_WORKER_STACK >> 10);
    const insitu_status status = session_agree(session->comm, error);
    if (status) session->team.size = 0; /* looked at again in the next step */
    return status;
}
