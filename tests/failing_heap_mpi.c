/* Excludes MPI's own allocations from the failing heap (failing_heap.h). Wraps every MPI function that the library
 * calls and that may allocate; the wrapper pauses the heap and calls the function by its profiling name. */
#include <mpi.h>

#include "failing_heap.h"

#define LET_BE(name, parameters, arguments)                                                                            \
    int MPI_##name parameters                                                                                          \
    {                                                                                                                  \
        heap_pause();                                                                                                  \
        const int code = PMPI_##name arguments;                                                                        \
        heap_resume();                                                                                                 \
        return code;                                                                                                   \
    }

LET_BE(Allgather,
       (const void *from, int count, MPI_Datatype type, void *to, int to_count, MPI_Datatype to_type, MPI_Comm comm),
       (from, count, type, to, to_count, to_type, comm))
LET_BE(Allgatherv,
       (const void *from, int count, MPI_Datatype type, void *to, const int to_counts[], const int places[],
        MPI_Datatype to_type, MPI_Comm comm),
       (from, count, type, to, to_counts, places, to_type, comm))
LET_BE(Allreduce, (const void *from, void *to, int count, MPI_Datatype type, MPI_Op op, MPI_Comm comm),
       (from, to, count, type, op, comm))
LET_BE(Alltoall,
       (const void *from, int count, MPI_Datatype type, void *to, int to_count, MPI_Datatype to_type, MPI_Comm comm),
       (from, count, type, to, to_count, to_type, comm))
LET_BE(Alltoallv,
       (const void *from, const int counts[], const int places[], MPI_Datatype type, void *to, const int to_counts[],
        const int to_places[], MPI_Datatype to_type, MPI_Comm comm),
       (from, counts, places, type, to, to_counts, to_places, to_type, comm))
LET_BE(Bcast, (void *data, int count, MPI_Datatype type, int root, MPI_Comm comm), (data, count, type, root, comm))
LET_BE(Comm_dup, (MPI_Comm comm, MPI_Comm *out), (comm, out))
LET_BE(Comm_free, (MPI_Comm * comm), (comm))
LET_BE(Comm_set_errhandler, (MPI_Comm comm, MPI_Errhandler handler), (comm, handler))
LET_BE(Comm_split_type, (MPI_Comm comm, int type, int key, MPI_Info info, MPI_Comm *out), (comm, type, key, info, out))
LET_BE(Error_string, (int error, char *text, int *length), (error, text, length))
LET_BE(Gather,
       (const void *from, int count, MPI_Datatype type, void *to, int to_count, MPI_Datatype to_type, int root,
        MPI_Comm comm),
       (from, count, type, to, to_count, to_type, root, comm))
LET_BE(Iallreduce,
       (const void *from, void *to, int count, MPI_Datatype type, MPI_Op op, MPI_Comm comm, MPI_Request *request),
       (from, to, count, type, op, comm, request))
LET_BE(Iprobe, (int rank, int tag, MPI_Comm comm, int *found, MPI_Status *status), (rank, tag, comm, found, status))
LET_BE(Irecv, (void *to, int count, MPI_Datatype type, int rank, int tag, MPI_Comm comm, MPI_Request *request),
       (to, count, type, rank, tag, comm, request))
LET_BE(Isend, (const void *from, int count, MPI_Datatype type, int rank, int tag, MPI_Comm comm, MPI_Request *request),
       (from, count, type, rank, tag, comm, request))
LET_BE(Issend, (const void *from, int count, MPI_Datatype type, int rank, int tag, MPI_Comm comm, MPI_Request *request),
       (from, count, type, rank, tag, comm, request))
LET_BE(Op_create, (MPI_User_function * function, int commutes, MPI_Op *op), (function, commutes, op))
LET_BE(Op_free, (MPI_Op * op), (op))
LET_BE(Recv, (void *to, int count, MPI_Datatype type, int rank, int tag, MPI_Comm comm, MPI_Status *status),
       (to, count, type, rank, tag, comm, status))
LET_BE(Send, (const void *from, int count, MPI_Datatype type, int rank, int tag, MPI_Comm comm),
       (from, count, type, rank, tag, comm))
LET_BE(Test, (MPI_Request * request, int *is_over, MPI_Status *status), (request, is_over, status))
LET_BE(Testall, (int count, MPI_Request requests[], int *are_over, MPI_Status statuses[]),
       (count, requests, are_over, statuses))
LET_BE(Wait, (MPI_Request * request, MPI_Status *status), (request, status))
LET_BE(Waitall, (int count, MPI_Request requests[], MPI_Status statuses[]), (count, requests, statuses))
