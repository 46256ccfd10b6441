// The file of taught objects: who writes it (tactilectl teach, the register TEACH) and who reads it (the daemon) do so here.
#pragma once
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/options.hpp"
#include "decoupling/grasp/grasp.hpp"

namespace tactiled {

struct TaughtObject : grasp::Object {
    unsigned grasps = 0;  // that mass and sd are of
    bool scaled = false;  // weighed after a known weight had set the scale, which a restart of the daemon forgets
};

// Held from reading the file to replacing it: there are two who do so.
class ObjectsLock {
public:
    // Waits for the other one. setup: throws SetupError where no file can be made beside `path`
    explicit ObjectsLock(const std::string& path);
    ~ObjectsLock();
    ObjectsLock(const ObjectsLock&) = delete;
    ObjectsLock& operator=(const ObjectsLock&) = delete;

private:
    int fd_;
};

// A file that is not there teaches nothing and is no problem. With problems, the result is not fit to use.
// setup: never throws for bad input
std::vector<TaughtObject> load_objects(const std::string& path, Problems& problems);
// setup: throws SetupError where the file cannot be replaced; then the old one stands as it was
void store_objects(const std::string& path, std::span<const TaughtObject> objects);

inline constexpr double kApart_sd = 3;

// One weight of a grasp, as published.
struct Weighing {
    double mass_kg = 0, sd_kg = 0;
    bool scaled = false;
};
Weighing weighing_of(const tactiled_grasp& grasp);
// True if it is surely the weight of an object: more than kApart_sd above 0, and the file takes it.
bool is_teachable(const Weighing& weighing);

// Mean and sd from grasp to grasp; the sd is at least what the weighings themselves claim. At least one of them.
TaughtObject summary_of(std::span<const Weighing> weighings);
// `object` with one more grasp of it; where that was of another scale, from this grasp alone.
TaughtObject with_one_more(const TaughtObject& object, const Weighing& weighing);

// Two objects of one scale are told apart where 3 sd of the one and 3 sd of the other do not meet: of normal weights, 1 in
// 700 lies nearer to the other one.
struct Confusion {
    const TaughtObject* other = nullptr;
    double apart_sd = 0;  // difference of the means / (sd + other's sd)
};
// The object of `taught`, but for the one of `object`'s own id, that is nearest to it, where that is too near.
std::optional<Confusion> confused_with(const TaughtObject& object, std::span<const TaughtObject> taught);

// One more grasp of the object number `id`, or, where that is 0, of the one named `name`; an object that is not in the file
// is a new one. Returns what is in the file then.
// setup: throws SetupError where the weight may be nothing or another object's, or the file cannot be read or replaced
std::vector<TaughtObject> teach_grasp(const std::string& path, std::uint32_t id, const std::string& name,
                                      const Weighing& weighing);

// The one of that name, or nullptr; and the least id that is free.
const TaughtObject* find_object(std::span<const TaughtObject> taught, std::string_view name);
std::uint32_t free_id(std::span<const TaughtObject> taught);

}  // namespace tactiled
