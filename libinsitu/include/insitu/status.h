/* The status that a call returns. It has a header of its own so that code without MPI can use it. */
#ifndef INSITU_STATUS_H
#define INSITU_STATUS_H

#if defined(_WIN32)
#define INSITU_API
#else
#define INSITU_API __attribute__((visibility("default")))
#endif

/* Every status but INSITU_OK has a message in insitu_error(). */
typedef enum insitu_status {
    INSITU_OK = 0,
    INSITU_ERROR_ARGUMENT = 1, /* an invalid argument: a null pointer, an unknown enum value, a negative count */
    /* an error in the scene file: unreadable, an unknown key, a wrong type, a value out of range */
    INSITU_ERROR_SCENE = 2,
    /* an error in a mesh: an index out of range, a coordinate that is not finite, an unknown cell type */
    INSITU_ERROR_MESH = 3,
    INSITU_ERROR_FIELD = 4,   /* an error in a field: missing, of the wrong length, of the wrong centring */
    INSITU_ERROR_IO = 5,      /* an image could not be written */
    INSITU_ERROR_MEMORY = 6,  /* an allocation failed */
    INSITU_ERROR_MPI = 7,     /* MPI is not running or returned an error, or ranks have made different calls */
    INSITU_ERROR_INTERNAL = 8 /* an error in the library itself */
} insitu_status;

#endif
