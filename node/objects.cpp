#include "node/objects.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "config/names.hpp"
#include "config/text_file.hpp"

namespace tactiled {
namespace {

constexpr std::int64_t kFormat = 1;
constexpr double kMinKg = 1e-9, kMaxKg = 1000;
constexpr std::int64_t kMaxId = 65534;  // OBJECT_ID is a register

TaughtObject read_object(Options table) {
    TaughtObject object;
    object.id = std::uint32_t(table.integer("id", {1, double(kMaxId)}));
    object.name = table.text("name");
    object.mass_kg = table.number("mass_kg", {kMinKg, kMaxKg});
    object.sd_kg = table.number("sd_kg", {kMinKg, kMaxKg});
    object.grasps = unsigned(table.integer("grasps", {1, 1e9}, 1));
    object.scaled = table.flag("scaled", false);
    if (!object.name.empty() && !valid_name(object.name))
        table.problem("name", fmt::format("name = {}; {}", in_quotes(object.name), kValidName));
    return object;
}

}  // namespace

ObjectsLock::ObjectsLock(const std::string& path) {
    const std::string beside = path + ".lock";  // a separate file, because the file itself is replaced
    fd_.reset(::open(beside.c_str(), O_RDONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644));
    while (fd_ >= 0) {
        if (::flock(fd_, LOCK_EX) == 0) return;
        if (errno != EINTR) break;
    }
    throw SetupError(fmt::format("{}: {}", beside, std::strerror(errno)));
}

std::vector<TaughtObject> load_objects(const std::string& path, Problems& problems) {
    std::vector<TaughtObject> objects;
    if (!is_text_file_there(path)) return objects;
    Options file = Options::parse_file(path, problems);
    if (!problems.empty()) return objects;
    if (file.integer("format", {1, 1e9}) != kFormat)
        file.problem("format", fmt::format("this tactiled reads format = {}", kFormat));
    for (auto& table : file.tables("object", grasp::Grasp::kMaxObjects)) {
        TaughtObject object = read_object(table);
        for (const auto& other : objects) {
            if (other.id == object.id)
                table.problem("id", fmt::format("id = {} is that of \"{}\" already", object.id, other.name));
            if (other.name == object.name)
                table.problem("name", fmt::format("name = {} is there twice", in_quotes(object.name)));
        }
        objects.push_back(std::move(object));
    }
    file.finish();
    return objects;
}

void store_objects(const std::string& path, std::span<const TaughtObject> objects) {
    std::string text = fmt::format(
        "# Objects that the gripper was taught. Written by tactilectl teach and by the register TEACH; whoever edits it by "
        "hand "
        "has\n# the daemon read it with: tactilectl teach --reload\nformat = {}\n",
        kFormat);
    for (const auto& object : objects)
        text += fmt::format(
            "\n[[object]]\nid = {}\nname = \"{}\"\nmass_kg = {:.9g}\nsd_kg = {:.9g}\ngrasps = {}\n{}", object.id,
            object.name, object.mass_kg, object.sd_kg, object.grasps,
            object.scaled ? "scaled = true  # by a known weight: recognised only after one was shown again\n" : "");
    replace_file(path, text);
}

Weighing weighing_of(const tactiled_grasp& g) { return {g.weight_kg, g.weight_sd_kg, g.scale_shown != 0}; }

bool is_teachable(const Weighing& w) { return w.mass_kg > kApart_sd * w.sd_kg && w.mass_kg <= kMaxKg && w.sd_kg >= kMinKg; }

TaughtObject summary_of(std::span<const Weighing> weighings) {
    TaughtObject object;
    object.grasps = unsigned(weighings.size());
    const double n = double(weighings.size());
    double squares = 0, claimed = 0;
    for (const auto& w : weighings) object.mass_kg += w.mass_kg / n;
    for (const auto& w : weighings) {
        squares += (w.mass_kg - object.mass_kg) * (w.mass_kg - object.mass_kg);
        claimed = std::max(claimed, w.sd_kg);
    }
    object.scaled = !weighings.empty() && weighings.front().scaled;
    object.sd_kg = std::max(n > 1 ? std::sqrt(squares / (n - 1)) : 0.0, claimed);
    return object;
}

TaughtObject with_one_more(const TaughtObject& object, const Weighing& weighing) {
    TaughtObject more = object;
    if (weighing.scaled != object.scaled) {
        more.mass_kg = weighing.mass_kg;
        more.sd_kg = weighing.sd_kg;
        more.scaled = weighing.scaled;
        more.grasps = 1;
        return more;
    }
    const double n = double(++more.grasps), step = weighing.mass_kg - object.mass_kg;
    more.mass_kg += step / n;
    const double squares = object.sd_kg * object.sd_kg * (n - 2) + step * (weighing.mass_kg - more.mass_kg);  // Welford 1962
    more.sd_kg = std::max(std::sqrt(squares / (n - 1)), weighing.sd_kg);
    return more;
}

std::optional<Confusion> confused_with(const TaughtObject& object, std::span<const TaughtObject> taught) {
    std::optional<Confusion> nearest;
    for (const auto& other : taught) {
        if (other.id == object.id || other.scaled != object.scaled) continue;
        const double apart_sd = std::abs(object.mass_kg - other.mass_kg) / (object.sd_kg + other.sd_kg);
        if (apart_sd < (nearest ? nearest->apart_sd : kApart_sd)) nearest = {&other, apart_sd};
    }
    return nearest;
}

const TaughtObject* find_object(std::span<const TaughtObject> taught, std::string_view name) {
    const auto found = std::find_if(taught.begin(), taught.end(), [&](const auto& o) { return o.name == name; });
    return found != taught.end() ? &*found : nullptr;
}

std::uint32_t free_id(std::span<const TaughtObject> taught) {
    std::uint32_t id = 1;
    while (std::any_of(taught.begin(), taught.end(), [&](const auto& o) { return o.id == id; })) ++id;
    return id;
}

std::vector<TaughtObject> teach_grasp(const std::string& path, std::uint32_t id, const std::string& name,
                                      const Weighing& weighing) {
    if (!is_teachable(weighing))
        throw SetupError(
            fmt::format("{:.4f} kg, sd {:.4f} kg, does not differ from 0 by 3 sd", weighing.mass_kg, weighing.sd_kg));
    const ObjectsLock lock(path);
    Problems problems;
    std::vector<TaughtObject> taught = load_objects(path, problems);
    problems.throw_if_any();
    TaughtObject* known = nullptr;
    for (auto& object : taught)
        if (id != 0 ? object.id == id : object.name == name) known = &object;
    TaughtObject object = known != nullptr ? with_one_more(*known, weighing) : summary_of({&weighing, 1});
    if (known == nullptr) {
        object.id = id != 0 ? id : free_id(taught);
        object.name = name;
    }
    if (const auto confusion = confused_with(object, taught))
        throw SetupError(fmt::format(
            "it cannot be distinguished from object {} (\"{}\"): their weights are {:.1f} sd of each apart, {:g} are "
            "needed",
            confusion->other->id, confusion->other->name, confusion->apart_sd, kApart_sd));
    if (known != nullptr)
        *known = object;
    else if (taught.size() < grasp::Grasp::kMaxObjects)
        taught.push_back(object);
    else
        throw SetupError(fmt::format("{} objects are taught, no more fit", taught.size()));
    store_objects(path, taught);
    return taught;
}

}  // namespace tactiled
