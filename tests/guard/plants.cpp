// Breaks one rule on purpose inside an armed section, so that a test can see the guard find it: RTGUARD_PLANT=name, in the
// thread RTGUARD_PLANT_THREAD ("pipeline"). Without the variable it does nothing.
#include <fcntl.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/guard/guard.hpp"

namespace {

volatile std::size_t sink;
std::unique_ptr<int> doomed = std::make_unique<int>(1);
std::mutex mutex;
std::shared_mutex shared_mutex;
pthread_spinlock_t spin;
std::vector<int> growing;

struct alignas(256) Aligned {
    char bytes[256];
};

struct Plant {
    const char* name;
    void (*act)();
};
const Plant plants[] = {
    {"string", [] { sink = std::string(64, 'x').size(); }},
    {"vector", [] { growing.push_back(1), growing.shrink_to_fit(); }},
    {"function",
     [] {
         char capture[64] = {};
         const std::function<int()> f = [capture] { return int(capture[0]); };
         sink = std::size_t(f());
     }},
    {"aligned_new",
     [] {
         const auto aligned = std::make_unique<Aligned>();
         sink = reinterpret_cast<std::size_t>(aligned.get());  // else the compiler leaves both out
     }},
    {"free", [] { doomed.reset(); }},
    {"throw",
     [] {
         try {
             throw std::runtime_error("planted");
         } catch (const std::exception& error) { sink = std::strlen(error.what()); }
     }},
    {"mutex", [] { const std::lock_guard<std::mutex> lock(mutex); }},
    {"shared_mutex", [] { const std::shared_lock<std::shared_mutex> lock(shared_mutex); }},
    {"spin_lock", [] { pthread_spin_lock(&spin), pthread_spin_unlock(&spin); }},
    {"write", [] { (void)!::write(-1, "", 0); }},
    {"fprintf", [] { std::fprintf(stderr, "."); }},
    {"usleep", [] { ::usleep(1); }},
    {"open", [] { ::close(::open("/dev/null", O_RDONLY | O_CLOEXEC)); }},
    {"untouched_page",
     [] {
         static char* pages =
             static_cast<char*>(::mmap(nullptr, 1 << 24, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
         static std::size_t at = 0;
         pages[at += 4096] = 1;
     }},
    {"localtime",
     [] {
         const time_t now = 0;
         tm parts;
         sink = std::size_t(localtime_r(&now, &parts)->tm_year);
     }},
    {"clock",
     [] {  // a control: the vDSO is no system call
         timespec t;
         clock_gettime(CLOCK_MONOTONIC, &t);
         sink = std::size_t(t.tv_nsec);
     }},
};

const Plant* chosen = nullptr;
const char* thread_name = "pipeline";

__attribute__((constructor)) void choose() {
    pthread_spin_init(&spin, 0);
    if (const char* thread = std::getenv("RTGUARD_PLANT_THREAD")) thread_name = thread;
    const char* name = std::getenv("RTGUARD_PLANT");
    for (const Plant& plant : plants)
        if (name != nullptr && std::strcmp(plant.name, name) == 0) chosen = &plant;
    if (name != nullptr && chosen == nullptr) {
        std::fprintf(stderr, "rtguard: no plant \"%s\"\n", name);
        ::_exit(2);
    }
}

}  // namespace

extern "C" void rtguard_plant() {
    if (chosen != nullptr && rtguard_is_planting_time() && std::strcmp(rtguard_thread_name(), thread_name) == 0)
        chosen->act();
}
