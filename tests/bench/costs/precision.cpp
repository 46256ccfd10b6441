// The same kernel in float and in double: what single precision would save and what it would lose. The product computes in
// double alone; these are its sums, for this measurement, with the scalar left open.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <random>

#include "tests/bench/costs/cost.hpp"
#include "tests/bench/costs/turns.hpp"

namespace tactiled::ctl {
namespace {

constexpr std::size_t kChannels = 15, kComponents = 3, kCentres = 104, kLanes = 8, kReadings = 1024;
constexpr std::size_t kFeatures = 1 + kChannels + kChannels * (kChannels + 1) / 2;

// Random constants of a skin of 15 channels, each rounded to float: the inputs are the same in every precision.
template <class T>
struct Kernels {
    std::array<std::array<T, kChannels>, kComponents> matrix;
    std::array<std::array<T, kFeatures>, kComponents> q;
    std::array<std::array<std::array<T, kLanes>, kChannels>, kCentres / kLanes> centre;
    std::array<std::array<std::array<T, kLanes>, kComponents>, kCentres / kLanes> weight;
    std::array<std::array<T, kChannels>, kReadings> u;

    Kernels() {
        std::mt19937_64 random(1);
        std::normal_distribution<float> normal;
        const auto fill = [&](auto& row) {
            for (auto& number : row) number = T(normal(random));
        };
        for (auto& row : matrix) fill(row);
        for (auto& row : q) fill(row);
        for (auto& block : centre)
            for (auto& row : block) fill(row);
        for (auto& block : weight)
            for (auto& row : block) fill(row);
        for (auto& row : u) fill(row);
    }

    using Out = std::array<T, kComponents>;
    [[nodiscard]] Out by_matrix(std::size_t i) const noexcept {
        Out out{};
        for (std::size_t c = 0; c < kComponents; ++c)
            for (std::size_t k = 0; k < kChannels; ++k) out[c] += matrix[c][k] * u[i][k];
        return out;
    }
    [[nodiscard]] Out by_quadratic(std::size_t i) const noexcept {
        Out out = by_matrix(i);
        for (std::size_t c = 0; c < kComponents; ++c) {
            const T* at = q[c].data();
            T sum = *at++;
            for (std::size_t k = 0; k < kChannels; ++k) sum += *at++ * u[i][k];
            for (std::size_t k = 0; k < kChannels; ++k) {
                T part = 0;
                for (std::size_t j = k; j < kChannels; ++j) part += *at++ * u[i][j];
                sum += u[i][k] * part;
            }
            out[c] += sum;
        }
        return out;
    }
    [[nodiscard]] Out by_rbf(std::size_t i) const noexcept {
        Out out = by_quadratic(i);
        std::array<std::array<T, kLanes>, kComponents> sums{};
        for (std::size_t block = 0; block < kCentres / kLanes; ++block) {
            std::array<T, kLanes> d2{};
            for (std::size_t k = 0; k < kChannels; ++k)
                for (std::size_t lane = 0; lane < kLanes; ++lane) {
                    const T d = u[i][k] - centre[block][k][lane];
                    d2[lane] += d * d;
                }
            for (T& d : d2) d = 1 / (1 + d / T(kChannels));
            for (std::size_t c = 0; c < kComponents; ++c)
                for (std::size_t lane = 0; lane < kLanes; ++lane) sums[c][lane] += weight[block][c][lane] * d2[lane];
        }
        for (std::size_t c = 0; c < kComponents; ++c)
            for (const T sum : sums[c]) out[c] += sum;
        return out;
    }
};

template <class T>
using Kernel = std::array<T, kComponents> (Kernels<T>::*)(std::size_t) const noexcept;

// Largest error of any component, as a part of the largest output, against long double.
template <class T>
double error(const Kernels<T>& kernels, Kernel<T> kernel, const Kernels<long double>& exact,
             Kernel<long double> exact_kernel) {
    long double worst = 0, full_scale = 0;
    for (std::size_t i = 0; i < kReadings; ++i) {
        const auto is = (kernels.*kernel)(i);
        const auto should = (exact.*exact_kernel)(i);
        for (std::size_t c = 0; c < kComponents; ++c) {
            worst = std::max(worst, std::abs(static_cast<long double>(is[c]) - should[c]));
            full_scale = std::max(full_scale, std::abs(should[c]));
        }
    }
    return double(worst / full_scale);
}

template <class T>
Contender contender(const Kernels<T>& kernels, Kernel<T> kernel) {
    return [&kernels, kernel](std::size_t first, std::size_t last) {
        double sum = 0;
        for (std::size_t i = first; i < last; ++i) sum += double((kernels.*kernel)(i % kReadings)[0]);
        return sum;
    };
}

Cost measure(const CostSetup& setup) {
    const auto single = std::make_unique<Kernels<float>>();
    const auto twice = std::make_unique<Kernels<double>>();
    const auto exact = std::make_unique<Kernels<long double>>();
    using F = Kernels<float>;
    using D = Kernels<double>;
    using L = Kernels<long double>;
    const auto ns = ns_alternating({contender<float>(*single, &F::by_matrix), contender<double>(*twice, &D::by_matrix),
                                    contender<float>(*single, &F::by_quadratic), contender<double>(*twice, &D::by_quadratic),
                                    contender<float>(*single, &F::by_rbf), contender<double>(*twice, &D::by_rbf)},
                                   setup.samples_or(100'000));
    const double errors[] = {error<float>(*single, &F::by_matrix, *exact, &L::by_matrix),
                             error<double>(*twice, &D::by_matrix, *exact, &L::by_matrix),
                             error<float>(*single, &F::by_quadratic, *exact, &L::by_quadratic),
                             error<double>(*twice, &D::by_quadratic, *exact, &L::by_quadratic),
                             error<float>(*single, &F::by_rbf, *exact, &L::by_rbf),
                             error<double>(*twice, &D::by_rbf, *exact, &L::by_rbf)};
    Cost cost;
    cost.columns = {"kernel", "bytes_a_number", "ns", "error_of_full_scale"};
    Figure::Series in_float{"float", Symbol::ring, Stroke::none},
        in_double{"double, as the product", Symbol::circle, Stroke::none};
    const char* names[] = {"matrix", "quadratic", "rbf of 104 centres"};
    double saved_ns = 0, worst_float = 0, worst_double = 0;
    for (std::size_t k = 0; k < 6; ++k) {
        const bool is_float = k % 2 == 0;
        cost.rows.push_back(
            {fmt::format("{}, {}", names[k / 2], is_float ? "float" : "double"), {is_float ? 4.0 : 8.0, ns[k], errors[k]}});
        (is_float ? in_float : in_double).points.push_back({ns[k], errors[k], names[k / 2]});
        (is_float ? worst_float : worst_double) = std::max(is_float ? worst_float : worst_double, errors[k]);
        if (is_float) saved_ns = std::max(saved_ns, ns[k + 1] - ns[k]);
    }
    cost.figure = {"Precision: rounding against time, 15 channels to 3 forces",
                   {"time a sample, ns (the sums alone)", true},
                   {"largest rounding error, part of full scale", true},
                   {in_float, in_double}};
    cost.advice = fmt::format(
        "{}: float would save at most {:.0f} ns a sample, {:.2g} % of a period of 1 ms, and round {:.0e} "
        "times more coarsely ({:.1g} of full scale, not {:.1g}).",
        saved_ns < 1e5 ? "Keep double" : "Weigh float", saved_ns, saved_ns / 1e6 * 100, worst_float / worst_double,
        worst_float, worst_double);
    return cost;
}

}  // namespace

extern const CostEntry precision_cost;
const CostEntry precision_cost{"precision", "float against double: rounding against time", "decoupling/costs_precision.svg",
                               measure};

}  // namespace tactiled::ctl
