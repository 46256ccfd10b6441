// The file of taught objects. The writers (tactilectl teach, the register TEACH) and the reader (the daemon) use
// these functions.
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
    unsigned grasps = 0;  // number of grasps behind mass and sd
    bool scaled = false;  // weighed after a known weight had set the scale, which is lost at a restart of the daemon
};

// Held from reading the file to replacing it, because there are two writers.
class ObjectsLock {
public:
    // Waits for the other writer. setup: throws SetupError where no file can be created beside `path`
    explicit ObjectsLock(const std::string& path);
    ~ObjectsLock();
    ObjectsLock(const ObjectsLock&) = delete;
    ObjectsLock& operator=(const ObjectsLock&) = delete;

private:
    int fd_;
};

// Reads the file. A missing file has no objects and is not a problem. With problems, the result must not be used.
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
// Returns true if it is certainly the weight of an object: more than kApart_sd above 0, and valid for the file.
bool is_teachable(const Weighing& weighing);

// Returns mean and sd from grasp to grasp; the sd is at least the one that the weighings state. At least one weighing
// is needed.
TaughtObject summary_of(std::span<const Weighing> weighings);
// Returns `object` with one more grasp; if its scale was another one, from this grasp alone.
TaughtObject with_one_more(const TaughtObject& object, const Weighing& weighing);

// Two objects of one scale can be distinguished if the ranges of 3 sd do not overlap: of normal weights, 1 in 700 is
// nearer to the other object.
struct Confusion {
    const TaughtObject* other = nullptr;
    double apart_sd = 0;  // difference of the means / (sd + other's sd)
};
// Returns the object of `taught`, without the one of `object`'s own id, that is nearest to it, if it is too near.
std::optional<Confusion> confused_with(const TaughtObject& object, std::span<const TaughtObject> taught);

// Adds one more grasp to the object number `id` or, if that is 0, to the one named `name`; an object that is not in
// the file is a new one. Returns the new content of the file.
// setup: throws SetupError where the weight may be nothing or another object's, or the file cannot be read or replaced
std::vector<TaughtObject> teach_grasp(const std::string& path, std::uint32_t id, const std::string& name,
                                      const Weighing& weighing);

// Return the object of that name, or nullptr; and the smallest free id.
const TaughtObject* find_object(std::span<const TaughtObject> taught, std::string_view name);
std::uint32_t free_id(std::span<const TaughtObject> taught);

}  // namespace tactiled
