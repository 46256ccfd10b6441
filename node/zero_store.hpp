// The zeros of tares, stored in a file for restarts of the daemon.
//
// Before a tare or its removal begins, the file is marked: the zero changes. The command is acknowledged after the new zero
// is in the file. After a restart in between the zero is unknown. Tares are refused while the file cannot be written. A zero
// is restored for the same sensor with the same calibration, serial, channels and method; otherwise the tare is marked as
// lost. A restored zero is doubted unless the first force is the last one of the run before.
#pragma once
#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "node/realtime.hpp"
#include "node/ring.hpp"
#include "node/sensor.hpp"
#include "node/shm/lock_file.hpp"
#include "node/wake_word.hpp"

namespace tactiled {

// The owner of a zero. `id` covers the calibration and the keys that convert a frame into its channels.
struct ZeroOwner {
    std::string sensor, serial;
    std::uint32_t id = 0;
    std::vector<std::string> methods;  // in the order of TaredZero::of_method
    bool restore = true;               // zero_after is not "forget"
};

// The file in which zeros are stored, and the file from which they are read at the start; "" = none.
struct ZeroFiles {
    std::string written, read;
};

// Returns the file of node `node_name`: the configured file, else a file in $STATE_DIRECTORY (of systemd), else
// zero_files_in() of /var/lib/tactiled and $XDG_STATE_HOME/tactiled or ~/.local/state/tactiled.
ZeroFiles zero_files(const std::string& configured, const std::string& node_name);
// Zeros are stored in the first folder that can be written, or else in the last folder. They are read from the newest file,
// so that no tare is lost if its folder can no longer be written.
ZeroFiles zero_files_in(const std::vector<std::string>& folders, const std::string& node_name);

// Returns the last samples of a daemon that was killed, from the segment that it left, by sensor. Before another segment
// has its name. setup
std::map<std::string, tactiled_sample> samples_of_killed(const std::string& node_name);

class ZeroStore {
public:
    // Reads `files.read`, and writes `files.written` to check that it can be written. `owners` are in the order of the
    // sensors. Errors are reported in the log. setup: throws SetupError where another daemon has the file, or where no
    // thread can be made
    ZeroStore(ZeroFiles files, std::vector<ZeroOwner> owners);
    ~ZeroStore();
    ZeroStore(const ZeroStore&) = delete;
    ZeroStore& operator=(const ZeroStore&) = delete;

    // Gives each sensor the zero of its last tare, or marks the zero as lost. `killed`: the last samples of a run that could
    // not keep them, by sensor. Before the loop. setup
    void restore(std::vector<Sensor>& sensors, const std::map<std::string, tactiled_sample>& killed = {});
    // Keeps the last forces of the tared sensors for the next start, and ends the store. After the loop. setup
    void keep_last(const std::vector<Sensor>& sensors);
    // Changes the owner of sensor `index`; call it before the sensor changes. setup
    void replace_owner(std::size_t index, ZeroOwner owner);

    // The following functions are called by the pipeline.

    // True if the file can be written. rt: wait-free
    [[nodiscard]] bool is_usable() const noexcept { return usable_.load(std::memory_order_acquire); }
    // Adds the present zero of a sensor to the next file; at most kMaxSensors before commit(). rt: wait-free
    void add(std::uint32_t sensor, const Sensor& of) noexcept;
    // The same for a zero that is about to change. rt: wait-free
    void add_change(std::uint32_t sensor, const Sensor& of) noexcept;
    // Orders the added zeros to be written. Returns the number of this order, 0 if it cannot be taken. rt: one system call
    [[nodiscard]] std::uint32_t commit() noexcept;
    // Returns true if order `number` was written or has failed; is_usable() distinguishes them. rt: wait-free
    [[nodiscard]] bool is_done(std::uint32_t number) const noexcept {
        return std::int32_t(done_.load(std::memory_order_acquire) - number) >= 0;
    }

private:
    struct Order {
        std::uint32_t number = 0, sensor = 0, id = 0;
        TaredZero zero;
    };
    struct Kept {  // a sensor with a tare in force
        std::string sensor, serial, time;
        std::uint32_t id = 0, tare_count = 0;
        std::map<std::string, Wrench> of_method;  // the known zeros
        std::optional<LastForce> last;            // at the end of the last run that ended in order
    };
    void add(std::uint32_t sensor, const Sensor& of, const TaredZero& zero) noexcept;
    void load(const std::string& path);
    void serve() noexcept;
    void end() noexcept;
    void take(const Order& order);
    void write() noexcept;
    [[nodiscard]] std::string text() const;
    [[nodiscard]] Kept* find(const std::string& sensor);

    std::string path_;
    LockFile lock_;                  // two daemons with one file would restore each other's zeros
    std::mutex mutex_;               // guards owners_ and kept_ between the thread, restore() and replace_owner()
    std::vector<ZeroOwner> owners_;  // including those of earlier configurations until their orders are written
    std::vector<std::size_t> sensor_of_owner_;
    std::vector<Kept> kept_;
    std::string complaint_;
    Ring<Order> orders_{64};
    std::uint32_t number_ = 1;            // used by the pipeline only
    bool has_added_ = false;              // the next order has entries
    bool refused_ = false;                // there was no room for an order of the present number
    std::atomic<std::uint32_t> done_{1};  // the first number
    std::atomic<bool> usable_{false}, stop_{false};
    WakeWord work_;  // wakes the thread of the store
    RtThread thread_;
};

}  // namespace tactiled
