/* Memory set aside for code that cannot do without.
 *
 * OpenImageIO, OpenEXR and the C++ library have functions that may not throw and yet allocate (of an image's channel
 * names, of an attribute, of the next name of a folder), and lists that they register once and leave half done where
 * that fails. There an allocation that fails ends the process or spoils all later pictures. They are all small and made
 * by operator new; so a reserve is held while such code runs, and given back to the heap when operator new first fails,
 * which then tries again. Where the reserve cannot be had there is no memory to begin with.
 *
 * The handler is the process's: for as long as a reserve is held another thread may spend it; what handler there was
 * before is called when it is gone. */
#ifndef ADAPTORS_MEMORY_RESERVE_H
#define ADAPTORS_MEMORY_RESERVE_H

#include <cstddef>

class memory_reserve
{
  public:
    /* Throws std::bad_alloc. */
    explicit memory_reserve(std::size_t bytes);
    ~memory_reserve();
    memory_reserve(const memory_reserve &) = delete;
    memory_reserve &operator=(const memory_reserve &) = delete;
};

#endif
