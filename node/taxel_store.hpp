// The taxels of the frames in a link's ring: a record of the segment for each slot. They are written before the slot is
// committed and read before it is released, as the frame is.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/taxels.hpp"
#include "tactiled/layout.h"

namespace tactiled {

class TaxelStore {
public:
    // Makes room for arrays of this shape in `slots` slots; without a shape the store is empty. setup
    void make(TaxelShape largest, std::size_t slots) {
        if (largest.size() == 0) return;
        words_ = tactiled_taxels_size(std::uint32_t(largest.size())) / sizeof(std::uint64_t);
        word_.assign(slots * words_, 0);
    }
    // rt: wait-free
    [[nodiscard]] bool is_empty() const noexcept { return words_ == 0; }
    // Keeps a copy of the taxels, or of there being none. rt: wait-free
    void put(std::size_t slot, const Taxels& taxels) noexcept {
        if (is_empty()) return;
        const std::size_t n = taxels.value.size();
        const bool fits = words_of(n) <= words_ && n == taxels.shape.size();
        head(slot) = {.n_taxels = fits ? taxels.shape.taxels : std::uint16_t(0),
                      .n_values = fits ? taxels.shape.values : std::uint16_t(0),
                      .reserved = 0};
        if (fits) std::copy(taxels.value.begin(), taxels.value.end(), reinterpret_cast<float*>(&head(slot) + 1));
    }
    // rt: wait-free
    [[nodiscard]] Taxels get(std::size_t slot) const noexcept {
        if (is_empty()) return {};
        const tactiled_taxels* const begin = &head(slot);
        const TaxelShape shape{begin->n_taxels, begin->n_values};
        return {shape, {reinterpret_cast<const float*>(begin + 1), shape.size()}};
    }
    // Returns struct tactiled_taxels and what follows it. Not of an empty store. rt: wait-free
    [[nodiscard]] std::span<const std::uint64_t> record(std::size_t slot) const noexcept {
        return {word_.data() + slot * words_, words_of(get(slot).shape.size())};
    }

private:
    static std::size_t words_of(std::size_t numbers) noexcept {
        return tactiled_taxels_size(std::uint32_t(numbers)) / sizeof(std::uint64_t);
    }
    tactiled_taxels& head(std::size_t slot) noexcept {
        return *reinterpret_cast<tactiled_taxels*>(word_.data() + slot * words_);
    }
    const tactiled_taxels& head(std::size_t slot) const noexcept {
        return *reinterpret_cast<const tactiled_taxels*>(word_.data() + slot * words_);
    }

    std::size_t words_ = 0;  // in each slot
    std::vector<std::uint64_t> word_;
};

}  // namespace tactiled
