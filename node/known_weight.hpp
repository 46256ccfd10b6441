// What a known weight has taught outlives the daemon: the file, who reads it at the start, and who writes it meanwhile.
#pragma once
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

#include "config/options.hpp"
#include "decoupling/grasp/grasp.hpp"
#include "node/realtime.hpp"
#include "node/ring.hpp"

namespace tactiled {

struct KeptCheck {
    grasp::Check check;            // mass_kg = 0: forgotten
    std::uint32_t belongs_to = 0;  // of the jaws, their calibrations and how they are mounted: elsewhere it is not true
};

// Taken up where it belongs to `belongs_to`; else, and where the file is spoilt, nothing and a line that says what to do.
// A file that is not there is no news. `now_s` of the calendar: it says how old the check is, which is taken for a month
// where it would lie in the future. setup: never throws for bad input
std::optional<grasp::Check> load_check(const std::string& path, std::uint32_t belongs_to, std::int64_t now_s,
                                       std::string& why_not);
// setup: throws SaveError where the file cannot be replaced; then the old one stands as it was
void store_check(const std::string& path, const KeptCheck& kept, std::int64_t now_s);
std::int64_t calendar_s() noexcept;

// Stores what the pipeline hands over, on a thread of its own, as slow as a disk.
class CheckKeeper {
public:
    CheckKeeper(std::string path, Ring<KeptCheck>& checks);
    ~CheckKeeper();
    CheckKeeper(const CheckKeeper&) = delete;
    CheckKeeper& operator=(const CheckKeeper&) = delete;

private:
    void run() noexcept;
    bool store(const KeptCheck& kept) noexcept;

    std::string path_;
    Ring<KeptCheck>& checks_;
    bool told_ = false;  // that it cannot be stored
    std::atomic<bool> stop_{false};
    RtThread thread_;
};

}  // namespace tactiled
