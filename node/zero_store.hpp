// The zeros of tares, stored in a file for restarts of the daemon.
//
// Before a tare, or its removal, begins, the file says that the zero changes; it is acknowledged once the new zero is in the
// file. A restart in between finds no known zero. While the file cannot be written, tares are refused. A zero is restored
// for the same sensor with the same calibration, serial, channels and method. Otherwise the sensor knows that its tare is
// lost.
#pragma once
#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "node/realtime.hpp"
#include "node/ring.hpp"
#include "node/sensor.hpp"
#include "node/wake_word.hpp"

namespace tactiled {

// The owner of a zero. `id` covers the calibration and the keys that convert a frame into its channels.
struct ZeroOwner {
    std::string sensor, serial;
    std::uint32_t id = 0;
    std::vector<std::string> methods;  // in the order of TaredZero::of_method
    bool restore = true;               // tare_after_restart = "restore"
};

// The file in which zeros are kept, and the one from which they are read at the start; "" = nowhere.
struct ZeroFiles {
    std::string written, read;
};

// Returns the file of node `node_name`: the configured one, or else that in $STATE_DIRECTORY (of systemd), or else
// zero_files_in() of /var/lib/tactiled and $XDG_STATE_HOME/tactiled or ~/.local/state/tactiled.
ZeroFiles zero_files(const std::string& configured, const std::string& node_name);
// Zeros are kept in the first folder that can be written, or in the last one. They are read from the file that was written
// last, so that no tare is forgotten because its folder cannot be written any more.
ZeroFiles zero_files_in(const std::vector<std::string>& folders, const std::string& node_name);

class ZeroStore {
public:
    // Reads one file, and writes the other one to check that it can be written. `owners` are in the order of the sensors.
    // Errors are reported in the log. setup: throws SetupError where no thread can be made
    ZeroStore(ZeroFiles files, std::vector<ZeroOwner> owners);
    ~ZeroStore();
    ZeroStore(const ZeroStore&) = delete;
    ZeroStore& operator=(const ZeroStore&) = delete;

    // Gives each sensor the zero of its last tare, or marks the zero as lost. Before the loop. setup
    void restore(std::vector<Sensor>& sensors);
    // Changes the owner of sensor `index`; call it before the sensor changes. setup
    void replace_owner(std::size_t index, ZeroOwner owner);

    // ---- by the pipeline's thread ----

    // True if the file can be written. rt: wait-free
    [[nodiscard]] bool is_usable() const noexcept { return usable_.load(std::memory_order_acquire); }
    // Adds the present zero of a sensor to the next file; at most kMaxSensors before commit(). rt: wait-free
    void add(std::uint32_t sensor, const Sensor& of) noexcept;
    // The same for a zero that is about to change. rt: wait-free
    void add_change(std::uint32_t sensor, const Sensor& of) noexcept;
    // Orders the added zeros to be written. Returns the number of this order, 0 if it cannot be taken. rt: one system call
    [[nodiscard]] std::uint32_t commit() noexcept;
    // Returns true if order `number` was written or has failed; is_usable() says which. rt: wait-free
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
    };
    void add(std::uint32_t sensor, const Sensor& of, const TaredZero& zero) noexcept;
    void load(const std::string& path);
    void serve() noexcept;
    void take(const Order& order);
    void write() noexcept;
    [[nodiscard]] std::string text() const;
    [[nodiscard]] Kept* find(const std::string& sensor);

    std::string path_;
    std::mutex mutex_;               // guards owners_, between the thread and replace_owner()
    std::vector<ZeroOwner> owners_;  // also of earlier configurations, until their orders are written
    std::vector<std::size_t> sensor_of_owner_;
    std::vector<Kept> kept_;
    std::string complaint_;
    Ring<Order> orders_{64};
    std::uint32_t number_ = 1;            // used by the pipeline only
    bool has_added_ = false;              // to the next order
    bool refused_ = false;                // there was no room for an order of the present number
    std::atomic<std::uint32_t> done_{1};  // the first number
    std::atomic<bool> usable_{false}, stop_{false};
    WakeWord work_;  // wakes the thread of the store
    RtThread thread_;
};

}  // namespace tactiled
