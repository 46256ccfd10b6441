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
#include "drivers/descriptor.hpp"

namespace tactiled {

struct TaughtObject : grasp::Object {
    unsigned grasps = 0;  // number of grasps from which mass and sd were computed
    bool scaled = false;  // weighed after a known weight had set the scale; a restart of the daemon loses the scale
};

// Excludes the other writer from before the file is read until it is replaced.
class ObjectsLock {
public:
    // Waits for the other writer. setup: throws SetupError where no file can be created beside `path`
    explicit ObjectsLock(const std::string& path);

private:
    Descriptor fd_;
};

// Reads the file. A missing file has no objects and is not a problem. With problems, the result must not be used.
// setup: never throws for bad input
std::vector<TaughtObject> load_objects(const std::string& path, Problems& problems);
// setup: throws SetupError where the file cannot be replaced; the old file is then unchanged
void store_objects(const std::string& path, std::span<const TaughtObject> objects);

inline constexpr double kApart_sd = 3;

// One weight of a grasp, as published.
struct Weighing {
    double mass_kg = 0, sd_kg = 0;
    bool scaled = false;
};
Weighing weighing_of(const tactiled_grasp& grasp);
// Returns true if the weighing is valid for the file and its mass is more than kApart_sd standard deviations above 0.
bool is_teachable(const Weighing& weighing);

// Returns the mean and the sd over the grasps. The sd is at least the largest stated sd. At least one weighing is needed.
TaughtObject summary_of(std::span<const Weighing> weighings);
// Returns `object` with one more grasp. If the scale has changed, the result is from this grasp alone.
TaughtObject with_one_more(const TaughtObject& object, const Weighing& weighing);

// Two objects of one scale can be distinguished if their ranges of 3 sd do not overlap: with normally distributed weights, 1
// in 700 is nearer to the other object.
struct Confusion {
    const TaughtObject* other = nullptr;
    double apart_sd = 0;  // difference of the means / (sd + other's sd)
};
// Returns the nearest object of `taught` with another id than `object`, if it cannot be distinguished from `object`.
std::optional<Confusion> confused_with(const TaughtObject& object, std::span<const TaughtObject> taught);

// Adds one grasp to the object number `id` or, if `id` is 0, to the object named `name`. An object that is not in the file
// is added. Returns the new content of the file.
// setup: throws SetupError where the weight cannot be distinguished from 0 or from another object, or the file cannot be
// read or replaced
std::vector<TaughtObject> teach_grasp(const std::string& path, std::uint32_t id, const std::string& name,
                                      const Weighing& weighing);

// Return the object of that name, or nullptr, and the smallest free id.
const TaughtObject* find_object(std::span<const TaughtObject> taught, std::string_view name);
std::uint32_t free_id(std::span<const TaughtObject> taught);

}  // namespace tactiled
