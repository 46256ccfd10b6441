#include "world.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <climits>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "clock.hpp"

namespace tactiled::faults {
namespace {

constexpr std::uint64_t kMostPauseMs = 1000;

// Links 0 (binary) and 1 (text) carry one sensor, link 2 (binary) two. Files of this process; a planted one is its own.
std::string configuration(const std::string& name, const Plant* plant) {
    static const std::string folder = [] {
        const std::string made = fmt::format("/tmp/world-{}", ::getpid());
        std::filesystem::create_directory(made);
        std::ofstream(made + "/unit.toml")
            << "format = 1\nmodel = \"generic\"\nmethod = \"matrix\"\nchannels = [\"a\", \"b\", \"c\"]\n"
               "channel_unit = \"counts\"\nzero = [0.0, 0.0, 0.0]\ncomponents = [\"fx\", \"fy\", \"fz\"]\n"
               "matrix = [[0.001, 0.0, 0.0], [0.0, 0.001, 0.0], [0.0, 0.0, 0.001]]\nsd = [0.01, 0.01, 0.01]\n"
               "full_scale = [500.0, 500.0, 500.0]\n";
        return made;
    }();
    const std::string path = folder + (plant == nullptr ? "/tactiled.toml" : "/planted.toml");
    if (plant == nullptr && std::filesystem::exists(path)) return path;
    std::string text =
        fmt::format("[node]\nname = \"{}\"\n[modbus]\nlisten = \"\"\nsettings = \"{}/settings.toml\"\n", name, folder);
    for (unsigned link = 0; link < kLinks; ++link)
        text += fmt::format(
            "[[link]]\nname = \"l{}\"\ndriver = \"uart\"\ndevice = \"/dev/none\"\n{}", link,
            link == 1 ? "format = \"lines\"\nchannels = 3\nsequence = true\nchecksum = true\n" : "format = \"cobs\"\n");
    for (unsigned i = 0; i < kSensors; ++i)
        text += fmt::format(
            "[[sensor]]\nname = \"s{}\"\nlink = \"l{}\"\ndevice = {}\nmodel = \"generic\"\ncalibration = \"unit.toml\"\n"
            "stale_ms = {}\nfrozen_after = {}\nslew_limit_per_s = 1e5\nrate_Hz = 250\nsaturates_at = [-8388608, 8388607]\n",
            i, World::link_of(i), i == 3 ? 1 : 0, kStaleMs, kFrozenAfter);
    if (plant != nullptr && !plant->configuration[0].empty())
        for (std::size_t at = 0; (at = text.find(plant->configuration[0], at)) != text.npos;
             at += plant->configuration[1].size())
            text.replace(at, plant->configuration[0].size(), plant->configuration[1]);
    std::ofstream(path) << text;
    return path;
}

}  // namespace

World::World(std::uint64_t seed, const Plant* plant)
    : random_(seed), plant_(plant), name_(fmt::format("world-{}", ::getpid())) {
    world_ns = 1'000'000'000'000;
    for (unsigned link = 0; link < kLinks; ++link) {
        auto cable = std::make_unique<Cable>(link == 1);
        cables_[link] = cable.get();
        unused_[link] = std::move(cable);
    }
    for (unsigned i = 0; i < kSensors; ++i) {
        const auto first = std::uint32_t(random_());
        devices_[i] = std::make_unique<Device>(i, i == 3 ? 1 : 0, *cables_[link_of(i)], i == 1 ? first >> 1 : first & 0x7FFF,
                                               world_ns + random_() % kPeriodNs);
    }
    start();
    witness_ = std::make_unique<Witness>(name_, node_->config.modbus, plc_, findings_);
}

World::~World() {
    if (is_running()) stop();
    if (map_ != nullptr) ::munmap(map_, map_size_);
}

void World::start() {
    Problems problems;
    node_ = std::make_unique<Node>(load_node(configuration(name_, plant_), problems));
    if (!problems.empty()) throw std::runtime_error(problems.lines().front());
    if (plant_ != nullptr && plant_->setup) plant_->setup(*node_);
    for (unsigned link = 0; link < kLinks; ++link) node_->links[link]->driver = std::move(unused_[link]);
    segment_ = std::make_unique<SegmentWriter>(node_->plan);
    pipeline_ = std::make_unique<Pipeline>(node_->links, node_->sensors, *segment_, 0);
    pipeline_->start(world_ns);
    segment_->set_state(TACTILED_RUNNING);
    threads_ = {};
    next_turn_ns_ = world_ns;
    suffer(UINT_MAX, world_ns + 100 * kMs);
    planted_ = {};
    before_ = {};
    if (plant_ == nullptr) return;
    if (map_ != nullptr) ::munmap(map_, map_size_);
    const int fd = ::open(("/dev/shm/tactiled." + name_).c_str(), O_RDWR | O_CLOEXEC);
    struct stat status {};
    ::fstat(fd, &status);
    map_size_ = std::size_t(status.st_size);
    map_ = static_cast<char*>(::mmap(nullptr, map_size_, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0));
    ::close(fd);
}

void World::take_cables_back() {
    for (unsigned link = 0; link < kLinks; ++link) {
        cables_[link]->close();
        unused_[link] = std::move(node_->links[link]->driver);
    }
    pipeline_.reset();
    node_.reset();
}

void World::stop() {
    pipeline_->stop(world_ns);
    segment_.reset();
    take_cables_back();
}

// As the kernel leaves it: descriptors and mappings of the process are gone, the file keeps its name and its last words.
void World::kill() {
    struct stat named {};
    ::stat(("/dev/shm/tactiled." + name_).c_str(), &named);
    std::ifstream maps("/proc/self/maps");
    for (std::string line; std::getline(maps, line);) {
        unsigned long begin = 0, end = 0, inode = 0;
        char rights[8] = "";
        if (std::sscanf(line.c_str(), "%lx-%lx %7s %*s %*s %lu", &begin, &end, rights, &inode) == 4 &&
            inode == named.st_ino && rights[1] == 'w' && reinterpret_cast<char*>(begin) != map_)
            ::munmap(reinterpret_cast<void*>(begin), end - begin);
    }
    std::vector<int> fds;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
        const int fd = std::stoi(entry.path().filename().string());
        struct stat open {};
        std::error_code unused;
        const bool wake =
            std::filesystem::read_symlink(entry.path(), unused).string().find("tactiled-wake") != std::string::npos;
        if (::fstat(fd, &open) == 0 && (wake || (open.st_ino == named.st_ino && open.st_dev == named.st_dev)))
            fds.push_back(fd);
    }
    for (const int fd : fds) ::close(fd);
    (void)segment_.release();
    take_cables_back();
}

void World::restart() {
    if (is_running()) return;
    start();
}

void World::suffer(unsigned link, std::uint64_t until_ns) {
    for (unsigned i = 0; i < kSensors; ++i)
        if (link == UINT_MAX || link_of(i) == link) suffers_until_ns_[i] = std::max(suffers_until_ns_[i], until_ns);
}

void World::stall_pipeline(std::uint64_t ms) { stalled_until_ns_ = std::max(stalled_until_ns_, world_ns + ms * kMs); }

void World::unplug(unsigned link) {
    cables_[link]->plugged = false;
    for (unsigned i = 0; i < kSensors; ++i)
        if (link_of(i) == link) gone_since_ns_[i] = world_ns;
}

void World::plug(unsigned link) {
    cables_[link]->plugged = true;
    for (unsigned i = 0; i < kSensors; ++i)
        if (link_of(i) == link) gone_since_ns_[i] = 0;
}

void World::run_ms(std::uint64_t ms) {
    std::array<Device*, kSensors> devices{};
    for (unsigned i = 0; i < kSensors; ++i) devices[i] = devices_[i].get();
    for (; ms > 0; --ms) {
        const std::uint64_t began_ns = world_ns;
        if (plant_ != nullptr && plant_->devices) plant_->devices(devices);
        for (auto& device : devices_) device->send(world_ns, random_);
        std::array<unsigned, kLinks + 1> actors{0, 1, 2, kLinks};
        std::shuffle(actors.begin(), actors.end(), random_);
        for (const unsigned actor : actors) {
            world_ns += random_() % 150'000;
            if (!is_running()) continue;
            actor < kLinks ? turn_link(actor) : turn_pipeline();
        }
        Expectation expected;
        expected.plc_reads = ++turns_ % 10 == 0;
        for (unsigned i = 0; i < kSensors; ++i) {
            expected.may_suffer[i] = world_ns < suffers_until_ns_[i];
            if (gone_since_ns_[i] != 0 && is_running())
                expected.gone_since[i] = std::max(gone_since_ns_[i], stalled_until_ns_);
        }
        witness_->look(devices, expected);
        world_ns = began_ns + kMs;
    }
}

// What Threads::run_link() does: reads what there is, opens again with a pause that grows.
void World::turn_link(unsigned index) {
    Link& link = *node_->links[index];
    LinkThread& thread = threads_[index];
    if (!thread.open) {
        if (world_ns < thread.retry_ns) return;
        if (!link.driver->open().empty()) {
            thread.retry_ns = world_ns + thread.pause_ms * kMs;
            thread.pause_ms = std::min(2 * thread.pause_ms, kMostPauseMs);
            return;
        }
        thread.open = true;
        ++link.driver->counts[TACTILED_LINK_OPENED];
        thread.opened_ns = world_ns;
        thread.frames_at_open = link.driver->counts[TACTILED_LINK_FRAMES];
        segment_->set_link_state(index, TACTILED_LINK_OPEN);
        link.connected.store(true, std::memory_order_release);
    }
    while (cables_[index]->is_readable())
        if (!acquire(link, *segment_, 0)) return close_link(index);
    if (plant_ == nullptr || !plant_->break_is_hidden) return;
    link.connected.store(true, std::memory_order_release);
}

void World::close_link(unsigned index) {
    Link& link = *node_->links[index];
    LinkThread& thread = threads_[index];
    thread.open = false;
    if (plant_ == nullptr || !plant_->break_is_hidden) link.connected.store(false, std::memory_order_release);
    segment_->set_link_state(index, TACTILED_LINK_CLOSED);
    link.driver->close();
    if (link.driver->counts[TACTILED_LINK_FRAMES] != thread.frames_at_open && world_ns - thread.opened_ns >= 100 * kMs)
        thread.pause_ms = 50;
    thread.retry_ns = world_ns + thread.pause_ms * kMs;
    thread.pause_ms = std::min(2 * thread.pause_ms, kMostPauseMs);
}

void World::turn_pipeline() {
    if (world_ns < std::max(next_turn_ns_, stalled_until_ns_)) return;
    const std::uint64_t missed = (world_ns - next_turn_ns_) / kMs;
    pipeline_->deliver(world_ns);
    pipeline_->account(10'000, missed);
    next_turn_ns_ += (missed + 1) * kMs;
    if (plant_ != nullptr) plant_samples();
}

// Changes the newest records in place: one thread, so that nobody has read them yet.
void World::plant_samples() {
    const auto* header = reinterpret_cast<const tactiled_header*>(map_);
    const auto record = [&](const tactiled_ring& ring, std::uint32_t number) {
        return map_ + ring.offset + std::size_t(number & (ring.slots - 1)) * ring.slot_size + TACTILED_RECORD_OFFSET;
    };
    for (unsigned i = 0; i < kSensors && plant_->sample; ++i) {
        const auto& ring = reinterpret_cast<const tactiled_sensor*>(map_ + header->sensor_offset)[i].ring;
        for (const std::uint32_t head = tactiled_ring_head(map_, &ring); planted_[i] != head; ++planted_[i]) {
            auto& s = *reinterpret_cast<tactiled_sample*>(record(ring, planted_[i]));
            const tactiled_sample true_one = s;
            plant_->sample(s, before_[i]);
            before_[i] = true_one;
        }
    }
    if (plant_->node)
        plant_->node(*reinterpret_cast<tactiled_node*>(record(header->node, tactiled_ring_head(map_, &header->node) - 1)));
}

}  // namespace tactiled::faults
