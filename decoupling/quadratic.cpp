// Model "generic", method "quadratic": g_c(u) = Q[c] . (1, u_1 .. u_n, u_1 u_1, u_1 u_2 .. u_n u_n), products in the order
// of the upper triangle by rows.
#include "decoupling/generic_methods.hpp"

namespace tactiled {
namespace {

class Quadratic final : public Correction {
public:
    Quadratic(std::size_t n, const std::vector<std::vector<double>>& q)
        : n_(n), rows_(q.size()), per_row_(q.front().size()) {
        for (const auto& row : q) q_.insert(q_.end(), row.begin(), row.end());
    }
    void add(const double* u, double* out) noexcept override {
        for (std::size_t i = 0; i < rows_; ++i) {
            const double* q = &q_[i * per_row_];
            double sum = *q++;
            for (std::size_t k = 0; k < n_; ++k) sum += *q++ * u[k];
            for (std::size_t k = 0; k < n_; ++k) {
                double part = 0;
                for (std::size_t j = k; j < n_; ++j) part += *q++ * u[j];
                sum += u[k] * part;
            }
            out[i] += sum;
        }
    }

private:
    std::size_t n_, rows_, per_row_;
    std::vector<double> q_;
};

}  // namespace

std::unique_ptr<Correction> make_quadratic(const Calibration& calibration, std::string& fault) {
    const std::size_t n = calibration.channels.size();
    const auto* q = table_of(calibration, "quadratic", calibration.components.size(), 1 + n + n * (n + 1) / 2, fault);
    return q == nullptr ? nullptr : std::make_unique<Quadratic>(n, *q);
}

}  // namespace tactiled
