// Model "generic", method "rbf": radial basis functions around m centres (k-means of the calibration's readings), in
// addition to the quadratic if there is one:
//
//     g_c(u) = quadratic_c(u) + sum over j of W[c][j] / (1 + |u - centre_j|^2 / spread^2)
//
// The inverse quadratic is as smooth as a Gaussian, decreases more slowly between centres, and needs no exponential.
#include "decoupling/generic/methods.hpp"

namespace tactiled {
namespace {

// Eight centres at a time, side by side in memory: their distances stay in registers from the first channel to the last.
constexpr std::size_t kLanes = 8;

class Rbf final : public Correction {
public:
    Rbf(std::size_t n, const std::vector<std::vector<double>>& centres, const std::vector<std::vector<double>>& weights,
        double spread, std::unique_ptr<Correction> quadratic)
        : n_(n),
          components_(weights.size()),
          blocks_((centres.size() + kLanes - 1) / kLanes),
          quadratic_(std::move(quadratic)) {
        centres_.assign(blocks_ * n * kLanes, 0.0);
        weights_.assign(blocks_ * components_ * kLanes, 0.0);  // 0 for those beyond the last
        per_spread2_ = 1 / (spread * spread);
        for (std::size_t j = 0; j < centres.size(); ++j) {
            const std::size_t block = j / kLanes, lane = j % kLanes;
            for (std::size_t k = 0; k < n; ++k) centres_[(block * n + k) * kLanes + lane] = centres[j][k];
            for (std::size_t i = 0; i < components_; ++i)
                weights_[(block * components_ + i) * kLanes + lane] = weights[i][j];
        }
    }
    void add(const double* u, double* out) noexcept override {
        if (quadratic_ != nullptr) quadratic_->add(u, out);
        double sums[6][kLanes]{};  // one row per component, summed per lane
        const double *centre = centres_.data(), *weight = weights_.data();
        for (std::size_t block = 0; block < blocks_; ++block) {
            double near[kLanes]{};  // the squared distance, then the value of the basis function
            for (std::size_t k = 0; k < n_; ++k, centre += kLanes)
                for (std::size_t i = 0; i < kLanes; ++i) {
                    const double d = centre[i] - u[k];
                    near[i] += d * d;
                }
            for (std::size_t i = 0; i < kLanes; ++i) near[i] = 1 / (1 + near[i] * per_spread2_);
            for (std::size_t c = 0; c < components_; ++c, weight += kLanes)
                for (std::size_t i = 0; i < kLanes; ++i) sums[c][i] += weight[i] * near[i];
        }
        for (std::size_t c = 0; c < components_; ++c)
            for (const double sum : sums[c]) out[c] += sum;
    }

private:
    std::size_t n_, components_, blocks_;
    std::vector<double> centres_, weights_;
    double per_spread2_;
    std::unique_ptr<Correction> quadratic_;
};

constexpr std::array<Parameter, 2> kParameters{
    {{"spread", "distance, in widths, at which a centre counts half", kAboveZero, kLargest},
     {"ridge", "of the fit; reported, not used", 0, kLargest, 0}}};
constexpr std::array<KnownTable, 4> kTables{{kWidth,
                                             {"centres", kAnyNumber, kPerChannel},
                                             {"weights", kPerComponent, kAnyNumber},
                                             {"quadratic", kPerComponent, kAnyNumber, false}}};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    const auto* centres = data.table("centres");
    const auto* weights = data.table("weights", data.calibration().components.size(), centres->size(), fault);
    std::unique_ptr<Correction> quadratic;
    if (fault.empty() && data.table("quadratic") != nullptr) quadratic = make_quadratic(data, fault);
    if (!fault.empty()) return nullptr;
    return make_generic(
        data, "rbf",
        std::make_unique<Rbf>(data.calibration().channels.size(), *centres, *weights, data["spread"], std::move(quadratic)),
        fault);
}

const MethodEntry entry{.model = "generic",
                        .method = "rbf",
                        .place = 30,
                        .parameters = kParameters,
                        .tables = kTables,
                        .make = make,
                        .takes_fit_of = kAnyMethod};

}  // namespace
}  // namespace tactiled
