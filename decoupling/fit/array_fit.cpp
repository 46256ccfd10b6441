#include "decoupling/fit/array_fit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <utility>

#include "decoupling/fit/array_survey.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/least_squares.hpp"
#include "decoupling/fit/taxel_gains.hpp"
#include "decoupling/patch/patch.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

using State = TaxelReport::State;

// The spread of n gains is known to 1 / sqrt(2 n): 16 %.
constexpr std::size_t kMinPresses = 20;
// A coefficient of the matrix with a larger sd, as a part of the row's largest, says less than the maker's number.
constexpr double kUndetermined = 0.1;
constexpr double kOtherUnit = 3;  // a stated matrix that is wrong by more has another unit
constexpr int kRounds = 3;        // matrix and gains in turn; the second round changes the matrix by less than its sd

class ArrayFit {
public:
    explicit ArrayFit(const ArrayRequest& request) : request_(request) {
        const CalibrationData data(request.start, kPlaceParameters, kPlaceTables);
        std::string fault = data.fault_of_ranges();
        if (fault.empty()) places_ = places_of(data, fault);
        if (!fault.empty())
            throw SetupError(fault + " (--geometry FILE, or --set rows=16 --set columns=16 --set pitch_mm=2)");
        presses_ = read_presses(request, places_);
        if (presses_.presses < kMinPresses)
            throw Undetermined(fmt::format("{}: {} presses; {} or more are needed to know how much the gains differ",
                                           request.in, presses_.presses, kMinPresses));
        gains_ = TaxelGains(places_.n);
        if (places_.pitch_m[0] > 0) gains_.spread[GainEquations::kPlace] = 0.2 * double(places_.pitch_m[0]);
    }
    ArrayReport run() {
        survey_ = survey(presses_, places_, request_.start);
        check_coverage();
        start_matrix();
        for (int round = 0; round < kRounds; ++round) {
            equations_ = equations();
            gains_.fit(equations_);
            if (round + 1 < kRounds) fit_matrix();
        }
        return report();
    }

private:
    // Force of component c in S per unit of value v of taxel i, with its gain before the fit.
    [[nodiscard]] double coefficient(std::size_t i, std::size_t c, std::size_t v) const {
        double sum = 0;
        for (std::size_t k = 0; k < matrix_.size(); ++k) sum += turned(i, c, k) * matrix_[k][v];
        return first_gain(i) * sum;
    }
    // Part of row k of the matrix in component c.
    [[nodiscard]] double turned(std::size_t i, std::size_t c, std::size_t k) const {
        const std::size_t axis = matrix_.size() == 1 ? 2 : k;
        return places_.is_flat() ? (axis == c ? 1 : 0) : double(places_.axes[i][axis][c]);
    }
    [[nodiscard]] bool is_used(const PressStep& step, std::size_t c) const {
        return std::isfinite(step.force_N[c]) && (c == 2 || matrix_.size() == 3 || !places_.is_flat());
    }
    [[nodiscard]] double first_gain(std::size_t i) const {
        const auto table = request_.start.tables.find("gain");
        return table == request_.start.tables.end() ? 1 : table->second.at(0).at(i);
    }
    void check_coverage();
    void start_matrix();
    bool fit_matrix();
    [[nodiscard]] double noise(const PressStep& step, std::size_t i, std::size_t c) const;
    template <class Arm>
    void add_step(std::size_t s, std::size_t c, Arm arm, EquationMaker& out) const;
    [[nodiscard]] GainEquations equations() const;
    void put_taxels(ArrayReport& report) const;
    void put_calibration(ArrayReport& report) const;
    void put_rest(ArrayReport& report) const;
    [[nodiscard]] ArrayReport report() const;

    const ArrayRequest& request_;
    TaxelPlaces places_;
    Presses presses_;
    TaxelSurvey survey_;
    NumberRows matrix_;
    bool matrix_is_fitted_ = false;
    double scale_ = 1;  // factor of a stated matrix
    GainEquations equations_;
    TaxelGains gains_{0};
};

void ArrayFit::check_coverage() {
    const auto count = std::size_t(std::ranges::count(survey_.is_loaded, 1));
    if (2 * count < places_.n)
        throw Undetermined(fmt::format("{}: the presses load {} of {} taxels; record presses all over the array",
                                       request_.in, count, places_.n));
}

// Takes the stated matrix or begins with the rows that the labels can have, and fits it to the sums of the taxels.
void ArrayFit::start_matrix() {
    const std::size_t values = presses_.channels.size();
    const auto stated = request_.start.tables.find("taxel");
    const bool has_shear = std::any_of(presses_.steps.begin(), presses_.steps.end(),
                                       [](const PressStep& step) { return std::isfinite(step.force_N[0]); });
    matrix_.assign(has_shear && values >= 3 ? 3 : 1, std::vector<double>(values, 0));
    if (stated != request_.start.tables.end()) matrix_ = stated->second;
    if (fit_matrix()) return;
    if (stated == request_.start.tables.end())
        throw Undetermined(
            fmt::format("{}: the presses do not determine how the values {} of a taxel become its force: press along other "
                        "directions, too, "
                        "with fx_N and fy_N, or state the table taxel in --geometry",
                        request_.in, fmt::join(presses_.channels, " ")));
}

// Fits the coefficients to the total forces by weighted least squares, with the present gains. If they are not determined, a
// stated matrix gets a common factor, and false is returned.
bool ArrayFit::fit_matrix() {
    const std::size_t values = presses_.channels.size(), rows = matrix_.size();
    const auto unknowns = Eigen::Index(rows * values);
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(unknowns, unknowns);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns), stated(unknowns);
    for (Eigen::Index u = 0; u < unknowns; ++u) stated[u] = matrix_[std::size_t(u) / values][std::size_t(u) % values];
    double squares = 0, mean_fz2 = 0;
    for (const PressStep& step : presses_.steps)
        mean_fz2 += step.force_N[2] * step.force_N[2] / double(presses_.steps.size());
    int n = 0;
    for (std::size_t s = 0; s < presses_.steps.size(); ++s)
        for (std::size_t c = 0; c < 3; ++c) {
            const PressStep& step = presses_.steps[s];
            if (!is_used(step, c) || !survey_.dead_of[s].empty()) continue;
            Eigen::VectorXd x = Eigen::VectorXd::Zero(unknowns);
            for (std::size_t k = 0; k < step.taxel.size(); ++k) {
                const std::size_t i = step.taxel[k];
                if (survey_.is_dead[i] != 0) continue;
                const double gain = first_gain(i) * gains_.gain[Eigen::Index(i)];
                for (Eigen::Index u = 0; u < unknowns; ++u)
                    x[u] += gain * turned(i, c, std::size_t(u) / values) * double(step.value[std::size_t(u) % values][k]);
            }
            const double weight = 1 / (step.force_N[2] * step.force_N[2] + mean_fz2);  // errors of forces are relative
            gram += weight * x * x.transpose();
            right += weight * step.force_N[c] * x;
            squares += weight * step.force_N[c] * step.force_N[c];
            ++n;
        }
    const Eigen::LDLT<Eigen::MatrixXd> factor(gram);
    const Eigen::VectorXd found = factor.solve(right);
    const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(unknowns, unknowns));
    const double variance = std::max(0., squares - right.dot(found)) / std::max(n - int(unknowns), 1);
    bool is_determined = found.allFinite();
    for (std::size_t k = 0; k < rows && is_determined; ++k) {
        const auto row = found.segment(Eigen::Index(k * values), Eigen::Index(values));
        for (std::size_t v = 0; v < values; ++v) {
            const double sd2 = variance * inverse(Eigen::Index(k * values + v), Eigen::Index(k * values + v));
            is_determined = is_determined && sd2 >= 0 && std::sqrt(sd2) < kUndetermined * row.cwiseAbs().maxCoeff();
        }
    }
    const double factor_of_stated = stated.dot(right) / stated.dot(gram * stated);
    if (is_determined)
        for (Eigen::Index u = 0; u < unknowns; ++u) matrix_[std::size_t(u) / values][std::size_t(u) % values] = found[u];
    else if (std::isfinite(factor_of_stated))
        for (auto& row : matrix_)
            for (double& value : row) value *= factor_of_stated;
    if (std::isfinite(factor_of_stated)) scale_ *= factor_of_stated;
    return matrix_is_fitted_ = is_determined;
}

// Variance of the noise of the force of component c of taxel i in a step, before the gains.
double ArrayFit::noise(const PressStep& step, std::size_t i, std::size_t c) const {
    double variance = 0;
    for (std::size_t u = 0; u < step.value.size(); ++u) variance += std::pow(coefficient(i, c, u) * presses_.noise[u][i], 2);
    return variance * presses_.noise_part(step);
}

// Adds component c of step s to an equation, each taxel times arm(taxel). A dead taxel has the mean force of its neighbours,
// and an error that is as large, or as large as what they have without a contact.
template <class Arm>
void ArrayFit::add_step(std::size_t s, std::size_t c, Arm arm, EquationMaker& out) const {
    const PressStep& step = presses_.steps[s];
    std::vector<double> force(places_.n, 0);
    for (std::size_t k = 0; k < step.taxel.size(); ++k) {
        const std::size_t i = step.taxel[k];
        if (survey_.is_dead[i] != 0) continue;
        for (std::size_t u = 0; u < step.value.size(); ++u) force[i] += coefficient(i, c, u) * double(step.value[u][k]);
        out.add_taxel(i, arm(i) * force[i], arm(i) * arm(i) * noise(step, i, c));
    }
    const double level = contact_level(places_.n * presses_.channels.size());
    for (const std::size_t i : survey_.dead_of[s]) {
        double sum = 0, variance = 0, n = 0;
        for (std::size_t b = 0; b < places_.neighbours[i].n; ++b) {
            const std::size_t j = places_.neighbours[i].of[b];
            if (survey_.is_dead[j] != 0) continue;
            sum += gains_.gain[Eigen::Index(j)] * force[j], variance += noise(step, j, c), ++n;
        }
        const double mean = n > 0 ? sum / n : 0;
        const double sd = n > 0 ? std::hypot(mean, level * std::sqrt(variance / n)) : step.force_N[2];
        out.add_hidden(arm(i) * mean, arm(i) * sd);
    }
}

// One equation for each force of a step and two for the places of a press: their errors are common to its steps, because its
// labels or the shape of its body have them.
GainEquations ArrayFit::equations() const {
    EquationMaker out(places_.n);
    std::map<std::size_t, std::vector<std::size_t>> placed;
    for (std::size_t s = 0; s < presses_.steps.size(); ++s) {
        const PressStep& step = presses_.steps[s];
        double size = 0;
        for (std::size_t c = 0; c < 3; ++c)
            if (is_used(step, c)) size = std::hypot(size, step.force_N[c]);
        for (std::size_t c = 0; c < 3; ++c) {
            if (!is_used(step, c)) continue;
            out.begin(GainEquations::kForce, step.press);
            out.add_right(step.force_N[c], size);
            add_step(
                s, c, [](std::size_t) { return 1.; }, out);
        }
        if (std::isfinite(step.place_m[0]) && std::isfinite(step.place_m[1])) placed[step.press].push_back(s);
    }
    for (const auto& [press, steps] : placed)
        for (std::size_t axis = 0; axis < 2; ++axis) {
            const std::vector<float>& r = axis == 0 ? places_.x : places_.y;
            out.begin(GainEquations::kPlace, press);
            for (const std::size_t s : steps) {
                const PressStep& step = presses_.steps[s];
                out.add_right(0, std::abs(step.force_N[2]));
                add_step(
                    s, 2, [&](std::size_t i) { return double(r[i]) - step.place_m[axis]; }, out);
            }
        }
    return out.take();
}

// A taxel is unloaded if the presses leave more than half of the variance that the gains of its kind have.
void ArrayFit::put_taxels(ArrayReport& report) const {
    report.taxels.resize(places_.n);
    std::vector<std::size_t> last(places_.n, std::size_t(-1));
    for (const PressStep& step : presses_.steps)
        for (std::size_t k = 0; k < step.taxel.size(); ++k) {
            const std::size_t i = step.taxel[k];
            TaxelReport& taxel = report.taxels[i];
            if (std::exchange(last[i], step.press) != step.press) ++taxel.presses;
            double square = 0;
            for (std::size_t c = 0; c < 3; ++c) {
                double force = 0;
                for (std::size_t u = 0; u < step.value.size(); ++u) force += coefficient(i, c, u) * double(step.value[u][k]);
                square += force * force;
            }
            taxel.load_N = std::max(taxel.load_N, gains_.gain[Eigen::Index(i)] * std::sqrt(square));
        }
    for (std::size_t i = 0; i < places_.n; ++i) {
        TaxelReport& taxel = report.taxels[i];
        const double gain = gains_.gain[Eigen::Index(i)], sd = gains_.sd[Eigen::Index(i)];
        taxel.gain = first_gain(i) * gain;
        taxel.gain_sd = sd / gain;
        for (std::size_t u = 0; u < presses_.noise.size(); ++u)
            taxel.noise_N = std::hypot(taxel.noise_N, taxel.gain * matrix_.back()[u] * presses_.noise[u][i]);
        if (survey_.is_dead[i] != 0 || !(gain > 0))
            taxel = {.state = State::dead, .gain_sd = 0, .load_N = 0, .presses = taxel.presses};
        else if (gains_.is_far[i] != 0)
            taxel.state = gain > 1 ? State::weak : State::strong;
        else if (2 * sd * sd > gains_.bulk_sd() * gains_.bulk_sd())
            taxel.state = State::unloaded;
    }
}

double rounded(double x, int digits = 7) { return std::strtod(fmt::format("{:.{}g}", x, digits).c_str(), nullptr); }

void ArrayFit::put_calibration(ArrayReport& report) const {
    Calibration& c = report.calibration;
    const Calibration& start = request_.start;
    c.model = "patch";
    c.method = "linear";
    c.contact_model = start.contact_model;
    c.serial = start.serial;
    c.date = start.date;
    c.channels = presses_.channels;
    c.channel_unit = start.channel_unit;
    c.full_scale = start.full_scale;
    const bool has_all = matrix_.size() == 3 || !places_.is_flat();
    c.components = !start.components.empty() ? start.components
                   : has_all                 ? std::vector<std::string>(kComponentNames.begin(), kComponentNames.end())
                                             : std::vector<std::string>{"fz", "mx", "my"};
    c.parameters = start.parameters;
    c.parameters.erase("gain_sd");  // the table has it
    for (const char* const name : {"place_mm", "normal", "wiring"})
        if (const auto table = start.tables.find(name); table != start.tables.end()) c.tables[name] = table->second;
    c.tables["taxel"] = matrix_;
    for (auto& row : c.tables["taxel"])
        for (double& value : row) value = rounded(value);
    const double wider = std::max(1., report.held_out_ratio);
    std::vector<double> gain, gain_sd, dead, taxel_sd(matrix_.size(), 0);
    double alive = 0, largest_N = 0;
    for (std::size_t i = 0; i < places_.n; ++i) {
        const TaxelReport& taxel = report.taxels[i];
        gain.push_back(rounded(taxel.gain));
        gain_sd.push_back(rounded(wider * taxel.gain_sd, 3));
        if (taxel.state == State::dead) {
            dead.push_back(double(i));
            continue;
        }
        ++alive;
        largest_N = std::max(largest_N, taxel.load_N);
        for (std::size_t k = 0; k < matrix_.size(); ++k)
            for (std::size_t u = 0; u < presses_.noise.size(); ++u)
                taxel_sd[k] +=
                    std::pow(taxel.gain * matrix_[k][u] * presses_.noise[u][i], 2) * (1 + 1. / presses_.rest_rows);
    }
    for (double& sd : taxel_sd) sd = rounded(std::sqrt(sd / alive));
    c.tables["gain"] = {gain};
    c.tables["gain_sd"] = {gain_sd};
    c.tables["taxel_sd"] = {taxel_sd};
    if (!dead.empty()) c.tables["dead"] = {dead};
    for (const auto& row : presses_.zero) {
        auto& zero = c.tables["zero"].emplace_back();
        for (const double x : row) zero.push_back(rounded(x));
        double mean = 0;
        for (const double x : row) mean += x / double(row.size());
        c.zero.push_back(rounded(mean));
    }
    c.parameters.try_emplace("taxel_full_scale_N", rounded(largest_N));
    c.sd_slope.assign(c.components.size(), rounded(wider * gains_.common_sd(equations_)));
    c.rows = presses_.loaded_rows;
    c.validation = fmt::format("leave a fifth of the presses out ({} presses)", presses_.presses);
    report.gain_sd = median(gain_sd);
    put_rest(report);
}

// Sets the sd that the taxels have in common: what the wrench of the unloaded rows has beyond the noise of each.
void ArrayFit::put_rest(ArrayReport& report) const {
    Calibration& c = report.calibration;
    c.sd.assign(c.components.size(), 0);
    const auto decoupler = make_decoupler(c);
    std::vector<double> squares(c.components.size(), 0), of_noise(c.components.size(), 0);
    int rows = 0;
    for_each_unloaded(request_, places_, [&](const std::vector<float>& raw) {
        Reading reading;
        reading.taxels = {decoupler->patch()->shape(), raw};
        const Estimate estimate = decoupler->decouple(reading);
        if (!estimate.has_value) return;
        ++rows;
        for (std::size_t k = 0; k < c.components.size(); ++k) {
            const std::size_t of = component_index(c.components[k]);
            squares[k] += estimate.wrench_S[of] * estimate.wrench_S[of];
            of_noise[k] += estimate.sd[of] * estimate.sd[of];
        }
    });
    // The mean square of so few rows exceeds the variance by chance.
    const double chance = 1 + 3 * std::sqrt(2. / std::max(rows, 1));
    for (std::size_t k = 0; k < c.sd.size(); ++k)
        if (squares[k] > chance * of_noise[k]) c.sd[k] = rounded(std::sqrt((squares[k] - of_noise[k]) / rows));
}

ArrayReport ArrayFit::report() const {
    ArrayReport report;
    report.places = places_;
    report.presses = presses_.presses;
    report.steps = presses_.steps.size();
    report.rest_rows = presses_.rest_rows;
    report.loaded_rows = presses_.loaded_rows;
    report.left_out = presses_.left_out;
    report.matrix_is_fitted = matrix_is_fitted_;
    report.gain_spread = gains_.bulk_sd();
    report.force_error = gains_.spread[GainEquations::kForce];
    const bool has_places = std::count(equations_.kind.begin(), equations_.kind.end(), GainEquations::kPlace) > 0;
    report.place_error_m = has_places ? gains_.spread[GainEquations::kPlace] : kNaN;
    const TaxelGains::HeldOut held_out = gains_.hold_out(equations_);
    report.held_out_ratio = std::sqrt(held_out.ratio2);
    const auto n = double(held_out.error.size());
    const double wider = std::max(1., report.held_out_ratio);
    for (std::size_t k = 0; k < held_out.error.size(); ++k) {
        report.held_out_rms_N += held_out.error[k] * held_out.error[k] / n;
        report.within_1_sd += std::abs(held_out.of_sd[k]) <= wider ? 1 / n : 0;
        report.beyond_5_sd += std::abs(held_out.of_sd[k]) > 5 * wider ? 1 / n : 0;
    }
    report.held_out_rms_N = std::sqrt(report.held_out_rms_N);
    put_taxels(report);
    put_calibration(report);
    if (scale_ > kOtherUnit || scale_ < 1 / kOtherUnit)
        if (request_.start.tables.count("taxel") != 0)
            report.warnings.push_back(fmt::format(
                "the stated matrix had to be multiplied by {:.3g}: is fz_N in another unit (1 N is 102 g), or channel_unit?",
                scale_));
    if (presses_.left_out > 0)
        report.warnings.push_back(
            fmt::format("{} rows were left out: a taxel has no value, or is saturated", presses_.left_out));
    return report;
}

}  // namespace

ArrayReport fit_array(const ArrayRequest& request) { return ArrayFit(request).run(); }

const char* text_of(TaxelReport::State state) {
    switch (state) {
        case State::good: return "good";
        case State::weak: return "weak";
        case State::strong: return "strong";
        case State::dead: return "dead";
        case State::unloaded: return "unloaded";
    }
    return "";
}

std::string taxel_csv(const ArrayReport& report) {
    std::string out = "taxel,x_mm,y_mm,z_mm,state,gain,gain_sd,load_N,presses,noise_N\n";
    for (std::size_t i = 0; i < report.taxels.size(); ++i) {
        const TaxelReport& taxel = report.taxels[i];
        out += fmt::format("{},{:.6g},{:.6g},{:.6g},{},{:.5g},{:.3g},{:.4g},{},{:.3g}\n", i, 1e3f * report.places.x[i],
                           1e3f * report.places.y[i], 1e3f * report.places.z[i], text_of(taxel.state), taxel.gain,
                           taxel.gain_sd, taxel.load_N, taxel.presses, taxel.noise_N);
    }
    return out;
}

namespace {

const FitEntry entry{.model = "patch", .method = "linear", .channels = {.unit = "counts"}, .array = fit_array};

}  // namespace
}  // namespace tactiled
