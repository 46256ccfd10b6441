// Model "piezo", method "fused": press from the piezoelectric film Vp, fast but insensitive to constant forces, and
// from the capacitance Cn, slow and absolute. See decoupling/piezo/README.md and charge.hpp. fz only.
//
//     Vp = leak of (gain_b N + gain_a N^2)      thesis, eq. XXXV (its constant is the channel's zero)
//     Cn = normal_b N + normal_a N^2            thesis, eq. XXXIII, mean over the last window_s
#include "decoupling/capacitive/methods.hpp"
#include "decoupling/piezo/charge.hpp"
#include "decoupling/piezo/parameters.hpp"
#include "decoupling/solve/curve.hpp"

namespace tactiled {
namespace {

// A reading beyond this many times the range cannot be a force; it is limited, so that the state recovers immediately.
constexpr double kMaxRanges = 20;
// Film and Cn disagree if they differ by this many standard deviations. The disagreement lasts some time, because a stuck
// film agrees with every constant force.
constexpr double kMaxDifference_sd = 5;
constexpr std::uint64_t kDoubt_ns = 4'000'000'000;
// Part of the swing of the force by which they may differ: the gain of the film is known to 5 % (fit/piezo_fit.cpp), and the
// window of Cn to a frame.
constexpr double kOfSwing = 0.1;
// Part of a remaining difference that is added to the standard deviation.
constexpr double kOfDifference = 0.5;

class Piezo final : public CheckedModel {
public:
    Piezo(const CalibrationData& data, std::size_t Vp, std::size_t Cn, double fusion_tau_s)
        : CheckedModel(data.calibration(), 1u << Vp | 1u << Cn, 1u << Cn),
          Vp_(Vp),
          Cn_(Cn),
          range_N_(data["normal_range_N"]),
          film_(data["gain_b"], data["gain_a"], 0, range_N_),
          normal_(data["normal_b"], data["normal_a"], 0, range_N_),
          longest_gap_s_(std::max(data["leak_tau_s"], data["window_s"])),
          fusion_(data["leak_tau_s"], fusion_tau_s, data["window_s"]),
          has_sd_(!data.calibration().sd.empty()),
          memory_s_(3 * (fusion_tau_s + data["window_s"])) {}
    [[nodiscard]] std::string_view method() const noexcept override { return "fused"; }
    // The film shows a change of the force immediately; the window of Cn is part of the fusion.
    [[nodiscard]] std::uint32_t timed_by(std::size_t /*c*/) const noexcept override { return 1u << Vp_; }

private:
    void forget() noexcept override {
        fusion_.forget();
        has_last_ = false;
        doubt_N_ = 0;
    }

    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        const Curve::Force slow = normal_.inverse(input.r[Cn_]);
        if (!(slow.slope > 1e-6 * normal_.b())) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN | TACTILED_UNKNOWN_UNCERTAINTY;
        bool cut = false;
        const double slow_N = within(slow.F, -kMaxRanges * range_N_, kMaxRanges * range_N_, cut);
        double press_N = slow_N;
        if ((input.usable >> Vp_ & 1u) == 0) {
            // Cn alone is delayed; its error depends on the rate of the force.
            forget();
            estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
        } else {
            const double max_V = film_.y(kMaxRanges * range_N_);
            const double V = within(input.r[Vp_], -max_V, max_V, cut);
            const double drive = fused_drive(input, V, film_.y(slow_N));
            press_N = film_.inverse(drive).F;
            if (!fusion_.is_settled())
                estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
            else if (has_sd_)
                compare(press_N, film_.inverse(drive + fusion_.difference()).F, input, estimate);
        }
        if (cut) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
        if (cut || press_N < -kDomainMargin * range_N_ || press_N > (1 + kDomainMargin) * range_N_)
            estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
        estimate.wrench_S[2] = 0.0 - press_N;
    }

    // Both readings measure the same force; while they disagree, either may be right.
    void compare(double press_N, double other_N, Input& input, Estimate& estimate) noexcept {
        Wrench wrench{};
        wrench[2] = press_N;
        const double sd = stated_sd(2, wrench), forgotten = std::min(1.0, T_s_ / memory_s_);
        max_N_ = std::max(press_N, max_N_ - forgotten * (max_N_ - press_N));
        min_N_ = std::min(press_N, min_N_ - forgotten * (min_N_ - press_N));
        const double difference_N = std::abs(other_N - press_N);
        if (!(difference_N <= kMaxDifference_sd * sd + kOfSwing * (max_N_ - min_N_))) {
            doubtful_since_ns_ = input.t_ns;
            doubt_N_ = std::max(doubt_N_, difference_N <= kMaxRanges * range_N_ ? difference_N : kMaxRanges * range_N_);
        } else if (input.t_ns - doubtful_since_ns_ > kDoubt_ns) {
            doubt_N_ = 0;
        }
        // A smaller difference is included in the standard deviation: one of the two readings is off by at least half of it.
        const double part_N = doubt_N_ > 0 ? doubt_N_ : kOfDifference * difference_N;
        if (sd > 0) input.sd_factor[2] = std::hypot(sd, part_N) / sd;
        if (doubt_N_ > 0) estimate.reasons |= TACTILED_DISAGREEMENT;
    }

    double fused_drive(const Input& input, double V, double slow) noexcept {
        // After a clock that went back, or a gap in which the force is unknown: restart from Cn. Frames of the same
        // time are a jump of the drive.
        const bool forward = has_last_ && input.t_ns >= last_t_ns_;
        const double T_s = forward ? double(input.t_ns - last_t_ns_) * 1e-9 : 0;
        if (!forward || T_s > longest_gap_s_) fusion_.forget();
        T_s_ = T_s;
        // Cn repeats its last value until the next conversion. With a constant force new values may equal the last one, so a
        // value also counts as new after two windows.
        const bool is_new =
            !has_last_ || input.r[Cn_] != last_Cn_ || double(input.t_ns - last_new_t_ns_) * 1e-9 >= 2 * fusion_.window_s();
        if (!forward || is_new) last_new_t_ns_ = input.t_ns;
        has_last_ = true;
        last_t_ns_ = input.t_ns;
        last_Cn_ = input.r[Cn_];
        return fusion_.update(T_s, V, slow, is_new);
    }

    std::size_t Vp_, Cn_;
    double range_N_;
    Curve film_, normal_;
    double longest_gap_s_;
    ChargeFusion fusion_;
    bool has_last_ = false, has_sd_;
    double memory_s_, T_s_ = 0, max_N_ = 0, min_N_ = 0;  // swing over about memory_s_
    double doubt_N_ = 0;                                 // the largest difference; 0 = film and Cn agree
    std::uint64_t doubtful_since_ns_ = 0;
    std::uint64_t last_t_ns_ = 0, last_new_t_ns_ = 0;
    double last_Cn_ = 0;
};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    const Calibration& calibration = data.calibration();
    const Wiring wiring = electrode_wiring(calibration, fault);
    const auto film = std::find(calibration.channels.begin(), calibration.channels.end(), "Vp");
    if (fault.empty() && (film == calibration.channels.end() || wiring[kCentre] < 0))
        fault = fmt::format("channels lacks {}; needed are Vp Cn", film == calibration.channels.end() ? "Vp" : "Cn");
    if (fault.empty() && calibration.components != std::vector<std::string>{"fz"})
        fault = "model \"piezo\" measures only fz: components = [\"fz\"]";
    const double leak_s = data["leak_tau_s"], fusion_s = data.has("fusion_tau_s") ? data["fusion_tau_s"] : leak_s;
    if (fault.empty() && fusion_s > leak_s)
        fault = fmt::format("parameter fusion_tau_s = {} is above leak_tau_s = {}: it would amplify the film's offset",
                            fusion_s, leak_s);
    if (!fault.empty()) return nullptr;
    return std::make_unique<Piezo>(data, std::size_t(film - calibration.channels.begin()), std::size_t(wiring[kCentre]),
                                   fusion_s);
}

const MethodEntry entry{.model = "piezo", .method = "fused", .place = 10, .parameters = kPiezoParameters, .make = make};

}  // namespace
}  // namespace tactiled
