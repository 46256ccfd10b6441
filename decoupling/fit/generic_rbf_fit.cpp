// Model "generic", method "rbf": centres by k-means, weights by ridge regression together with the quadratic. Spread
// and ridge are those with the smallest error on sessions or stretches of rows that are left out.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <utility>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/rbf_basis.hpp"
#include "decoupling/fit/row_sums.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

// More centres are more accurate, and slower in the fit and in the loop. Soft tongs with 15 channels and 20,500 rows: 300,
// 500 and 1,000 centres have an error of fz of 7.7, 7.2 and 6.0 % of full scale on other recordings, and cost 0.7, 1.1
// and 2.1 us a sample; the fit's sums over the rows grow with the square of the number.
constexpr Eigen::Index kMaxCentres = 1000;
constexpr Eigen::Index kRowsPerCentre = 20;
constexpr double kSpreads[] = {1, 2, 4, 8};  // in standard deviations of a channel
constexpr double kRidges[] = {1e-9, 1e-7, 1e-5, 1e-3, 1e-1};

Eigen::RowVectorXd row_of(const std::vector<double>& values) {
    return Eigen::Map<const Eigen::RowVectorXd>(values.data(), Eigen::Index(values.size()));
}

// A basis with the sums over the rows of a recording, whose right side is the residual of this matrix.
struct Prepared {
    Prepared(const Rows& rows, const Scaled& scaled, Basis of, const Calibration& calibration)
        : basis(std::move(of)),
          zero(row_of(calibration.zero)),
          matrix(rows_as_matrix(calibration.matrix)),
          sums(rows, scaled, [this](const Eigen::MatrixXd& u) { return basis.features_of(u); }) {}
    Prepared(const Prepared&) = delete;
    Prepared& operator=(const Prepared&) = delete;

    // Returns, for component c, the coefficients of (1, u) by which the residual of another matrix is greater.
    [[nodiscard]] Eigen::VectorXd change_to(const Calibration& other, std::size_t c) const {
        const Eigen::RowVectorXd here = matrix.row(Eigen::Index(c)), there = row_of(other.matrix[c]);
        Eigen::VectorXd change(1 + here.size());
        change[0] = here.dot(basis.zero - zero) - there.dot(basis.zero - row_of(other.zero));
        change.tail(here.size()) = (here - there).cwiseProduct(basis.width).transpose();
        return change;
    }

    Basis basis;
    Eigen::RowVectorXd zero;
    Eigen::MatrixXd matrix;
    RowSums sums;

private:
    static Eigen::MatrixXd rows_as_matrix(const std::vector<std::vector<double>>& rows) {
        Eigen::MatrixXd result(Eigen::Index(rows.size()), Eigen::Index(rows.front().size()));
        for (std::size_t i = 0; i < rows.size(); ++i) result.row(Eigen::Index(i)) = row_of(rows[i]);
        return result;
    }
};

// The sums of the last search. A fit to a part of its rows subtracts the others. They are sums over rows and hold no choice:
// without them the fit has the same result, later.
class LastSearch {
public:
    void keep(std::shared_ptr<const Prepared> found) {
        const std::lock_guard lock(one_);
        last_ = std::move(found);
    }
    // Returns the sums of this basis if `rows` are a part of their rows, and the places of `rows` in them.
    std::pair<std::shared_ptr<const Prepared>, RowSums::Places> find(const Basis& basis, const Rows& rows) {
        std::shared_ptr<const Prepared> last;
        {
            const std::lock_guard lock(one_);
            last = last_;
        }
        if (last == nullptr || !basis.is_near(last->basis)) return {};
        std::optional<RowSums::Places> places = last->sums.places_of(rows);
        if (!places) return {};
        return {std::move(last), std::move(*places)};
    }

private:
    std::mutex one_;
    std::shared_ptr<const Prepared> last_;
};
LastSearch last_search;

struct Found {
    std::shared_ptr<const Prepared> prepared;
    RowSums::Places places;  // the rows in the sums
    double ridge = 0;
    std::vector<bool> gains;  // for each component: the error is lower than without a correction
};

RowSums::Places all_places(const Rows& rows) {
    RowSums::Places places(rows.size());
    std::iota(places.begin(), places.end(), Eigen::Index(0));
    return places;
}

// Returns the spread and the ridge with the smallest error on rows that are left out, in which components without a gain
// keep the matrix. The error has one minimum over the spread: the search goes from 2 widths to where it is smaller.
Found search(const Rows& rows, const Scaled& scaled, const Eigen::MatrixXd& centres, const Calibration& calibration) {
    Found found;
    double min = std::numeric_limits<double>::infinity();
    const auto is_better = [&](double spread) {
        const Basis basis{row_of(calibration.zero), row_of(calibration.tables.at("width").front()), centres, spread};
        const auto prepared = std::make_shared<const Prepared>(rows, scaled, basis, calibration);
        const auto errors = held_out_errors(prepared->sums, kRidges);
        bool better = false;
        for (std::size_t r = 0; r < std::size(kRidges); ++r) {
            double sum = 0;
            std::vector<bool> gain;
            for (const HeldOutErrors& each : errors) {
                gain.push_back(gains(each, Eigen::Index(r)));
                const Eigen::Index column = gain.back() ? Eigen::Index(r) : each.smooth.cols() - 1;
                sum += each.smooth.col(column).sum();
            }
            if (!(sum < min)) continue;
            min = sum;
            better = true;
            found = {.prepared = prepared, .places = {}, .ridge = kRidges[r], .gains = std::move(gain)};
        }
        return better;
    };
    (void)is_better(kSpreads[1]);
    if (is_better(kSpreads[2]))
        (void)is_better(kSpreads[3]);
    else
        (void)is_better(kSpreads[0]);
    found.places = all_places(rows);
    last_search.keep(found.prepared);
    return found;
}

// Returns the basis of a calibration that is fitted again, which keeps its spread, its ridge and its centres: these come
// from the channels alone.
std::optional<Basis> known_basis(const Calibration& calibration) {
    const auto spread = calibration.parameters.find("spread");
    const auto centres = calibration.tables.find("centres"), width = calibration.tables.find("width");
    const std::size_t n = calibration.channels.size();
    if (spread == calibration.parameters.end() || !calibration.parameters.contains("ridge") ||
        centres == calibration.tables.end() || width == calibration.tables.end() || calibration.zero.size() != n)
        return std::nullopt;
    Basis basis{row_of(calibration.zero), row_of(width->second.front()),
                Eigen::MatrixXd(Eigen::Index(centres->second.size()), Eigen::Index(n)), spread->second};
    for (std::size_t j = 0; j < centres->second.size(); ++j) basis.centres.row(Eigen::Index(j)) = row_of(centres->second[j]);
    return basis;
}

// Returns the sums of the rows for a known basis.
Found prepare(const Rows& rows, Scaled& scaled, const Basis& basis, const Calibration& calibration) {
    auto [prepared, places] = last_search.find(basis, rows);
    Found found{.prepared = std::move(prepared), .places = std::move(places), .ridge = 0, .gains = {}};
    if (found.prepared != nullptr) return found;
    scaled.u = (channels_of(rows).rowwise() - basis.zero).array().rowwise() / basis.width.array();
    found.prepared = std::make_shared<const Prepared>(rows, scaled, basis, calibration);
    found.places = all_places(rows);
    return found;
}

// Returns the number of rows under different loads, of the component with the fewest. setup: throws Undetermined
std::size_t checked_number(const Rows& rows, const Calibration& calibration) {
    const std::size_t n = calibration.channels.size(), n_quadratic = 1 + n + n * (n + 1) / 2;
    std::size_t independent = rows.size();
    for (const auto& name : calibration.components)
        independent = std::min(independent, independent_rows(rows, component_index(name)));
    const auto needed = std::max(std::size_t(8 * kRowsPerCentre), kRowsPerCoefficient * n_quadratic);
    if (independent < needed)
        throw Undetermined(
            fmt::format("{} independent rows for method rbf; at least {} are needed: record more loads, or "
                        "use fewer channels or method matrix",
                        independent, needed));
    return independent;
}

// Returns the weights of each component, one per column.
Eigen::MatrixXd weights_of(const Found& found, const Rows& rows, const Calibration& calibration) {
    const RowSums& sums = found.prepared->sums;
    const Normal all = sums.of(found.places);
    Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(all.gram.rows(), all.feature_y.cols()), right = weights;
    std::vector<Eigen::Index> complete;
    const auto right_side = [&](const Normal& normal, std::size_t c) -> Eigen::VectorXd {
        const Eigen::VectorXd change = found.prepared->change_to(calibration, c);
        Eigen::VectorXd linear = Eigen::VectorXd::Zero(normal.gram.rows());
        linear.head(change.size()) = change;
        return sums.unit()[Eigen::Index(c)] * normal.feature_y.col(Eigen::Index(c)) +
               normal.gram.selfadjointView<Eigen::Lower>() * linear;
    };
    for (std::size_t c = 0; c < calibration.components.size(); ++c) {
        if (!found.gains[c]) continue;
        const std::size_t component = component_index(calibration.components[c]);
        RowSums::Places with, without;
        for (std::size_t i = 0; i < rows.size(); ++i)
            (std::isfinite(rows[i]->wrench_S[component]) ? with : without).push_back(found.places[i]);
        if (without.empty()) {
            complete.push_back(Eigen::Index(c));
            right.col(Eigen::Index(c)) = right_side(all, c);
            continue;
        }
        Normal own = all;
        if (with.size() > without.size())
            sums.take_out(without, own);
        else
            own = sums.of(with);
        weights.col(Eigen::Index(c)) = own.solve(right_side(own, c), found.ridge);
    }
    if (!complete.empty()) weights(Eigen::all, complete) = all.solve(right(Eigen::all, complete), found.ridge);
    return weights;
}

void fit_rbf(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    std::optional<Basis> basis = known_basis(calibration);  // the fit of the matrix clears the parameters
    const double ridge = basis ? calibration.parameters.at("ridge") : 0;
    Scaled scaled = fit_matrix_and_scale(rows, calibration, warnings);
    const auto independent = Eigen::Index(checked_number(rows, calibration));
    const Eigen::Index n_centres = std::min(kMaxCentres, independent / kRowsPerCentre);
    if (basis && 2 * n_centres < basis->centres.rows()) {  // too few rows for those centres
        basis->zero = row_of(calibration.zero);
        basis->width = row_of(calibration.tables.at("width").front());
        basis->centres = k_means(scaled.u, n_centres);
    }
    Found found;
    if (basis) {
        found = prepare(rows, scaled, *basis, calibration);
        found.ridge = ridge;
        for (std::size_t i = 0; i < scaled.component.size(); ++i)
            found.gains.push_back(!has_no_correction(calibration, "weights", i));
    } else {
        found = search(rows, scaled, k_means(scaled.u, n_centres), calibration);
    }
    const Basis& used = found.prepared->basis;
    Eigen::MatrixXd weights = weights_of(found, rows, calibration);
    const Eigen::RowVectorXd shift = used.shift_to(row_of(calibration.zero));
    const Eigen::Index n_quadratic = weights.rows() - used.centres.rows();
    calibration.parameters = {{"spread", used.spread}, {"ridge", found.ridge}};
    calibration.tables["width"] = {{used.width.begin(), used.width.end()}};
    calibration.tables["centres"] = rows_in(used.centres.rowwise() + shift);
    auto &of_centres = calibration.tables["weights"], &quadratic = calibration.tables["quadratic"];
    of_centres.clear();
    quadratic.clear();
    std::string kept;
    for (std::size_t c = 0; c < calibration.components.size(); ++c) {
        auto w = weights.col(Eigen::Index(c));
        if (!found.gains[c]) kept += (kept.empty() ? "" : ", ") + calibration.components[c];
        shift_quadratic(shift, w.head(n_quadratic));
        quadratic.emplace_back(w.begin(), w.begin() + n_quadratic);
        of_centres.emplace_back(w.begin() + n_quadratic, w.end());
    }
    if (!kept.empty())
        warnings.push_back(fmt::format(
            "method rbf keeps method matrix for {}: no correction lowers the error on the rows left out by more than chance",
            kept));
}

const FitEntry entry{.model = "generic", .method = "rbf", .fit = fit_rbf, .adds_to = "matrix", .takes_zero_drift = true};

}  // namespace
}  // namespace tactiled
