// The taxels of the frames in a link's ring: a block of numbers for each slot. They are written before the slot is
// committed and read before it is released, as the frame is.
#pragma once
#include <algorithm>
#include <cstddef>
#include <vector>

#include "drivers/taxels.hpp"

namespace tactiled {

class TaxelStore {
public:
    // Makes room for arrays of this shape in `slots` slots; without a shape the store is empty. setup
    void make(TaxelShape largest, std::size_t slots) {
        size_ = largest.size();
        if (size_ == 0) return;
        shape_.assign(slots, {});
        value_.assign(slots * size_, 0);
    }
    // Keeps a copy of the taxels, or of there being none. rt: wait-free
    void put(std::size_t slot, const Taxels& taxels) noexcept {
        if (size_ == 0) return;
        const bool fits = taxels.value.size() <= size_ && taxels.value.size() == taxels.shape.size();
        shape_[slot] = fits ? taxels.shape : TaxelShape{};
        if (fits) std::copy(taxels.value.begin(), taxels.value.end(), value_.begin() + std::ptrdiff_t(slot * size_));
    }
    // rt: wait-free
    [[nodiscard]] Taxels get(std::size_t slot) const noexcept {
        if (size_ == 0) return {};
        return {shape_[slot], {value_.data() + slot * size_, shape_[slot].size()}};
    }

private:
    std::size_t size_ = 0;  // numbers in a block
    std::vector<TaxelShape> shape_;
    std::vector<float> value_;
};

}  // namespace tactiled
