// One sensor in the pipeline: Frame -> Reading -> Estimate -> tactiled_sample. Picks its channels, has their stream judged
// (quality.hpp), asks its model, subtracts its zero (zero.hpp). Knows neither links nor shared memory.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "decoupling/auto_method.hpp"
#include "decoupling/latency.hpp"
#include "drivers/clock.hpp"
#include "drivers/frame.hpp"
#include "node/agreement.hpp"
#include "node/low_pass.hpp"
#include "node/quality.hpp"
#include "node/zero.hpp"
#include "tactiled/layout.h"

namespace tactiled {

// Settings that may change while the daemon runs. NaN stands for the configured value.
struct SensorSettable {
    double filter_Hz = 0;                             // low pass on force and torque, 0 = off
    double contact_on_N = 0.5, contact_off_N = 0.25;  // of the magnitude of the components that the sensor sees
    double overload_N = 0;                            // 0 = none

    static constexpr SensorSettable as_configured() { return {kNaN, kNaN, kNaN, kNaN}; }
};

class Sensor {
public:
    struct Setup {
        std::vector<int> channel_of_frame;  // for each channel of the model, its index in the frame
        std::size_t frame_channels = 0;     // that a frame of this device has
        double counts_per_unit = 1;
        double saturates_below = -std::numeric_limits<double>::infinity();
        double saturates_above = std::numeric_limits<double>::infinity();
        StreamLimits stream;
        double drift_N = 0;  // of the zero at rest from the calibration's, 0 = not judged
        std::uint64_t tare_ns = 100'000'000;
        double tare_limit_N = 0;                            // of a new zero from the calibration's, 0 = none
        std::array<double, 3> tare_limit_of_component_N{};  // likewise, of each component of the force
        bool accept_unproved_age = false;  // a stream without a clock or a counter may be tared and weighed with
        std::uint32_t zero_id = 0;         // a kept zero of another id is not this sensor's (zero_store.hpp)
        int temperature_of_frame = -1;     // the channel of a frame that is its temperature in degC; -1: none
        double temperature_width_K = 0;    // of the range that is declared for its temperature; 0 = none
        double delay_s = 0;  // known one of converter and transmission: part of the standard deviation (latency.hpp)
        Agreement::Limits agreement;
        SensorSettable settable;
        std::unique_ptr<Decoupler> decoupler;
        AutoMethod* automatic = nullptr;                 // the decoupler, where it is method "auto"
        std::uint64_t (*clock_ns)() noexcept = &now_ns;  // times the methods of "auto"
    };
    explicit Sensor(Setup setup)
        : setup_(std::move(setup)),
          stream_(setup_.stream),
          drift_(setup_.drift_N),
          agreement_(setup_.agreement),
          zero_(tare_limits(setup_)) {
        if (setup_.decoupler != nullptr) {
            setup_.decoupler->set_delay(setup_.delay_s);
            setup_.decoupler->set_temperature_range(setup_.temperature_width_K);
        }
        set(SensorSettable::as_configured());
        if (setup_.automatic != nullptr) method_ = setup_.automatic->choice().now();
    }

    // The daemon's epoch goes into the upper half of each sample's. Call once, before the first sample. setup
    void start(std::uint32_t daemon_epoch, std::uint64_t now_ns) noexcept;

    // The sample for a frame that arrived. rt: bounded by the model's decouple(); with method "auto", in as many samples
    // after a tare as it has other methods, by one of these without a past on top, as in the first sample after a step
    [[nodiscard]] tactiled_sample sample(const Frame& frame, std::uint64_t now_ns) noexcept;

    // The sensor that this one is compared with, -1: none.
    [[nodiscard]] int agrees_with() const noexcept { return agreement_.other(); }
    // The last sample, compared with the other sensor's: UNCERTAIN when they differ for too long. rt: wait-free
    const tactiled_sample& compare(const tactiled_sample& others) noexcept;

    // True when the stream has just broken, or the reason has changed: then publish marker(). `connected` is the link's
    // state.
    // rt: wait-free
    [[nodiscard]] bool has_discontinuity(bool connected, std::uint64_t now_ns) noexcept {
        notice_suspension(now_ns);
        return stream_.has_discontinuity(connected, now_ns);
    }
    // has_discontinuity() must be asked again by then, if no frame arrives and the link's state stays. rt: wait-free
    [[nodiscard]] std::uint64_t deadline_ns(std::uint64_t now_ns) const noexcept { return stream_.deadline_ns(now_ns); }
    // A BAD sample with the reason why there is no value. rt: wait-free
    [[nodiscard]] tactiled_sample marker(std::uint64_t now_ns) noexcept;
    [[nodiscard]] bool is_delivering() const noexcept { return stream_.broken() == 0; }

    // The sensor has a value now that is fit to be a zero, and no tare is running. rt: wait-free
    [[nodiscard]] bool can_tare() const noexcept {
        return is_delivering() && Zero::can_be_zero(last_) && zero_.tare() == Tare::none;
    }
    // Begins to average a new zero; can_tare() must be true. rt: wait-free
    void begin_tare(std::uint64_t now_ns) noexcept { zero_.begin_tare(now_ns); }
    // Goes back to the calibration's zero with the next sample, at once where none is coming. rt: wait-free
    void begin_untare() noexcept {
        zero_.begin_removal(is_delivering());
        low_pass_.reset();
    }
    using Tare = tactiled::Tare;
    // The state of the tare; a tare that has ended is reported once. rt: wait-free
    [[nodiscard]] Tare poll_tare(std::uint64_t now_ns) noexcept { return zero_.poll(is_delivering(), now_ns); }

    // Takes effect with the next sample. rt: wait-free
    void set(const SensorSettable& settable) noexcept;
    // Takes over the limits and settings of `other`, which measures alike. rt: wait-free
    void retune(const Sensor& other) noexcept;
    // Continues in the place of `before`, which measured differently, in a new epoch and without its tare: if there was one,
    // the zero is not known until the next tare. Publish marker() afterwards. rt: wait-free
    void succeed(const Sensor& before) noexcept;
    // The peak starts again with the next sample. rt: wait-free
    void reset_peak() noexcept { peak_N_ = 0; }

    [[nodiscard]] const tactiled_sample& last() const noexcept { return last_; }
    // The zeros of the tare in force and the id that they belong to, for the next start of the daemon. rt: wait-free
    [[nodiscard]] TaredZero tared_zero() const noexcept { return zero_.tared(); }
    [[nodiscard]] std::uint32_t zero_id() const noexcept { return setup_.zero_id; }
    [[nodiscard]] bool has_lost_zero() const noexcept { return zero_.is_lost(); }
    // With method "auto": a method whose zero is yet to be found from the last tare.
    [[nodiscard]] bool is_finding_zeros() const noexcept { return zero_.has_more_to_find(); }
    // Continues with the tare of an earlier run, or knows that one is lost. Before the first sample. setup
    void restore_zero(const TaredZero& zero) noexcept { zero_.restore(zero); }
    void lose_zero() noexcept { zero_.lose(); }
    // The zero that was subtracted from the raw wrench of the last sample.
    [[nodiscard]] const Wrench& zero_S() const noexcept { return zero_.of(method_); }

private:
    // CLOCK_MONOTONIC stands still while the machine is suspended, so that all that waited would seem to be new. rt:
    // wait-free
    void notice_suspension(std::uint64_t now_ns) noexcept;
    [[nodiscard]] inline tactiled_sample late_sample(const Frame& frame, std::uint64_t now_ns) noexcept;
    [[nodiscard]] static Zero::Limits tare_limits(const Setup& setup) noexcept {
        return {setup.tare_ns, setup.tare_limit_N, setup.tare_limit_of_component_N};
    }
    // Inline where they are used, which is sensor.cpp alone.
    [[nodiscard]] inline tactiled_sample next_sample(std::uint64_t t_ns, std::uint64_t now_ns) noexcept;
    [[nodiscard]] Estimate estimate(const Frame& frame, tactiled_sample& sample) noexcept;
    [[nodiscard]] inline Reading read(const Frame& frame, std::array<double, kMaxChannels>& raw) noexcept;
    [[nodiscard]] Estimate decouple(const Reading& reading) noexcept;
    [[nodiscard]] std::uint32_t epoch() const noexcept {
        return daemon_epoch_ << 16 | (stream_.discontinuities() & 0xFFFFu);
    }
    void take_over_method() noexcept;
    void put_method(tactiled_sample& sample) const noexcept;
    inline void judge_age(Frame::Age age, tactiled_sample& sample) const noexcept;
    inline void follow_tare(tactiled_sample& sample) noexcept;
    void judge_zero(tactiled_sample& sample) const noexcept;
    inline void judge_latency(tactiled_sample& sample) noexcept;
    void put_tared(tactiled_sample& sample) noexcept;
    void judge_magnitude(tactiled_sample& sample) noexcept;

    Setup setup_;
    SensorSettable requested_, in_force_;
    StreamQuality stream_;
    ZeroDrift drift_;
    Agreement agreement_;
    Zero zero_;
    std::size_t method_ = 0;  // method "auto": that zero_S() and low_pass_ belong to; else 0
    LowPass low_pass_;
    Latency latency_;
    std::array<double, kMaxChannels> channel_{};  // of the last frame, in the unit of the calibration
    float peak_N_ = 0;
    tactiled_sample last_{};
    std::uint32_t own_quality_ = TACTILED_BAD;  // of last_, before it was compared
    std::uint64_t sequence_ = 0;
    std::uint32_t daemon_epoch_ = 0;
    std::uint64_t suspended_ns_ = 0;  // since boot, at least
    bool is_started_ = false;         // suspended_ns_ is known
};

}  // namespace tactiled
