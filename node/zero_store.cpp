#include "node/zero_store.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <iomanip>
#include <sstream>
#include <utility>

#include "config/options.hpp"
#include "config/seal.hpp"
#include "config/text_file.hpp"
#include "node/log.hpp"
#include "node/shm/folder.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {
namespace {

constexpr std::int64_t kFormat = 3, kWithoutLast = 2;
constexpr double kMaxNumber = 1e300;
constexpr std::size_t kMaxBytes = 1 << 20, kMaxKept = 256;
constexpr std::uint64_t kRetryNs = 1'000'000'000;  // after a write that failed
constexpr int kPatienceMs = 500;                   // for a daemon that is ending
constexpr char kInstalled[] = "/var/lib/tactiled";

std::string variable(const char* name) {
    const char* const value = std::getenv(name);
    return value != nullptr ? value : "";
}

std::string now_text() {
    return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}",
                       fmt::gmtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now())));
}

// Returns the time since then, in ns, at most ten years; that also where the text is no time, or the clock was before it.
std::int64_t age_ns(const std::string& then) {
    constexpr std::chrono::hours kLongest{24 * 3652};
    std::tm parts{};
    std::istringstream text(then);
    text >> std::get_time(&parts, "%Y-%m-%dT%H:%M:%SZ");
    const auto age = std::chrono::system_clock::now() - std::chrono::system_clock::from_time_t(timegm(&parts));
    const bool is_known = !text.fail() && age > -std::chrono::seconds(1) && age < kLongest;
    return std::chrono::nanoseconds(is_known ? std::max(age, age.zero()) : kLongest).count();
}

// A number that is not known is as large as the file can have.
std::string numbers_of(const Wrench& wrench) {
    std::vector<std::string> numbers;
    for (const double x : wrench) numbers.push_back(fmt::format("{:.17e}", x < kMaxNumber ? x : kMaxNumber));
    return fmt::format("{}", fmt::join(numbers, ", "));
}

// The numbers of a last force in the file.
std::array<std::pair<const char*, Wrench*>, 3> wrenches_of(LastForce& last) {
    return {{{"raw_S", &last.raw_S}, {"tolerance", &last.tolerance}, {"stepped", &last.stepped}}};
}

// The last force of a run that kept nothing but its samples, whose sd contains that of the zero.
std::optional<LastForce> last_force(const tactiled_sample& s) {
    constexpr double kSame = 2, kSure = 3;
    if ((s.reasons & (TACTILED_STEPPED | TACTILED_ZERO_UNKNOWN | TACTILED_UNKNOWN_UNCERTAINTY)) != 0 ||
        (s.state & TACTILED_LOW_PASS) != 0)
        return std::nullopt;
    LastForce last;
    last.raw_S = wrench_of(s.raw_force_S_N, s.raw_torque_S_Nm);
    last.tolerance = wrench_of(s.sd_force_N, s.sd_torque_Nm);
    for (std::size_t i = 0; i < last.tolerance.size(); ++i) {
        last.stepped[i] = kSure * last.tolerance[i];
        last.tolerance[i] *= kSame;
    }
    return last;
}

}  // namespace

std::map<std::string, tactiled_sample> samples_of_killed(const std::string& node_name) {
    std::map<std::string, tactiled_sample> samples;
    std::string why;
    const Segment segment = Segment::try_open(node_name, why, runtime_folder());
    if (!segment.is_open() || *segment.warning() != '\0') return samples;  // it may be forged
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) {
        tactiled_sample sample{};
        if (tactiled_ring_latest(segment.base(), &segment.sensor(i).ring, &sample, sizeof sample) != 0)
            samples[segment.sensor(i).name] = sample;
    }
    return samples;
}

ZeroFiles zero_files(const std::string& configured, const std::string& node_name) {
    if (!configured.empty()) return {configured, configured};
    if (const std::string state = variable("STATE_DIRECTORY"); !state.empty())
        return zero_files_in({state.substr(0, state.find(':'))}, node_name);
    std::vector<std::string> folders{kInstalled};
    if (const std::string own = variable("XDG_STATE_HOME"); !own.empty())
        folders.push_back(own + "/tactiled");
    else if (const std::string home = variable("HOME"); !home.empty())
        folders.push_back(home + "/.local/state/tactiled");
    return zero_files_in(folders, node_name);
}

ZeroFiles zero_files_in(const std::vector<std::string>& folders, const std::string& node_name) {
    ZeroFiles files;
    std::filesystem::file_time_type last;
    for (const std::string& folder : folders) {
        const std::string path = fmt::format("{}/{}.zeros.toml", folder, node_name);
        const bool is_last = &folder == &folders.back();
        if (files.written.empty() && (is_last || ::access(folder.c_str(), W_OK) == 0)) files.written = path;
        std::error_code error;
        const auto time = std::filesystem::last_write_time(path, error);
        if (error || (!files.read.empty() && time <= last)) continue;
        files.read = path;
        last = time;
    }
    if (files.read.empty()) files.read = files.written;
    return files;
}

// ---- start and reload --------------------------------------------------------------------------------------------------

ZeroStore::ZeroStore(ZeroFiles files, std::vector<ZeroOwner> owners)
    : path_(std::move(files.written)), lock_(path_ + ".lock"), owners_(std::move(owners)) {
    for (std::size_t i = 0; i < owners_.size(); ++i) sensor_of_owner_.push_back(i);
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::create_directories(std::filesystem::path(path_).parent_path(), ignored);
    if (!path_.empty() && lock_.take(kPatienceMs) == LockFile::State::busy)
        throw SetupError(
            fmt::format("{}: another daemon keeps its zeros there; give [node] zeros a path of its own", path_));
    load(files.read);
    write();
    thread_.start("zeros", 0, -1, [this] { serve(); });
}

ZeroStore::~ZeroStore() { end(); }

void ZeroStore::end() noexcept {
    stop_.store(true);
    work_.wake();
    thread_.join();
}

// A file that cannot be read may have contained a tare of any sensor, so every zero is marked as lost.
void ZeroStore::load(const std::string& path) {
    std::error_code ignored;  // symlink_status, because a dangling link is a file that cannot be read
    if (path.empty() || std::filesystem::symlink_status(path, ignored).type() == std::filesystem::file_type::not_found)
        return;
    Problems problems;
    if (const auto bytes = read_text_file(path, kMaxBytes, problems)) {
        const Seal seal = find_seal(*bytes);
        const std::string_view lines = std::string_view(*bytes).substr(0, seal.start);
        Options file = Options::parse_text(lines, path, problems);
        const std::int64_t format = file.integer("format", {1, 1e9});
        if (problems.empty() && format != kFormat && format != kWithoutLast)
            file.problem("format", fmt::format("this tactiled reads format = {}", kFormat));
        if (problems.empty() && seal.crc != crc_of_lines(lines))
            problems.add(path, 0, "the file is damaged: its last line should be the checksum crc of the lines above");
        for (auto& table : file.tables("sensor", kMaxKept)) {
            Kept kept;
            kept.sensor = table.text("name");
            kept.serial = table.text("serial", "");
            kept.id = std::uint32_t(table.integer("calibration_id", {0, double(UINT32_MAX)}));
            kept.time = table.text("time", "");
            kept.tare_count = std::uint32_t(table.integer("tare_count", {1, double(UINT32_MAX)}));
            for (auto& zero : table.tables("zero", MethodChoice::kMax)) {
                Wrench wrench{};
                const std::string method = zero.text("method");
                const auto numbers = zero.numbers("wrench_S", {-kMaxNumber, kMaxNumber}, {wrench.size(), wrench.size()});
                if (numbers.size() != wrench.size()) continue;
                std::copy(numbers.begin(), numbers.end(), wrench.begin());
                kept.of_method[method] = wrench;
            }
            for (auto& last : table.tables("last", 1)) {
                LastForce& force = kept.last.emplace();
                for (const auto& [key, to] : wrenches_of(force)) {
                    const auto numbers = last.numbers(key, {-kMaxNumber, kMaxNumber}, {to->size(), to->size()});
                    std::copy_n(numbers.begin(), std::min(numbers.size(), to->size()), to->begin());
                }
            }
            kept_.push_back(std::move(kept));
        }
        file.finish();
    }
    if (problems.empty()) return;
    log_line(LogLevel::warning, "{}; no zero is known: tare every sensor, or remove its tare", problems.lines().front());
    kept_.clear();
    for (const ZeroOwner& owner : owners_) kept_.push_back({owner.sensor, owner.serial, now_text(), 0, 1, {}, {}});
}

void ZeroStore::restore(std::vector<Sensor>& sensors, const std::map<std::string, tactiled_sample>& killed) {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < sensors.size(); ++i) {
        const ZeroOwner& owner = owners_[i];
        Kept* const kept = find(owner.sensor);
        const auto sample = killed.find(owner.sensor);
        if (kept == nullptr && sample != killed.end() && (sample->second.reasons & TACTILED_ZERO_UNKNOWN) != 0)
            sensors[i].lose_zero();
        if (kept == nullptr) continue;
        TaredZero zero;
        zero.tare_count = kept->tare_count;
        bool any = false;
        for (std::size_t k = 0; k < owner.methods.size() && k < zero.of_method.size(); ++k) {
            const auto found = kept->of_method.find(owner.methods[k]);
            if (found != kept->of_method.end())
                zero.of_method[k] = found->second, any = true;
            else
                zero.unknown |= 1u << k;
        }
        const bool same = any && kept->id == owner.id && kept->serial == owner.serial;
        if (same && owner.restore) {
            const bool has_value = sample != killed.end() && sample->second.quality != TACTILED_BAD;
            const std::optional<LastForce> of_file = std::exchange(kept->last, std::nullopt);  // it vouches for one start
            const std::optional<LastForce> last = has_value ? last_force(sample->second) : of_file;
            sensors[i].restore_zero(zero, age_ns(kept->time), last);
            log_line(LogLevel::info, "sensor \"{}\": the tare of {} is in force", owner.sensor, kept->time);
            continue;
        }
        sensors[i].lose_zero();
        log_line(LogLevel::warning, "sensor \"{}\": the tare of {} is not restored, {}; tare it, or remove its tare",
                 owner.sensor, kept->time,
                 !owner.restore ? "because of zero_after = \"forget\""
                 : !any         ? "because its zero is not known"
                                : "because the calibration, the serial or the channels are others");
    }
    write();
}

void ZeroStore::keep_last(const std::vector<Sensor>& sensors) {
    end();
    for (std::size_t i = 0; i < owners_.size(); ++i) {
        const ZeroOwner& owner = owners_[i];
        const Sensor& sensor = sensors[sensor_of_owner_[i]];
        if (sensor.zero_id() != owner.id) continue;  // an earlier configuration
        Kept* const kept = find(owner.sensor);
        if (kept != nullptr && kept->id == owner.id)
            kept->last = sensor.last_force();
        else if (kept == nullptr && sensor.doubts_zero())  // not tared, and unknown to the next run as well
            kept_.push_back({owner.sensor, owner.serial, now_text(), owner.id, 1, {}, {}});
    }
    write();
}

void ZeroStore::replace_owner(std::size_t index, ZeroOwner owner) {
    const std::lock_guard lock(mutex_);
    owners_.push_back(std::move(owner));
    sensor_of_owner_.push_back(index);
}

// ---- the pipeline's side -----------------------------------------------------------------------------------------------

void ZeroStore::add(std::uint32_t sensor, const Sensor& of) noexcept { add(sensor, of, of.tared_zero()); }

void ZeroStore::add_change(std::uint32_t sensor, const Sensor& of) noexcept { add(sensor, of, {1, ~0u, {}}); }

void ZeroStore::add(std::uint32_t sensor, const Sensor& of, const TaredZero& zero) noexcept {
    if (of.has_lost_zero()) return;  // a reload has exchanged the sensor; the file keeps its entry as tared
    Order* const order = orders_.claim();
    refused_ |= order == nullptr;
    if (order == nullptr) return;
    *order = {number_ + 1, sensor, of.zero_id(), zero};
    orders_.push();
    has_added_ = true;
}

std::uint32_t ZeroStore::commit() noexcept {
    orders_.commit();
    const bool refused = std::exchange(refused_, false);
    if (std::exchange(has_added_, false)) {
        ++number_;
        work_.wake();
    }
    return refused ? 0 : number_;
}

// ---- the store's thread ------------------------------------------------------------------------------------------------

void ZeroStore::serve() noexcept {
    std::uint64_t again_ns = 0;
    for (;;) {
        const std::uint32_t seen = work_.value();
        const bool stops = stop_.load();
        std::uint32_t number = 0;
        try {
            const std::lock_guard lock(mutex_);
            for (; const Order* order = orders_.front(); orders_.pop()) {
                take(*order);
                number = order->number;
            }
        } catch (const std::exception& error) {  // no memory: the file is not up to date
            log_line(LogLevel::warning, "{}: {}", path_, error.what());
            usable_.store(false, std::memory_order_release);
        }
        const std::uint64_t now_ns = monotonic_ns();
        if (number != 0 || (!is_usable() && now_ns >= again_ns)) {
            const std::lock_guard lock(mutex_);
            write();
            again_ns = now_ns + kRetryNs;
        }
        if (number != 0) done_.store(number, std::memory_order_release);  // after usable_
        if (stops) return;
        (void)work_.sleep(seen, is_usable() ? kNever_ns : again_ns);
    }
}

void ZeroStore::take(const Order& order) {
    const ZeroOwner* owner = nullptr;
    for (std::size_t i = 0; i < owners_.size(); ++i)
        if (sensor_of_owner_[i] == order.sensor && owners_[i].id == order.id) owner = &owners_[i];
    if (owner == nullptr) return;
    Kept kept{owner->sensor, owner->serial, now_text(), order.id, order.zero.tare_count, {}, {}};
    for (std::size_t k = 0; k < owner->methods.size() && k < order.zero.of_method.size(); ++k)
        if ((order.zero.unknown >> k & 1u) == 0) kept.of_method[owner->methods[k]] = order.zero.of_method[k];
    std::erase_if(kept_, [&](const Kept& each) { return each.sensor == kept.sensor; });
    if (order.zero.tare_count != 0) kept_.push_back(std::move(kept));
}

ZeroStore::Kept* ZeroStore::find(const std::string& sensor) {
    const auto found = std::find_if(kept_.begin(), kept_.end(), [&](const Kept& kept) { return kept.sensor == sensor; });
    return found != kept_.end() ? &*found : nullptr;
}

std::string ZeroStore::text() const {
    std::string out = fmt::format(
        "# The zeros of tares, restored when the daemon starts. Written by tactiled; N and Nm in the sensor's frame S.\n"
        "format = {}\n",
        kFormat);
    for (const Kept& kept : kept_) {
        out += fmt::format("\n[[sensor]]\nname = {}\nserial = {}\ncalibration_id = {}\ntime = {}\ntare_count = {}\n",
                           toml_text(kept.sensor), toml_text(kept.serial), kept.id, toml_text(kept.time), kept.tare_count);
        for (const auto& [method, wrench] : kept.of_method) {
            out += fmt::format("[[sensor.zero]]\nmethod = {}\nwrench_S = [{}]\n", toml_text(method), numbers_of(wrench));
        }
        if (kept.last)
            for (LastForce last = *kept.last; const auto& [key, wrench] : wrenches_of(last))
                out +=
                    fmt::format("{}{} = [{}]\n", wrench == &last.raw_S ? "[[sensor.last]]\n" : "", key, numbers_of(*wrench));
    }
    return sealed(out);
}

void ZeroStore::write() noexcept try {
    if (path_.empty()) throw SaveError("there is no folder to keep the zeros of tares in; give [node] zeros = \"/a/path\"");
    replace_file(path_, text());
    if (!complaint_.empty()) log_line(LogLevel::info, "{}: zeros of tares are kept again", path_);
    complaint_.clear();
    usable_.store(true, std::memory_order_release);
} catch (const std::exception& error) {
    usable_.store(false, std::memory_order_release);
    try {
        if (complaint_ != error.what())
            log_line(LogLevel::warning, "{}; tares are refused until it can be written", error.what());
        complaint_ = error.what();
    } catch (const std::exception&) {}  // no memory for the message
}

}  // namespace tactiled
