/* Memory set aside for code that cannot cope with failed allocations.
 *
 * OpenImageIO, OpenEXR and the C++ library have functions that may not throw and yet allocate (an image's channel
 * names, an attribute, the next name in a folder), and lists that they register once and leave half done if that fails.
 * A failed allocation there ends the process or spoils all later pictures. These allocations are small and made by
 * operator new. So a reserve is held while such code runs; when operator new first fails, it is given back to the heap,
 * and operator new tries again. Failing to get the reserve counts as lack of memory.
 *
 * The new-handler belongs to the process: another thread may spend the reserve while it is held. When the reserve is
 * gone, the handler from before is called. */
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
