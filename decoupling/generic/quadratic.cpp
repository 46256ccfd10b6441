// Model "generic", method "quadratic": g_c(u) = Q[c] . (1, u_1 .. u_n, u_1 u_1, u_1 u_2 .. u_n u_n), products in the order
// of the upper triangle by rows.
#include "decoupling/generic/methods.hpp"

namespace tactiled {
namespace {

// Sums the components in parallel, each with the same result as alone: `kPairs` pairs of them, because two fill a
// register of any x86-64 and AArch64.
template <std::size_t kPairs>
class Quadratic final : public Correction {
public:
    Quadratic(std::size_t n, const std::vector<std::vector<double>>& q)
        : n_(n), components_(q.size()), features_(q.front().size()) {
        for (std::size_t c = 0; c < components_; ++c)
            for (std::size_t f = 0; f < features_.size(); ++f) features_[f].of[c] = q[c][f];
    }
    void add(const double* u, double* out) noexcept override {
        const Components* q = features_.data();
        Components sum = *q++;
        for (std::size_t k = 0; k < n_; ++k) add_to(sum, *q++, u[k]);
        for (std::size_t k = 0; k < n_; ++k) {
            Components part;
            for (std::size_t j = k; j < n_; ++j) add_to(part, *q++, u[j]);
            add_to(sum, part, u[k]);
        }
        for (std::size_t c = 0; c < components_; ++c) out[c] += sum.of[c];
    }

private:
    struct Components {
        double of[2 * kPairs]{};  // one number per component, then 0
    };
    static void add_to(Components& sum, const Components& q, double u) noexcept {
        for (std::size_t i = 0; i < 2 * kPairs; ++i) sum.of[i] += q.of[i] * u;
    }

    std::size_t n_, components_;
    std::vector<Components> features_;
};

// "ridge": of the fit; reported, not used.
constexpr std::array<KnownTable, 3> kTables{
    {kWidth, {"quadratic", kPerComponent, kAnyNumber}, {"ridge", 1, kPerComponent, false}}};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    auto correction = make_quadratic(data, fault);
    return make_generic(data, "quadratic", std::move(correction), fault);
}

const MethodEntry entry{
    .model = "generic", .method = "quadratic", .place = 20, .tables = kTables, .make = make, .takes_fit_of = kAnyMethod};

}  // namespace

std::unique_ptr<Correction> make_quadratic(const CalibrationData& data, std::string& fault) {
    const std::size_t n = data.calibration().channels.size();
    const auto* q = data.table("quadratic", data.calibration().components.size(), 1 + n + n * (n + 1) / 2, fault);
    if (q == nullptr) return nullptr;
    if (q->size() <= 2) return std::make_unique<Quadratic<1>>(n, *q);
    if (q->size() <= 4) return std::make_unique<Quadratic<2>>(n, *q);
    return std::make_unique<Quadratic<3>>(n, *q);
}

}  // namespace tactiled
