/* Memory reserved for code that cannot handle failed allocations.
 *
 * OpenImageIO, OpenEXR and the C++ library contain functions that are noexcept but allocate memory, for example for an
 * image's channel names, an attribute, or the next entry of a directory. They also contain lists that are filled only
 * once per process, and that stay incomplete if an allocation fails meanwhile. A failed allocation in such code
 * terminates the process or corrupts all later pictures. These allocations are small and use operator new. A reserve is
 * therefore held while such code runs. The first time operator new fails, the reserve is freed and operator new tries
 * again. If the reserve itself cannot be allocated, std::bad_alloc is thrown.
 *
 * The new-handler is global to the process, so another thread may use up the reserve. When the reserve is used up, the
 * previous handler is called. */
#ifndef ADAPTORS_MEMORY_RESERVE_H
#define ADAPTORS_MEMORY_RESERVE_H

#include <cstddef>

class memory_reserve
{
  public:
    /* Throws std::bad_alloc if the memory cannot be reserved. */
    explicit memory_reserve(std::size_t bytes);
    ~memory_reserve();
    memory_reserve(const memory_reserve &) = delete;
    memory_reserve &operator=(const memory_reserve &) = delete;
};

#endif
