#include "memory_reserve.h"

#include <atomic>
#include <cstdlib>
#include <mutex>
#include <new>

namespace
{

std::atomic<void *> reserve;
std::atomic<std::new_handler> handler_before;
std::mutex lock; /* locked while a reserve exists, because there can be only one at a time */

/* Number of bytes left free in addition to the reserve, for allocations that do not use operator new: without memory,
 * the loader cannot allocate thread-local variables and terminates the process, and compressors fail. */
enum { SPARE_BYTES = 4 << 20 };

void release_reserve()
{
    void *block = reserve.exchange(nullptr);
    if (block) {
        std::free(block);
        return;
    }
    const std::new_handler before = handler_before;
    if (!before) throw std::bad_alloc();
    before();
}

} // namespace

memory_reserve::memory_reserve(std::size_t bytes)
{
    lock.lock();
    void *spare = std::malloc(SPARE_BYTES);
    void *block = std::malloc(bytes);
    std::free(spare);
    if (!spare || !block) {
        std::free(block);
        lock.unlock();
        throw std::bad_alloc();
    }
    reserve = block;
    handler_before = std::set_new_handler(release_reserve);
}

memory_reserve::~memory_reserve()
{
    if (std::get_new_handler() == release_reserve) std::set_new_handler(handler_before);
    std::free(reserve.exchange(nullptr));
    lock.unlock();
}
