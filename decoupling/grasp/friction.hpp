// The coefficient of friction of one jaw's contact in this grasp, and what grip it asks for.
#pragma once

namespace tactiled::grasp {

class Friction {
public:
    explicit Friction(double configured) : configured_(configured) { begin(); }

    void begin() noexcept;                // another grasp, perhaps another object
    void held(double ratio) noexcept;     // shear over press that did not slip: friction is no less
    void slipped(double ratio) noexcept;  // at which it gave way
    // Shear over press at which it gives way; NaN = not known. One sd, NaN where it is as configured or only a bound.
    [[nodiscard]] double coefficient() const noexcept { return coefficient_; }
    [[nodiscard]] double sd() const noexcept;
    [[nodiscard]] bool learnt() const noexcept { return slips_ > 0; }
    // |shear| that so much press is used up by, 1 = about to slip; NaN = not known.
    [[nodiscard]] double use(double shear_N, double press_N) const noexcept;

private:
    double configured_, coefficient_ = 0, squares_ = 0;
    int slips_ = 0;
};

}  // namespace tactiled::grasp
