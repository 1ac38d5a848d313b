/* The status that a call returns. It stands apart from insitu.h so that code without MPI can use it. */
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
    INSITU_ERROR_ARGUMENT = 1, /* a null pointer, an unknown enum value, a negative count */
    INSITU_ERROR_SCENE = 2,    /* the scene file: unreadable, an unknown key, a wrong type, a value out of range */
    INSITU_ERROR_MESH = 3,     /* a mesh: an index out of range, a coordinate that is not finite, an unknown cell type */
    INSITU_ERROR_FIELD = 4,    /* a field: missing, of the wrong length, of the wrong centring */
    INSITU_ERROR_IO = 5,       /* an image could not be written */
    INSITU_ERROR_MEMORY = 6,   /* an allocation failed */
    INSITU_ERROR_MPI = 7,      /* MPI returned an error, or ranks disagree on what was called */
    INSITU_ERROR_INTERNAL = 8  /* a fault of the library's own */
} insitu_status;

#endif
