// Model "generic", method "rbf": radial basis functions around m centres (k-means of the calibration's readings), on top of
// the quadratic where there is one:
//
//     g_c(u) = quadratic_c(u) + sum over j of W[c][j] / (1 + |u - centre_j|^2 / spread^2)
//
// The inverse quadratic is as smooth as a Gaussian, falls off more gently between centres, and needs no exponential.
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
        double sums[6][kLanes]{};  // a row a component; each lane by itself
        const double *centre = centres_.data(), *weight = weights_.data();
        for (std::size_t block = 0; block < blocks_; ++block) {
            double near[kLanes]{};  // the squared distance, then what the centre answers
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

}  // namespace

std::unique_ptr<Correction> make_rbf(const Calibration& calibration, std::string& fault) {
    const std::size_t n = calibration.channels.size();
    const auto* centres = table_of(calibration, "centres", 0, n, fault);
    if (centres == nullptr) return nullptr;
    const auto* weights = table_of(calibration, "weights", calibration.components.size(), centres->size(), fault);
    if (weights == nullptr) return nullptr;
    const auto spread = calibration.parameters.find("spread");
    if (spread == calibration.parameters.end() || !(spread->second > 0)) {
        fault = "parameter spread is missing or not above 0";
        return nullptr;
    }
    std::unique_ptr<Correction> quadratic;
    if (calibration.tables.count("quadratic") != 0) {
        quadratic = make_quadratic(calibration, fault);
        if (quadratic == nullptr) return nullptr;
    }
    return std::make_unique<Rbf>(n, *centres, *weights, spread->second, std::move(quadratic));
}

}  // namespace tactiled
