// A method of the existing model "generic": g_c(u) = sum over k of K[c][k] u_k^3 on top of the matrix. One new file and one
// line in tests/CMakeLists.txt.
#include "decoupling/generic/methods.hpp"

namespace tactiled {
namespace {

class Cubic final : public Correction {
public:
    explicit Cubic(const NumberRows& gains) : gains_(gains) {}
    void add(const double* u, double* out) noexcept override {
        for (std::size_t c = 0; c < gains_.size(); ++c)
            for (std::size_t k = 0; k < gains_[c].size(); ++k) out[c] += gains_[c][k] * u[k] * u[k] * u[k];
    }

private:
    NumberRows gains_;
};

constexpr std::array<KnownTable, 2> kTables{{kWidth, {"cubic", kPerComponent, kPerChannel}}};

std::unique_ptr<Decoupler> make_cubic(const CalibrationData& data, std::string& fault) {
    return make_generic(data, "cubic", std::make_unique<Cubic>(*data.table("cubic")), fault);
}

const MethodEntry entry{
    .model = "generic", .method = "cubic", .place = 25, .tables = kTables, .make = make_cubic, .takes_fit_of = kAnyMethod};

}  // namespace
}  // namespace tactiled
