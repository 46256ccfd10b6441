// The register TEACH: adds the present weight to an object as one more grasp. A separate thread reads and writes the
// file, which may be slow; the requesting thread passes the result to the pipeline.
#pragma once
#include <atomic>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "node/objects.hpp"
#include "node/realtime.hpp"

namespace tactiled::modbus {

class Teaching {
public:
    explicit Teaching(std::string path) : path_(std::move(path)) {}
    Teaching(const Teaching&) = delete;
    Teaching& operator=(const Teaching&) = delete;

    enum State : std::uint8_t { idle, storing, stored, failed };
    [[nodiscard]] State state() const noexcept { return state_.load(std::memory_order_acquire); }

    // Begins to store. Only while idle. An id that is not in the file is a new object, named objectID.
    void begin(std::uint32_t id, const Weighing& weighing) noexcept;
    // Returns the stored objects while `stored`, valid until settle().
    [[nodiscard]] std::span<const TaughtObject> objects() const noexcept { return objects_; }
    // Returns to idle from `stored` and `failed`.
    void settle() noexcept { state_.store(idle, std::memory_order_release); }

private:
    std::string path_;
    std::vector<TaughtObject> objects_;
    std::atomic<State> state_{idle};
    RtThread thread_;
};

}  // namespace tactiled::modbus
