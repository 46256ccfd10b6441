// An array of taxels: the cost of one among many. In the product each taxel is a sensor with its own model, computed
// one after the other (node/pipeline.cpp). For comparison: the matrix alone, one by one and all together.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "node/sensor.hpp"
#include "tests/bench/costs/influence.hpp"
#include "tests/bench/costs/turns.hpp"

namespace tactiled::ctl {
namespace {

constexpr std::size_t kGauges = 8, kMaxTaxels = 16, kBatches[] = {1, 2, 4, 8, 16};

// Computes taxels like deliver(): a frame for each taxel, each to its sensor.
Contender taxels_of(const Calibration& calibration, std::size_t n, const std::vector<double>& reading) {
    auto sensors = std::make_shared<std::vector<Sensor>>();
    for (std::size_t i = 0; i < n; ++i) {
        Sensor::Setup setup;
        for (int k = 0; k < int(kGauges); ++k) setup.channel_of_frame.push_back(k);
        setup.frame_channels = kGauges;
        setup.decoupler = make_decoupler(calibration);
        sensors->emplace_back(std::move(setup));
    }
    return [sensors, n, &reading](std::size_t first, std::size_t last) {
        double sum = 0;
        Frame frame;
        frame.n_channels = std::uint8_t(kGauges);
        for (std::size_t call = first; call < last; ++call)
            for (std::size_t i = 0; i < n; ++i) {
                const double scale = 1 + 0.3 * std::sin(0.02 * double(call + i));
                for (std::size_t k = 0; k < kGauges; ++k) frame.channel[k] = scale * reading[k];
                frame.t_ns = 1'000'000 * (call + 1);
                sum += (*sensors)[i].sample(frame, frame.t_ns).force_S_N[2];
            }
        return sum;
    };
}

// Three forces of eight gauges. Readings and forces gauge by gauge, the taxels side by side.
struct Skin {
    std::array<std::array<double, kGauges>, 3> matrix;
    std::array<std::array<double, kMaxTaxels>, kGauges> r;
    std::array<std::array<double, kMaxTaxels>, 3> force{};

    Skin() {
        for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t k = 0; k < kGauges; ++k) matrix[c][k] = std::sin(double(3 * k + c));
        for (std::size_t k = 0; k < kGauges; ++k)
            for (std::size_t i = 0; i < kMaxTaxels; ++i) r[k][i] = std::cos(double(5 * i + k));
    }
    // Up to four taxels in step, which is what twelve sums leave registers for; their number is known when it is compiled.
    template <std::size_t n>
    void together() noexcept {
        constexpr std::size_t kLanes = std::min<std::size_t>(n, 4);
        for (std::size_t first = 0; first < n; first += kLanes) {
            std::array<std::array<double, kLanes>, 3> sum{};
            for (std::size_t k = 0; k < kGauges; ++k)
                for (std::size_t c = 0; c < 3; ++c)
                    for (std::size_t i = 0; i < kLanes; ++i) sum[c][i] += matrix[c][k] * r[k][first + i];
            for (std::size_t c = 0; c < 3; ++c) std::copy(sum[c].begin(), sum[c].end(), &force[c][first]);
        }
    }
    template <std::size_t n>
    void one_by_one() noexcept {
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t c = 0; c < 3; ++c) {
                double sum = 0;
                for (std::size_t k = 0; k < kGauges; ++k) sum += matrix[c][k] * r[k][i];
                force[c][i] = sum;
            }
    }
};

Contender matrix_alone(void (Skin::*compute)() noexcept, std::size_t n) {
    return [skin = std::make_shared<Skin>(), compute, n](std::size_t first, std::size_t last) {
        double sum = 0;
        for (std::size_t call = first; call < last; ++call) {
            skin->r[call % kGauges][call % n] += 1e-6;
            (skin.get()->*compute)();
            sum += skin->force[2][n - 1];
        }
        return sum;
    };
}

Cost measure(const CostSetup& setup) {
    const Calibration linear = shipped_calibration(setup, "table_documents.toml"), map = influence_calibration(setup);
    // One that presses for `linear`; a point of the plate for `map`.
    const std::vector<double> spread{0.009, 0.001, 0.010, 0.001, 0.0105, -0.001, 0.0095, -0.001};
    const std::vector<double> point = contact_at_row(map, 300, 0).reading;
    std::vector<Contender> contenders;
    const auto add = [&]<std::size_t n>(std::integral_constant<std::size_t, n>) {
        contenders.push_back(taxels_of(linear, n, spread));
        contenders.push_back(taxels_of(map, n, point));
        contenders.push_back(matrix_alone(&Skin::one_by_one<n>, n));
        contenders.push_back(matrix_alone(&Skin::together<n>, n));
    };
    [&]<std::size_t... i>(std::index_sequence<i...>) { (add(std::integral_constant<std::size_t, kBatches[i]>{}), ...); }
    (std::make_index_sequence<std::size(kBatches)>{});
    const auto ns = ns_alternating(contenders, setup.samples_or(10'000));
    Cost cost;
    cost.columns = {"taxels", "linear_ns", "map_ns", "matrix_one_by_one_ns", "matrix_together_ns"};
    std::vector<Figure::Series> series{{"sensor, table/map", Symbol::triangle, Stroke::solid, {}, kInk},
                                       {"sensor, table/linear", Symbol::circle, Stroke::solid, {}, kBlue},
                                       {"the matrix alone, one by one", Symbol::ring, Stroke::solid, {}, kGrey},
                                       {"the matrix alone, together", Symbol::diamond, Stroke::solid, {}, kOrange}};
    for (std::size_t b = 0; b < std::size(kBatches); ++b) {
        const double n = double(kBatches[b]);
        const double* at = &ns[4 * b];
        cost.rows.push_back({fmt::format("{}", kBatches[b]), {at[0] / n, at[1] / n, at[2] / n, at[3] / n}});
        const std::size_t order[] = {1, 0, 2, 3};
        for (std::size_t i = 0; i < 4; ++i)
            series[i].points.push_back(
                {n, at[order[i]] / n, b + 1 == std::size(kBatches) ? fmt::format("{:.0f} ns", at[order[i]] / n) : ""});
    }
    cost.figure = {"Array: time a taxel against the number of taxels",
                   {"taxels that are asked in one turn (4 x 4 = 16)", true},
                   {"time a taxel, ns", true},
                   std::move(series)};
    const auto &one = cost.rows.front().values, &all = cost.rows.back().values;
    const double gain_ns = all[2] - all[3];
    cost.advice = fmt::format(
        "{}: one of sixteen costs {:.0f} ns with table/linear, alone {:.0f} ns, "
        "and sums over all taxels together would save {}; with table/map {:.2f} us, alone {:.2f} us, for each has a "
        "map of its own.",
        gain_ns < 0.1 * all[0] ? "Let each taxel stay a sensor of its own" : "Sum over all taxels together", all[0], one[0],
        gain_ns >= 0.1 ? fmt::format("{:.1f} ns of it", gain_ns) : std::string("nothing"), all[1] / 1000, one[1] / 1000);
    return cost;
}

}  // namespace

extern const CostEntry batch_cost;
const CostEntry batch_cost{"batch", "array of taxels: time a taxel against the number of taxels",
                           "decoupling/costs_batch.svg", measure};

}  // namespace tactiled::ctl
