// One sensor in the pipeline: Frame -> Reading -> Estimate -> tactiled_sample. A Sensor selects its channels, checks their
// stream (quality.hpp), calls its model and subtracts its zero (zero.hpp). It does not use links or shared memory.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "decoupling/auto_method.hpp"
#include "decoupling/latency.hpp"
#include "decoupling/patch/patch.hpp"
#include "decoupling/place.hpp"
#include "drivers/clock.hpp"
#include "drivers/frame.hpp"
#include "drivers/taxels.hpp"
#include "node/agreement.hpp"
#include "node/budget.hpp"
#include "node/continuity.hpp"
#include "node/jump_check.hpp"
#include "node/low_pass.hpp"
#include "node/quality.hpp"
#include "node/tare_window.hpp"
#include "node/thermometer.hpp"
#include "node/tuning.hpp"
#include "node/zero.hpp"
#include "tactiled/layout.h"

namespace tactiled {

// Settings that may change while the daemon runs. NaN stands for the configured value.
struct SensorSettable {
    double filter_Hz = 0;                             // low pass on force and torque, 0 = off
    double contact_on_N = 0.5, contact_off_N = 0.25;  // limits of the magnitude of the measured components
    double overload_N = 0;                            // 0 = none

    static constexpr SensorSettable as_configured() { return {kNaN, kNaN, kNaN, kNaN}; }
};

inline double or_configured(double requested, double configured) noexcept {
    return std::isnan(requested) ? configured : requested;
}

class Sensor {
public:
    struct Setup {
        std::vector<int> channel_of_frame;  // for each channel of the model, its index in the frame
        std::size_t frame_channels = 0;     // number of channels in a frame of this device
        double counts_per_unit = 1;
        // identifies the stored zeros of this sensor (zero_store.hpp)
        std::uint32_t zero_id = 0;
        int temperature_of_frame = -1;                              // channel of a frame with the temperature; -1: none
        double temperature_at_0_C = 0, temperature_per_unit_K = 1;  // its scale; 0 and 1: in degC
        int temperature_of_sensor = -1;  // sensor whose temperature is used for this sensor; -1: none
        TemperatureInUse temperature;
        int serial_of_frame = -1;  // channel of a frame with the number of the device; -1: none
        double serial = 0;         // number of the calibrated device
        bool needs_tare = false;   // each session of the calibration had a zero of its own
        ZeroError::Rates zero;     // ageing of the calibration's zero
        Tuning tuning;
        std::unique_ptr<Decoupler> decoupler;
        AutoMethod* automatic = nullptr;                 // the decoupler, if it is method "auto"
        std::uint64_t (*clock_ns)() noexcept = &now_ns;  // clock for the methods of "auto"
        std::uint64_t (*boot_ns)() noexcept = &with_suspend_ns;
    };
    explicit Sensor(Setup setup)
        : setup_(std::move(setup)),
          tuning_(std::make_unique<Tuning>(std::move(setup_.tuning))),
          stream_(*tuning_),
          agreement_(tuning_->pair),
          zero_(*tuning_, setup_.needs_tare, setup_.zero),
          thermometer_(*tuning_) {
        if (setup_.decoupler != nullptr) {
            patch_ = setup_.decoupler->patch();
            set_delay();
            setup_.decoupler->set_temperature(setup_.temperature);
        }
        set(SensorSettable::as_configured());
        if (setup_.automatic != nullptr) method_ = setup_.automatic->choice().now();
    }

    // Sets the daemon's epoch, the upper half of each sample's epoch. Call it once, before the first sample. setup
    void start(std::uint32_t daemon_epoch, std::uint64_t now_ns) noexcept;

    // Returns the sample for a frame that arrived, with the taxels of an array. With method "auto", each sample after a tare
    // also runs one of the other methods from its initial state, until each has its zero; so does the first sample after a
    // change of the method. rt: bounded by the model's decouple()
    [[nodiscard]] tactiled_sample sample(const Frame& frame, std::uint64_t now_ns, const Taxels& taxels = {}) noexcept;
    // The model of an array, nullptr if the sensor is none.
    [[nodiscard]] Patch* patch() const noexcept { return patch_; }

    // Known delay of each channel of the model, s. Empty = none.
    [[nodiscard]] const std::vector<double>& delay_s() const noexcept { return tuning_->delay_s; }

    // The sensor whose temperature this sensor uses, -1: none. Pass the last sample of that sensor to take_temperature()
    // before each sample().
    // rt: wait-free
    [[nodiscard]] int temperature_of_sensor() const noexcept { return setup_.temperature_of_sensor; }
    void take_temperature(const tactiled_sample& of_other) noexcept {
        others_temperature_C_ = double(of_other.temperature_C);
    }

    // The sensor with which this sensor is compared, -1: none.
    [[nodiscard]] int agrees_with() const noexcept { return agreement_.other(); }
    // Compares the last sample with the other sensor's and returns the last sample, as UNCERTAIN if the forces have differed
    // for too long.
    // rt: wait-free
    const tactiled_sample& compare(const tactiled_sample& others) noexcept;

    // Returns true if there is a new discontinuity, or its reason has changed; marker() must then be published. `connected`
    // is the link's state.
    // rt: wait-free
    [[nodiscard]] bool has_discontinuity(bool connected, std::uint64_t now_ns) noexcept {
        notice_suspension(now_ns);
        return stream_.has_discontinuity(connected, now_ns);
    }
    // Returns the time by which has_discontinuity() must be called again if no frame arrives and the link's state
    // does not change. rt: wait-free
    [[nodiscard]] std::uint64_t deadline_ns(std::uint64_t now_ns) const noexcept { return stream_.deadline_ns(now_ns); }
    // Returns a BAD sample with the reason why there is no value. rt: wait-free
    [[nodiscard]] tactiled_sample marker(std::uint64_t now_ns) noexcept;
    // Does the same as the daemon stops. rt: wait-free
    void stop(std::uint64_t now_ns) noexcept {
        (void)marker(now_ns);
        tactiled_invalidate(&placed_.sample, TACTILED_DAEMON_STOPPED);
    }
    [[nodiscard]] bool is_delivering() const noexcept { return stream_.broken() == 0; }

    // Returns true if the present value may be a zero and no tare is running. rt: wait-free
    [[nodiscard]] bool can_tare() const noexcept {
        return is_delivering() && Zero::can_be_zero(placed_.sample) && zero_.tare() == Tare::none;
    }
    // Begins to average a new zero; can_tare() must be true. rt: wait-free
    void begin_tare(std::uint64_t now_ns) noexcept {
        zero_.begin_tare(now_ns);
        thermometer_.begin_tare();
        if (patch_ != nullptr) patch_->begin_tare();
    }
    // Returns to the calibration's zero with the next sample, or immediately if no sample arrives. rt: wait-free
    void begin_untare() noexcept {
        zero_.begin_removal(is_delivering());
        if (patch_ != nullptr) patch_->untare();
        may_be_another_ = false;
        low_pass_.reset();
    }
    using Tare = tactiled::Tare;
    // Returns the state of the tare; a tare that has ended is reported once. rt: wait-free
    [[nodiscard]] Tare poll_tare(std::uint64_t now_ns) noexcept {
        const bool was_running = zero_.tare() != Tare::none && zero_.tare() != Tare::removing;
        const Tare tare = zero_.poll(is_delivering(), now_ns);
        if (was_running && tare != Tare::running && tare != Tare::done) {
            thermometer_.fail_tare();
            if (patch_ != nullptr) patch_->end_tare(false);
        }
        return tare;
    }

    // Changes the settings from the next sample on. rt: wait-free
    void set(const SensorSettable& settable) noexcept;
    // Exchanges the tuning with `other`, which differs only in its tuning. rt: wait-free
    void retune(Sensor& other) noexcept;
    // Takes the place of `before`, which measured differently, in a new epoch and without the tare of `before`: if there was
    // a tare, the zero is unknown until the next tare. Publish marker() afterwards. rt: wait-free
    void succeed(const Sensor& before) noexcept;
    // Restarts the peak with the next sample. rt: wait-free
    void reset_peak() noexcept { peak_N_ = 0; }

    [[nodiscard]] const tactiled_sample& last() const noexcept { return placed_.sample; }
    // Returns the estimate of the last frame that was not late, before checks of the stream, zero and low pass. rt:
    // wait-free
    [[nodiscard]] const Estimate& estimate() const noexcept { return estimate_; }
    // Returns the record of the last sample. rt: wait-free
    [[nodiscard]] const tactiled_placed& placed() const noexcept { return placed_; }
    // Returns the zeros of the tare in force and their id, for the next start of the daemon. rt: wait-free
    [[nodiscard]] TaredZero tared_zero() const noexcept { return zero_.tared(); }
    [[nodiscard]] std::uint32_t zero_id() const noexcept { return setup_.zero_id; }
    [[nodiscard]] bool has_lost_zero() const noexcept { return zero_.is_lost(); }
    [[nodiscard]] bool doubts_zero() const noexcept { return zero_.is_doubted(); }
    // Returns the force by which the next run knows that the device still has its zero; nullopt: the zero is doubted.
    [[nodiscard]] std::optional<LastForce> last_force() const noexcept {
        if (zero_.is_doubted()) return std::nullopt;
        if (!may_be_another_ && !jumps_.has_value()) return std::nullopt;
        LastForce last = may_be_another_ ? jumps_.marked() : jumps_.last();
        last.stepped = zero_.stepped();
        return last;
    }
    // Returns true if, with method "auto", a method still needs its zero from the last tare.
    [[nodiscard]] bool is_finding_zeros() const noexcept { return zero_.has_more_to_find(); }
    // Continues with the tare of an earlier run, `age_ns` ago, which is doubted unless the first force is the last one of
    // that run, or marks that tare as lost. Before the first sample, or for the rows of a file after those of a tare. setup
    void restore_zero(const TaredZero& zero, std::int64_t age_ns, const std::optional<LastForce>& last) noexcept;
    void lose_zero() noexcept { zero_.lose(); }
    // Returns the zero that was subtracted from the raw wrench of the last sample, from its publication to the next sample.
    [[nodiscard]] Wrench zero_S() const noexcept { return zero_.of(method_); }
    // An object may be held, so that no reading is a free rest. rt: wait-free
    void may_hold(bool may) noexcept { may_hold_ = may; }
    [[nodiscard]] bool may_hold() const noexcept { return may_hold_; }

private:
    // Detects a suspension. CLOCK_MONOTONIC stops during a suspension, so that all waiting data would seem to be new.
    // rt: wait-free
    void notice_suspension(std::uint64_t now_ns) noexcept;
    [[nodiscard]] inline tactiled_sample late_sample(const Frame& frame, std::uint64_t now_ns) noexcept;
    // Defined in sensor.cpp, the only user.
    [[nodiscard]] inline tactiled_sample next_sample(std::uint64_t t_ns, std::uint64_t now_ns) noexcept;
    [[nodiscard]] Estimate estimate(const Frame& frame, const Taxels& taxels, tactiled_sample& sample) noexcept;
    [[nodiscard]] static inline Taxels taxels_of(const Frame& frame, const TaxelShape& shape,
                                                 std::span<float> value) noexcept;
    [[nodiscard]] inline Reading read(const Frame& frame, std::array<double, kMaxChannels>& raw) noexcept;
    [[nodiscard]] inline double temperature_C(const Frame& frame) noexcept;
    [[nodiscard]] static bool is_confirmed(const tactiled_sample& s) noexcept { return (s.reasons & TACTILED_STEPPED) == 0; }
    [[nodiscard]] bool is_of_another_device(const Frame& frame) const noexcept;
    [[nodiscard]] Estimate decouple(const Reading& reading) noexcept;
    [[nodiscard]] std::uint32_t epoch() const noexcept {
        return daemon_epoch_ << 16 | (stream_.discontinuities() & 0xFFFFu);
    }
    void take_over_method() noexcept;
    void put_method(tactiled_sample& sample) const noexcept;
    inline void keep(tactiled_sample& sample) noexcept;
    inline void judge_age(Frame::Age age, tactiled_sample& sample) const noexcept;
    inline void follow_device(const Frame& frame, bool has_all) noexcept;
    inline void judge_jump(std::uint32_t lost, tactiled_sample& sample) noexcept;
    inline void follow_tare(tactiled_sample& sample) noexcept;
    inline void judge_zero(tactiled_sample& sample) noexcept;
    inline void judge_latency(tactiled_sample& sample) noexcept;
    void put_tared(tactiled_sample& sample) noexcept;
    inline void put_place(const Wrench& tared, const Wrench& sd, tactiled_sample& sample) noexcept;
    void judge_magnitude(tactiled_sample& sample) noexcept;
    void break_rest() noexcept {
        rest_begins_ = true;
        has_rested_ = false;
    }
    inline void follow_rest(tactiled_sample& sample) noexcept;
    inline void end_rest() noexcept;
    // Returns a sample's time with the time in which the machine was suspended.
    [[nodiscard]] std::int64_t true_ns(std::uint64_t t_ns) const noexcept { return std::int64_t(t_ns + suspended_ns_); }
    void set_delay() noexcept {
        if (setup_.decoupler == nullptr) return;
        setup_.decoupler->set_delay(tuning_->delay_s);
        const Wrench delay_s = delay_of_components_s(*setup_.decoupler, tuning_->delay_s);
        if (delay_s != delay_s_) latency_.set_delay(delay_s_ = delay_s);
        if (patch_ == nullptr) return;
        patch_->set_frozen_after(tuning_->frozen_after);
        patch_->set_saturates_at(tuning_->saturates_at);
    }

    Setup setup_;                     // `tuning` is moved to tuning_
    Patch* patch_ = nullptr;          // the decoupler, if it is an array's
    std::unique_ptr<Tuning> tuning_;  // the parts below point to it
    SensorSettable requested_, in_force_;
    StreamQuality stream_;
    JumpCheck jumps_;
    Continuity continuity_;
    bool may_have_started_ = false;  // the device may have started again since the last confirmed sample
    bool may_be_another_ = false;    // the same, or have been exchanged
    Agreement agreement_;
    Zero zero_;
    TareWindow rest_;          // the last samples without contact
    bool rest_begins_ = true;  // with the next sample without contact
    bool has_rested_ = false;  // rest_ is complete
    bool is_free_ = false;     // it may show the zero
    bool may_hold_ = false;    // an object may be held
    double rest_N_ = 0;        // magnitude of the last rest's mean, before the tare
    Estimate estimate_;        // last sample
    SdStages sd_;
    Thermometer thermometer_;
    std::size_t method_ = 0;  // method "auto": method of zero_S() and low_pass_; else 0
    LowPass low_pass_;
    Latency latency_;
    Wrench delay_s_{};                            // each component's chain
    std::array<double, kMaxChannels> channel_{};  // channels of the last frame, in the unit of the calibration
    double others_temperature_C_ = kNaN;
    float peak_N_ = 0;
    bool has_contact_ = false;                  // the last confirmed sample had contact
    PressPlace of_model_{};                     // the place that the model found by itself, in the last sample
    tactiled_placed placed_{};                  // the last sample, and what is appended to it
    std::uint32_t own_quality_ = TACTILED_BAD;  // quality of the last confirmed sample, before it was compared
    std::uint64_t sequence_ = 0;
    std::uint32_t daemon_epoch_ = 0;
    std::uint64_t suspended_ns_ = 0;  // largest observed total since boot, less an accepted error
    bool is_started_ = false;         // suspended_ns_ is known
};

}  // namespace tactiled
