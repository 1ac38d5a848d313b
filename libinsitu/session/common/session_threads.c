/* OpenMP's runtimes end the process if they cannot start a thread. Threads are therefore first started here as a trial,
 * in which a failure only reduces their number. The trial starts the threads that the step needs and SPARE_THREADS
 * more, with the stack size that OpenMP would use. All of them exist until every rank has finished its trial, since the
 * ranks of a node share limits (processes of a user or a container, memory, address space). OpenMP then gets the number
 * that could be started. The spare threads, and some memory, remain available for other purposes.
 *
 * OpenMP keeps its threads for later regions. Therefore the trial is repeated only if more threads are needed, or if
 * threads have ended; GNU's OpenMP ends threads if a region of the caller uses fewer. A destructor in each thread
 * counts the threads that end.
 *
 * OpenMP has no function that returns the stack size of workers, so it is measured in the workers. */
#define _GNU_SOURCE 1
#include "session_threads.h"

#include <omp.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "region.h"
#include "session_agree.h"

enum {
    SPARE_THREADS = 4,
    /* bytes that the trial reserves and then leaves free, because OpenMP ends the process if it cannot allocate memory
     * for a parallel region or a task */
    SPARE_BYTES = 4 << 20
};

/* ---- number of threads requested ----------------------------------------------------------------------------- */

typedef struct thread_limit {
    int threads;
    const char *reason;
} thread_limit;

/* Returns the maximum number of threads and the reason for it. Inside a parallel region of the caller, GNU's OpenMP
 * would start new threads for every region of the library, so the maximum is 1. */
static thread_limit find_thread_limit(void)
{
    const int cores = omp_get_num_procs(), limit = omp_get_thread_limit();
    if (omp_get_level() > 0) return (thread_limit){1, "insitu_step() was called within a parallel region"};
    if (limit < cores)
        return (thread_limit){limit > 1 ? limit : 1, "OpenMP's thread limit (OMP_THREAD_LIMIT) is no higher"};
    return (thread_limit){cores > 1 ? cores : 1, "this rank may run on no more cores"};
}

static int compute_requested_threads(int scene_threads, int cores)
{
    const int most = omp_get_max_threads(), usual = cores < most ? cores : most;
    const int requested = scene_threads > 0 ? scene_threads : usual;
    const int cap = find_thread_limit().threads;
    return requested > cap ? cap : requested > 1 ? requested : 1;
}

/* ---- threads that ended -------------------------------------------------------------------------------------- */

static pthread_once_t key_once = PTHREAD_ONCE_INIT;
static pthread_key_t key;
static bool has_key;
static atomic_llong ended_count;

static void count_thread_end(void *value)
{
    (void)value;
    atomic_fetch_add(&ended_count, 1);
}

static void create_exit_key(void)
{
    has_key = pthread_key_create(&key, count_thread_end) == 0;
}

/* Returns the number of threads, including the caller, that exist for parallel regions of the calling thread. Returns 1
 * if another thread made the trial or if threads have ended since, because the number is then unknown. */
static int count_living_threads(const session_threads *threads)
{
    const bool is_same = threads->count > 0 && pthread_equal(threads->caller, pthread_self());
    return is_same && threads->ended_count == atomic_load(&ended_count) ? threads->count : 1;
}

bool session_needs_thread_trial(const session_threads *threads, int scene_threads, int cores)
{
    return compute_requested_threads(scene_threads, cores) > threads->count ||
           !pthread_equal(threads->caller, pthread_self()) || threads->ended_count != atomic_load(&ended_count);
}

/* ---- starting threads as a trial --------------------------------------------------------------------------------- */

typedef struct trial {
    pthread_mutex_t exit_mutex; /* held by the thread that starts the trial; the trial's threads wait for it, and end
                                 * when it is unlocked */
    pthread_t *threads;
    int count;
    /* memory of SPARE_BYTES that is allocated during the trial, and freed after it for other needs */
    void *spare_memory;
} trial;

static void *wait_until_unlocked(void *gate)
{
    pthread_mutex_lock(gate);
    pthread_mutex_unlock(gate);
    return NULL;
}

/* Parses a size in the format that the OpenMP runtimes use, as in "512k" or " 16 M". unit: unit in bytes of a number
 * without a suffix. Returns the size in bytes, or 0 if the text contains none. */
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

/* Returns the largest stack size that is set in the environment, in bytes; 0 if none is set. */
static size_t find_stack_size_of_environment(void)
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

/* Starts up to `requested` threads. Their number is stored in the trial. */
static void start_trial_threads(trial *t, int requested)
{
    pthread_attr_t attributes;
    sigset_t all, old;
    *t =
        (trial){.threads = base_calloc((size_t)requested, sizeof *t->threads), .spare_memory = base_alloc(SPARE_BYTES)};
    pthread_mutex_init(&t->exit_mutex, NULL);
    pthread_mutex_lock(&t->exit_mutex);
    if (!t->threads || !t->spare_memory || pthread_attr_init(&attributes) != 0) return;
    const size_t stack = find_stack_size_of_environment();
    /* the returned error is ignored: if the system rejects the stack size, the default size is used, as OpenMP does */
    if (stack) pthread_attr_setstacksize(&attributes, stack);
    sigfillset(&all);
    /* new threads inherit the blocked signals, so that signals sent to the caller's process never reach them */
    pthread_sigmask(SIG_SETMASK, &all, &old);
    while (t->count < requested &&
           pthread_create(&t->threads[t->count], &attributes, wait_until_unlocked, &t->exit_mutex) == 0)
        t->count++;
    pthread_sigmask(SIG_SETMASK, &old, NULL);
    pthread_attr_destroy(&attributes);
}

static void join_trial_threads(trial *t)
{
    pthread_mutex_unlock(&t->exit_mutex);
    for (int i = 0; i < t->count; i++) pthread_join(t->threads[i], NULL);
    pthread_mutex_destroy(&t->exit_mutex);
    base_free(t->threads);
    base_free(t->spare_memory);
}

/* Starts the threads that this rank still needs as a trial, and stores in *threads how many are available. Must be
 * called before the step's first parallel region. All ranks try at the same time, because ranks on a node share its
 * limits. Collective. */
static insitu_status start_threads_as_trial(session_threads *threads, int requested, MPI_Comm comm, base_error *error)
{
    const int living = count_living_threads(threads), lacking = requested - living;
    trial t = {.count = 0};
    pthread_once(&key_once, create_exit_key);
    if (lacking > 0) start_trial_threads(&t, lacking + SPARE_THREADS);
    const insitu_status status = session_agree(comm, error);
    if (lacking > 0) join_trial_threads(&t);
    const int more = t.count > SPARE_THREADS ? t.count - SPARE_THREADS : 0;
    *threads = (session_threads){.count = lacking > 0 ? living + more : living,
                                 .caller = pthread_self(),
                                 .ended_count = atomic_load(&ended_count)};
    return status;
}

/* Returns the number of threads for this step. Warns if there are fewer than requested. */
static int choose_threads(const session_threads *threads, int scene_threads, int requested, session_report *report)
{
    const bool are_enough = threads->count >= requested;
    session_warn_locally(report, &(session_warning){WARNING_THREADS, NULL, NULL, 0}, scene_threads > requested,
                         "the scene asks for %d threads, at most %d are used: %s", scene_threads, requested,
                         find_thread_limit().reason);
    session_warn_locally(
        report, &(session_warning){WARNING_THREADS, NULL, NULL, 1}, !are_enough,
        "%d of %d threads are used: no more can be started, by the limits of memory, processes or threads",
        threads->count, requested);
    return are_enough ? requested : threads->count;
}

/* ---- stack sizes of threads -------------------------------------------------------------------------------------- */

/* A thread's stack: free_bytes is the number of bytes left below the current stack frame, total_bytes is the size of
 * the stack. Both are INT64_MAX if unknown. */
typedef struct thread_stack {
    int64_t free_bytes, total_bytes;
} thread_stack;

static thread_stack find_stack_of_thread(void)
{
    pthread_attr_t attributes;
    void *lowest = NULL;
    size_t size = 0;
    const thread_stack unknown = {INT64_MAX, INT64_MAX};
    if (pthread_getattr_np(pthread_self(), &attributes) != 0) return unknown;
    const int code = pthread_attr_getstack(&attributes, &lowest, &size);
    pthread_attr_destroy(&attributes);
    const uintptr_t here = (uintptr_t)__builtin_frame_address(0), low = (uintptr_t)lowest;
    if (code != 0 || here <= low || here - low >= size) return unknown;
    return (thread_stack){(int64_t)(here - low), (int64_t)size};
}

/* Returns the smallest number of free bytes and the smallest size of the stacks of all OpenMP threads except the
 * calling one. The two may be those of different threads. */
static thread_stack find_least_worker_stack(int threads)
{
    int64_t left = INT64_MAX, size = INT64_MAX;
#pragma omp parallel num_threads(threads) reduction(min : left, size)
    {
        region_enter();
        if (omp_get_thread_num() > 0) {
            const thread_stack own = find_stack_of_thread();
            left = own.free_bytes;
            size = own.total_bytes;
            if (has_key) pthread_setspecific(key, &key);
        }
        region_leave();
    }
    return (thread_stack){left, size};
}

/* Returns the stack size in kB that a thread must have so that `needed` bytes are free: the sum of the bytes in use
 * now, `needed` bytes, and some kB for the operating system. */
static long long compute_needed_stack_kilobytes(const thread_stack *stack, int64_t needed)
{
    enum { SYSTEM_KILOBYTES = 16 };
    return ((needed + stack->total_bytes - stack->free_bytes) >> 10) + SYSTEM_KILOBYTES;
}

/* Stores an error if a thread's stack is too small. Must be called before any other parallel region. Collective. */
static insitu_status check_stacks(session_threads *threads, const session_team *team, const session_guard *guard,
                                  base_error *error)
{
    const thread_stack own = find_stack_of_thread();
    session_guard_set_caller_fenv(guard);
    const thread_stack least = find_least_worker_stack(team->threads);
    session_guard_set_default_fenv();
    if (own.free_bytes < SESSION_CALLER_STACK)
        base_fail(error, INSITU_ERROR_ARGUMENT,
                  "the thread that calls insitu_step() has %lld kB of its stack left, a step needs %d kB: expected a "
                  "stack of %lld kB (ulimit -s %lld)",
                  (long long)own.free_bytes >> 10, SESSION_CALLER_STACK >> 10,
                  compute_needed_stack_kilobytes(&own, SESSION_CALLER_STACK),
                  compute_needed_stack_kilobytes(&own, SESSION_CALLER_STACK));
    else if (least.free_bytes < SESSION_WORKER_STACK)
        base_fail(error, INSITU_ERROR_ARGUMENT,
                  "OpenMP's threads have %lld kB of stack left, a step needs %d kB: expected stacks of %lld kB "
                  "(OMP_STACKSIZE=%lldk)",
                  (long long)least.free_bytes >> 10, SESSION_WORKER_STACK >> 10,
                  compute_needed_stack_kilobytes(&least, SESSION_WORKER_STACK),
                  compute_needed_stack_kilobytes(&least, SESSION_WORKER_STACK));
    const insitu_status status = session_agree(team->comm, error);
    if (status)
        threads->count = 0; /* marks the threads as not tried, so that the next step tries to start them again */
    return status;
}

insitu_status session_prepare_threads(session_threads *threads, session_team *team, int scene_threads, bool is_new,
                                      const session_guard *guard, session_report *report, base_error *error)
{
    const int requested = compute_requested_threads(scene_threads, team->cores);
    insitu_status status = is_new ? start_threads_as_trial(threads, requested, team->comm, error) : INSITU_OK;
    if (status) return status;
    team->threads = choose_threads(threads, scene_threads, requested, report);
    return is_new ? check_stacks(threads, team, guard, error) : INSITU_OK;
}
