// A bus with model chips and switches, also as an I2cBus in virtual time.
#pragma once
#include <algorithm>
#include <functional>
#include <map>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "drivers/chips/bus.hpp"
#include "tests/unit/drivers/model_chip.hpp"

namespace tactiled::test {

class ModelWires {
public:
    // `mux` 0: directly on the bus.
    void put(std::uint8_t address, ModelChip& chip, std::uint8_t mux = 0, unsigned channel = 0) {
        places_.push_back({address, mux, channel, &chip});
        if (mux != 0) masks_.try_emplace(mux, std::uint8_t{0});
    }

    // Returns false if no chip acknowledged.
    bool write(std::uint8_t address, Bytes bytes, std::uint64_t t_ns) {
        if (const auto mux = masks_.find(address); mux != masks_.end()) {
            mux->second = bytes.back();
            return true;
        }
        ModelChip* const chip = find(address);
        if (chip != nullptr) chip->write(bytes, t_ns);
        return chip != nullptr;
    }
    bool read(std::uint8_t address, std::span<std::uint8_t> out, std::uint64_t t_ns, std::uint64_t until_ns) {
        if (const auto mux = masks_.find(address); mux != masks_.end()) {
            std::fill(out.begin(), out.end(), mux->second);
            return true;
        }
        ModelChip* const chip = find(address);
        if (chip != nullptr) chip->read(out, t_ns, until_ns);
        return chip != nullptr;
    }
    void reset_muxes() {
        for (auto& mux : masks_) mux.second = 0;
    }
    unsigned n_collisions = 0;  // transfers that two chips answered

private:
    struct Place {
        std::uint8_t address, mux;
        unsigned channel;
        ModelChip* chip;
    };
    ModelChip* find(std::uint8_t address) {
        ModelChip* found = nullptr;
        for (const Place& place : places_) {
            if (place.address != address || place.chip->is_dead) continue;
            if (place.mux != 0 && (masks_[place.mux] >> place.channel & 1) == 0) continue;
            if (found != nullptr) ++n_collisions;
            found = place.chip;
        }
        return found;
    }
    std::vector<Place> places_;
    std::map<std::uint8_t, std::uint8_t> masks_;
};

// A chip's data-ready line: it has an edge at the end of each conversion, except every `misses`-th. An edge during a
// transfer waits.
class ModelLine final : public ReadyLine {
public:
    explicit ModelLine(ModelChip& chip) : chip_(chip) {}
    bool take(std::uint64_t& t_ns) noexcept override {
        t_ns = std::exchange(edge_ns_, 0);
        return t_ns != 0;
    }
    // Advances the time to `t_ns` at most; returns the time of its edge, 0 if there was none.
    std::uint64_t pass(std::uint64_t t_ns) {
        if (chip_.ended_ns() == seen_ns_) {
            if (chip_.ends_ns() == 0 || chip_.ends_ns() > t_ns) return 0;
            chip_.advance(chip_.ends_ns());
        }
        if (seen_ns_ == chip_.ended_ns()) return 0;  // its registers were being read
        seen_ns_ = chip_.ended_ns();
        if (misses != 0 && ++n_edges_ % misses == 0) return 0;
        return edge_ns_ = seen_ns_;
    }
    unsigned misses = 0;

private:
    ModelChip& chip_;
    std::uint64_t edge_ns_ = 0, seen_ns_ = 0;
    unsigned n_edges_ = 0;
};

class ModelBus final : public I2cBus {
public:
    explicit ModelBus(double clock_Hz = 400e3) : bit_ns_(1e9 / clock_Hz) {}

    Answer transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) noexcept override {
        ++n_transfers;
        if (n_until_accident > 0 && --n_until_accident == 0) accident();
        if (is_disconnected) return Answer::disconnected;
        if (hangs) return spend(1e9), Answer::timeout;
        if (n_failing > 0) {
            --n_failing;
            ++n_nacks;
            spend(20 * bit_ns_);
            if (fails_after) wires.write(address, out, now_);
            return failing_with;
        }
        spend(overhead_ns + bit_ns_ * double(11 + 9 * out.size()));  // start, address, what follows; stop or start again
        if (!wires.write(address, out, now_)) return ++n_nacks, Answer::absent;
        if (in.empty()) return Answer::ok;
        if (held_up_max_ns != 0 && random_() % 4 == 0) spend(double(random_() % held_up_max_ns));
        const std::uint64_t from_ns = now_ + std::uint64_t(10 * bit_ns_);
        spend(bit_ns_ * double(11 + 9 * in.size()));
        if (!wires.read(address, in, from_ns, now_)) return ++n_nacks, Answer::absent;
        return Answer::ok;
    }
    std::uint64_t now_ns() const noexcept override { return now_; }

    void wait_until(std::uint64_t t_ns) noexcept override {
        if (t_ns > now_) {
            const std::uint64_t edge_ns = line != nullptr ? line->pass(t_ns) : 0;
            now_ =
                std::max(now_, edge_ns != 0 ? edge_ns : t_ns) + (oversleeps_max_ns == 0 ? 0 : random_() % oversleeps_max_ns);
        }
        if (line != nullptr) (void)line->pass(now_);  // the edge waits until it is taken
    }

    ModelLine* line = nullptr;

    ModelWires wires;
    std::uint64_t oversleeps_max_ns = 0;
    std::uint64_t held_up_max_ns = 0;  // every fourth transfer, before it reads
    double overhead_ns = 0;            // per transfer, as with a USB adapter
    bool is_disconnected = false, hangs = false;
    unsigned n_until_accident = 0;  // number of transfers until this happens, before the last of them
    std::function<void()> accident;
    bool fails_after = false;  // after that transfer: the chip has taken the bytes
    unsigned n_failing = 0;    // number of following transfers that fail
    Answer failing_with = Answer::failed;
    unsigned n_transfers = 0, n_nacks = 0;
    std::uint64_t busy_ns = 0;

private:
    void spend(double ns) {
        now_ += std::uint64_t(ns);
        busy_ns += std::uint64_t(ns);
    }
    double bit_ns_;
    std::minstd_rand random_{1};
    std::uint64_t now_ = 1'000'000'000;
};

}  // namespace tactiled::test
