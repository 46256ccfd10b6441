#include "world.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "clock.hpp"
#include "node/shm/folder.hpp"

namespace tactiled::faults {
namespace {

constexpr std::uint64_t kMaxPauseMs = 1000;
constexpr std::uint64_t kFoundMs = 150;  // time for readers to find a new daemon

}  // namespace

World::World(std::uint64_t seed, const Plant* plant)
    : random_(seed), plant_(plant), name_(fmt::format("world-{}", ::getpid())) {
    world_ns = 1'000'000'000'000;
    for (unsigned link = 0; link < kLinks; ++link) {
        auto cable = std::make_unique<Cable>(link == 1);
        cables_[link] = cable.get();
        unused_[link] = std::move(cable);
    }
    std::uint32_t first = 0;
    for (unsigned i = 0; i < kSensors; ++i) {
        if (i != 3) first = std::uint32_t(random_());  // the jaws measure the same event at the same time
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
    node_ = std::make_unique<Node>(load_node(write_configuration(), problems));
    if (!problems.empty()) throw std::runtime_error(problems.lines().front());
    if (plant_ != nullptr && plant_->setup) plant_->setup(*node_);
    for (unsigned link = 0; link < kLinks; ++link) node_->links[link]->driver = std::move(unused_[link]);
    segment_ = std::make_unique<SegmentWriter>(node_->plan);
    pipeline_ = std::make_unique<Pipeline>(node_->links, node_->sensors, *segment_, 0, node_->grasp);
    reloader_ = std::make_unique<Reloader>(*node_, "");
    pipeline_->start(world_ns);
    segment_->set_state(TACTILED_RUNNING);
    threads_ = {};
    next_cycle_ns_ = world_ns;
    seen_ = Segment::open(name_);
    asked_ = 0;
    refused_ = false;
    in_force_ = knobs_;
    if (witness_ != nullptr) {
        witness_->expect_gain(kRecalibrated, knobs_.gain_N(), devices());
        witness_->settle_gain(kRecalibrated, true, devices());
    }
    started_ns_ = world_ns;
    reported_from_ns_ = world_ns + kReportMs * kMs;
    suffer(~0u, world_ns + 100 * kMs);
    planted_ = {};
    before_ = {};
    if (plant_ == nullptr) return;
    if (map_ != nullptr) ::munmap(map_, map_size_);
    const int fd = ::open((runtime_folder() + "/tactiled." + name_).c_str(), O_RDWR | O_CLOEXEC);
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
    reloader_.reset();
    pipeline_.reset();
    node_.reset();
}

void World::stop() {
    pipeline_->stop(world_ns);
    segment_.reset();
    take_cables_back();
}

// Leaves the state as the kernel does: descriptors and mappings of the process are closed, the file keeps its name
// and its last contents.
void World::kill() {
    struct stat named {};
    ::stat((runtime_folder() + "/tactiled." + name_).c_str(), &named);
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

void World::suffer(unsigned mask, std::uint64_t until_ns) {
    for (unsigned i = 0; i < kSensors; ++i)
        if ((mask >> i & 1u) != 0) suffers_until_ns_[i] = std::max(suffers_until_ns_[i], until_ns);
}

void World::stall_pipeline(std::uint64_t ms) { stalled_until_ns_ = std::max(stalled_until_ns_, world_ns + ms * kMs); }

void World::stop_process(std::uint64_t ms) {
    stopped_until_ns_ = std::max(stopped_until_ns_, world_ns + ms * kMs);
    stall_pipeline(ms);
    for (auto& device : devices_) {
        device->stopped_ns = world_ns;
        device->stopped_until_ns = stopped_until_ns_;
    }
}

void World::unplug(unsigned link) {
    cables_[link]->plugged = false;
    for (unsigned i = 0; i < kSensors; ++i)
        if (link_of(i) == link) disconnected_since_ns_[i] = world_ns;
}

void World::plug(unsigned link) {
    cables_[link]->plugged = true;
    for (unsigned i = 0; i < kSensors; ++i)
        if (link_of(i) == link) disconnected_since_ns_[i] = 0;
}

std::array<Device*, kSensors> World::devices() {
    std::array<Device*, kSensors> all{};
    for (unsigned i = 0; i < kSensors; ++i) all[i] = devices_[i].get();
    return all;
}

tactiled_node World::latest_node() const {
    tactiled_node node{};
    (void)seen_.latest_node(node);
    return node;
}

void World::tare_at_random() {
    if (!tares || asked_ != 0 || random_() % 60 != 0) return;
    Command* const slot = pipeline_->commands[TACTILED_FROM_SOCKET].claim();
    if (slot == nullptr) return;
    asked_ = std::uint32_t(random_() % 3 + 1) << 2;
    *slot = {.kind = Command::Kind::tare, .mask = asked_, .number = ++command_};
    pipeline_->commands[TACTILED_FROM_SOCKET].push();
    pipeline_->commands[TACTILED_FROM_SOCKET].commit();
}

void World::run_ms(std::uint64_t ms) {
    const std::array<Device*, kSensors> devices = this->devices();
    for (; ms > 0; --ms) {
        const std::uint64_t began_ns = world_ns;
        if (is_running()) tare_at_random();
        for (auto& device : devices_) device->send(world_ns, random_);
        std::array<unsigned, kLinks + 1> actors{0, 1, 2, kLinks};
        std::shuffle(actors.begin(), actors.end(), random_);
        for (const unsigned actor : actors) {
            world_ns += random_() % 150'000;
            if (!is_running() || world_ns < stopped_until_ns_) continue;
            actor < kLinks ? run_link_cycle(actor) : run_pipeline_cycle();
        }
        Expectation expected;
        expected.plc_reads = ++turns_ % 10 == 0;
        const bool reported = is_running() && world_ns > reported_from_ns_ && world_ns > stalled_until_ns_ + kReportMs * kMs;
        expected.new_daemon = world_ns < started_ns_ + kFoundMs * kMs;
        if (reported && !expected.new_daemon) expected.reload_refused = refused_ ? 1 : 0;
        for (unsigned i = 0; i < kSensors; ++i) {
            expected.may_suffer[i] = world_ns < suffers_until_ns_[i];
            if (disconnected_since_ns_[i] != 0 && is_running())
                expected.disconnected_since[i] = std::max(disconnected_since_ns_[i], stalled_until_ns_);
        }
        witness_->look(devices, expected);
        world_ns = began_ns + kMs;
    }
}

// Does the same as Threads::run_link(): reads the available data and reopens with a growing pause.
void World::run_link_cycle(unsigned index) {
    Link& link = *node_->links[index];
    LinkThread& thread = threads_[index];
    if (!thread.open) {
        if (world_ns < thread.retry_ns) return;
        if (!link.driver->open().empty()) {
            thread.retry_ns = world_ns + thread.pause_ms * kMs;
            thread.pause_ms = std::min(2 * thread.pause_ms, kMaxPauseMs);
            return;
        }
        thread.open = true;
        link.opened(world_ns, link.is_proving);
        thread.opened_ns = world_ns;
        thread.frames_at_open = link.driver->counts[TACTILED_LINK_FRAMES];
        segment_->set_link_state(index, TACTILED_LINK_OPEN);
        link.connected.store(true, std::memory_order_release);
    }
    while (cables_[index]->is_readable())
        if (acquire(link, *segment_, 0) == Status::disconnected) return close_link(index);
    if (plant_ == nullptr || !plant_->discontinuity_is_hidden) return;
    link.connected.store(true, std::memory_order_release);
}

void World::close_link(unsigned index) {
    Link& link = *node_->links[index];
    LinkThread& thread = threads_[index];
    thread.open = link.is_proving = false;
    if (plant_ == nullptr || !plant_->discontinuity_is_hidden) link.connected.store(false, std::memory_order_release);
    segment_->set_link_state(index, TACTILED_LINK_CLOSED);
    link.driver->close();
    if (link.driver->counts[TACTILED_LINK_FRAMES] != thread.frames_at_open && world_ns - thread.opened_ns >= 100 * kMs)
        thread.pause_ms = 50;
    thread.retry_ns = world_ns + thread.pause_ms * kMs;
    thread.pause_ms = std::min(2 * thread.pause_ms, kMaxPauseMs);
}

void World::run_pipeline_cycle() {
    if (world_ns < std::max(next_cycle_ns_, stalled_until_ns_)) return;
    const std::uint64_t missed = (world_ns - next_cycle_ns_) / kMs;
    pipeline_->cycle(world_ns);
    if (const tactiled_command said = latest_node().command[TACTILED_FROM_SOCKET];
        asked_ != 0 && said.acknowledged == command_) {
        if (said.state == TACTILED_COMMAND_RUNNING) witness_->tare_begins(asked_);
        asked_ = 0;
    }
    pipeline_->add_missed(missed);
    next_cycle_ns_ += (missed + 1) * kMs;
    if (plant_ != nullptr) plant_samples();
}

// Changes the newest records in place: there is one thread, so no reader has read them yet.
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
