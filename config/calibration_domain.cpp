#include "config/calibration_domain.hpp"

#include <fmt/format.h>

namespace tactiled {
namespace {

constexpr Range kFinite{-1e300, 1e300};  // room below overflow for products of a few numbers
constexpr Range kLimit{1e-9, 1e9};

// Reports rows that do not form a lower triangle.
void check_triangle(Options& table, const char* key, const std::vector<std::vector<double>>& rows) {
    for (std::size_t i = 0; i < rows.size(); ++i)
        if (rows[i].size() != i + 1)
            table.problem(
                key, fmt::format("{}[{}] has {} numbers; a lower triangle has {} there", key, i, rows[i].size(), i + 1));
}

void check_rows(Options& table, const char* key, const std::vector<std::vector<double>>& rows, std::size_t numbers) {
    for (std::size_t i = 0; i < rows.size(); ++i)
        if (rows[i].size() != numbers)
            table.problem(key, fmt::format("{}[{}] has {} numbers; {} are needed", key, i, rows[i].size(), numbers));
}

void read_curved_domain(Options& file, std::size_t n, CurvedDomain& domain) {
    if (!file.has("curved")) return;
    Options table = file.table("curved");
    domain.directions = table.rows("directions");
    domain.feature_mean = table.numbers("feature_mean", kFinite);
    domain.feature_whitening = table.rows("feature_whitening");
    domain.growth = table.number("growth", {0, 1e9});
    domain.coefficients = table.rows("coefficients");
    domain.whitening = table.rows("whitening");
    domain.limit = table.number("limit", kLimit);
    domain.false_alarms = table.number("false_alarms", {0, 1}, 0);
    const std::size_t m = domain.directions.size(), features = curved_features(m);
    if (m < 1 || m > kMaxDirections)
        table.problem("directions", fmt::format("directions has {} rows; 1 .. {} are possible", m, kMaxDirections));
    const auto check_size = [&](const char* key, std::size_t size, std::size_t needed) {
        if (size != needed) table.problem(key, fmt::format("{} has {} entries; {} are needed", key, size, needed));
    };
    check_size("feature_mean", domain.feature_mean.size(), features);
    check_size("feature_whitening", domain.feature_whitening.size(), features);
    check_triangle(table, "feature_whitening", domain.feature_whitening);
    check_rows(table, "coefficients", domain.coefficients, features);
    check_triangle(table, "whitening", domain.whitening);
    if (n == 0) return;
    check_rows(table, "directions", domain.directions, n);
    check_size("coefficients", domain.coefficients.size(), n);
    check_size("whitening", domain.whitening.size(), n);
}

}  // namespace

void read_joint_domain(Options& file, Calibration& calibration) {
    if (!file.has("joint_domain")) return;
    Options table = file.table("joint_domain");
    JointDomain& domain = calibration.joint_domain;
    const std::size_t n = calibration.channels.size();
    domain.mean = table.numbers("mean", kFinite, n == 0 ? Count{} : Count{n, n});
    domain.whitening = table.rows("whitening");
    domain.limit = table.number("limit", kLimit);
    domain.false_alarms = table.number("false_alarms", {0, 1}, 0);
    if (n != 0 && domain.whitening.size() != n)
        table.problem("whitening", fmt::format("whitening has {} rows for {} channels", domain.whitening.size(), n));
    check_triangle(table, "whitening", domain.whitening);
    read_curved_domain(table, n, domain.curved);
}

}  // namespace tactiled
