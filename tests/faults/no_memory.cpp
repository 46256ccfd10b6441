// libno_memory.so: preloaded into the release daemon, it refuses allocations that another program names. NO_MEMORY is a file
// of five numbers of 64 bits, shared with that program (memory_test.py):
//   0  refuse those from this number on, counted from 1; 0: none     1  and so many of them
//   2  only those of the first thread, where not 0                  3  counted so far     4  refused so far
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
}

namespace {

enum Field { kFrom, kHowMany, kFirstThread, kCounted, kRefused, kFields };
using Page = std::atomic<std::uint64_t>[kFields];
using Main = int (*)(int, char**, char**);
Page* page = nullptr;  // set once, before the program's first thread
Main program;

void share() {
    const char* const path = std::getenv("NO_MEMORY");
    const int fd = path != nullptr ? ::open(path, O_RDWR | O_CLOEXEC) : -1;
    if (fd < 0) return;
    void* const at = ::mmap(nullptr, sizeof(Page), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    ::close(fd);
    if (at != MAP_FAILED) page = static_cast<Page*>(at);
}

bool is_refused() {
    if (page == nullptr) return false;
    Page& p = *page;
    if (p[kFirstThread] != 0 && ::gettid() != ::getpid()) return false;
    const std::uint64_t number = ++p[kCounted], from = p[kFrom];
    if (from == 0 || number < from || number - from >= p[kHowMany]) return false;
    ++p[kRefused];
    errno = ENOMEM;
    return true;
}

int shared_main(int count, char** words, char** environment) {
    share();
    return program(count, words, environment);
}

}  // namespace

extern "C" {

// From main() on: before it there is no file and no segment that could be left incomplete.
int __libc_start_main(Main main, int count, char** words, void (*begin)(), void (*end)(), void (*loader_end)(),
                      void* stack) {
    using Start = int (*)(Main, int, char**, void (*)(), void (*)(), void (*)(), void*);
    program = main;
    return reinterpret_cast<Start>(::dlsym(RTLD_NEXT, "__libc_start_main"))(shared_main, count, words, begin, end,
                                                                            loader_end, stack);
}

void* malloc(std::size_t size) { return is_refused() ? nullptr : __libc_malloc(size); }
void* calloc(std::size_t n, std::size_t size) { return is_refused() ? nullptr : __libc_calloc(n, size); }
void* realloc(void* old, std::size_t size) { return is_refused() ? nullptr : __libc_realloc(old, size); }
void* memalign(std::size_t alignment, std::size_t size) { return is_refused() ? nullptr : __libc_memalign(alignment, size); }
void* aligned_alloc(std::size_t alignment, std::size_t size) { return memalign(alignment, size); }
int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
    void* const memory = memalign(alignment, size);
    if (memory == nullptr) return ENOMEM;
    *out = memory;
    return 0;
}

}  // extern "C"
