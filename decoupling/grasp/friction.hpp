// The coefficient of friction of one jaw's contact in this grasp, and the grip that follows from it.
#pragma once

namespace tactiled::grasp {

class Friction {
public:
    explicit Friction(double configured) : configured_(configured) { begin(); }

    void begin() noexcept;                // starts another grasp, perhaps of another object
    void held(double ratio) noexcept;     // a ratio of shear to press without slip: a lower bound
    void slipped(double ratio) noexcept;  // the ratio at which it slipped
    // coefficient(): the ratio of shear to press at the slip limit; NaN = unknown. One sd, NaN for a configured value
    // or a bound.
    [[nodiscard]] double coefficient() const noexcept { return coefficient_; }
    [[nodiscard]] double sd() const noexcept;
    [[nodiscard]] bool learnt() const noexcept { return slips_ > 0; }
    // Returns the part of the friction limit that this shear uses, 1 = about to slip; NaN = unknown.
    [[nodiscard]] double use(double shear_N, double press_N) const noexcept;

private:
    double configured_, coefficient_ = 0, squares_ = 0;
    int slips_ = 0;
};

}  // namespace tactiled::grasp
