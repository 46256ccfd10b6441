#include "decoupling/fit/array_presses.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "drivers/taxels.hpp"

namespace tactiled {
namespace {

constexpr std::array<const char*, 3> kForces{"fx_N", "fy_N", "fz_N"};
constexpr std::array<const char*, 8> kOthers{"fx_N", "fy_N", "fz_N", "x_mm", "y_mm", "press", "t_s", "session"};

bool is_other(const std::string& name) { return std::find(kOthers.begin(), kOthers.end(), name) != kOthers.end(); }

// Splits "Z12" into "Z" and 12; no value if the name does not end with a number.
std::optional<std::pair<std::string, std::size_t>> split(const std::string& name) {
    const std::size_t digits = name.find_last_not_of("0123456789") + 1;
    if (digits == 0 || digits == name.size() || name.size() - digits > 5) return std::nullopt;
    return std::pair{name.substr(0, digits), std::size_t(std::stoul(name.substr(digits)))};
}

// The recording, one row at a time.
class ArrayCsv {
public:
    ArrayCsv(const ArrayRequest& request, const TaxelPlaces& places)
        : request_(request), csv_(request.in), channels_(request.start.channels) {
        if (request.in == "-") throw SetupError("--in -: the recording of an array is read twice; write it to a file");
        value_ = taxel_columns(csv_, places.n, channels_);
        for (std::size_t c = 0; c < 3; ++c) force_[c] = csv_.find(kForces[c]);
        place_ = {csv_.find("x_mm"), csv_.find("y_mm")};
        press_ = csv_.find("press");
        if (!force_[2]) csv_.refuse("has no column fz_N: the total force along z in N, negative for a press");
        if (force_[0].has_value() != force_[1].has_value()) csv_.refuse("has one of fx_N and fy_N; give both, or neither");
        if (place_[0].has_value() != place_[1].has_value()) csv_.refuse("has one of x_mm and y_mm; give both, or neither");
        if (place_[0] && !places.is_flat())
            csv_.refuse("x_mm and y_mm: the place of a press is used on flat skins only; delete these columns");
        raw_.resize(value_.size() * places.n);
    }
    bool next() {
        if (!csv_.next()) return false;
        const std::size_t n = value_[0].size();
        for (std::size_t v = 0; v < value_.size(); ++v)
            for (std::size_t i = 0; i < n; ++i) {
                const double x = csv_.number(value_[v][i]);
                raw_[v * n + i] = x <= request_.saturates_below || x >= request_.saturates_above ? kNoFloat : float(x);
            }
        for (std::size_t c = 0; c < 3; ++c) force[c] = force_[c] ? csv_.number(*force_[c]) : kNaN;
        for (std::size_t c = 0; c < 2; ++c) place_m[c] = place_[c] ? 1e-3 * csv_.number(*place_[c]) : kNaN;
        is_loaded = press_ ? !csv_.text(*press_).empty()
                           : std::any_of(force.begin(), force.end(), [](double f) { return std::isfinite(f) && f != 0; });
        if (is_loaded && !std::isfinite(force[2])) csv_.refuse("column fz_N is empty in a row of a press");
        return true;
    }
    [[nodiscard]] const std::vector<float>& raw() const { return raw_; }
    [[nodiscard]] std::string press() const { return press_ ? std::string(csv_.text(*press_)) : ""; }
    [[nodiscard]] bool names_presses() const { return press_.has_value(); }
    [[nodiscard]] const std::vector<std::string>& channels() const { return channels_; }
    [[nodiscard]] const CsvReader& csv() const { return csv_; }

    std::array<double, 3> force{};
    std::array<double, 2> place_m{};
    bool is_loaded = false;

private:
    static constexpr float kNoFloat = std::numeric_limits<float>::quiet_NaN();
    const ArrayRequest& request_;
    CsvReader csv_;
    std::vector<std::string> channels_;
    std::vector<std::vector<std::size_t>> value_;
    std::array<std::optional<std::size_t>, 3> force_;
    std::array<std::optional<std::size_t>, 2> place_;
    std::optional<std::size_t> press_;
    std::vector<float> raw_;
};

// Sets zero, noise and the taxels without values.
void read_rest(const ArrayRequest& request, const TaxelPlaces& places, Presses& out) {
    ArrayCsv rows(request, places);
    const std::size_t values = rows.channels().size(), n = places.n;
    out.taxels = n;
    out.channels = rows.channels();
    std::vector<int> missing(n, 0), count(values * n, 0);
    std::vector<double> mean(values * n, 0), squares(values * n, 0);
    int all = 0;
    for (; rows.next(); ++all)
        for (std::size_t k = 0; k < values * n; ++k) {
            const auto x = double(rows.raw()[k]);
            if (std::isnan(x)) ++missing[k % n];
            if (rows.is_loaded || std::isnan(x)) continue;
            const double before = mean[k];
            mean[k] += (x - before) / ++count[k];
            squares[k] += (x - before) * (x - mean[k]);
        }
    out.rest_rows = *std::max_element(count.begin(), count.end());
    if (out.rest_rows < 3)
        rows.csv().refuse(fmt::format("{} rows without a load; the zeros need 3 or more, better 100: rows {}", out.rest_rows,
                                      rows.names_presses() ? "with an empty cell in column press" : "with fz_N = 0"));
    out.is_missing.assign(n, 0);
    for (std::size_t v = 0; v < values; ++v) {
        out.zero.emplace_back(mean.begin() + std::ptrdiff_t(v * n), mean.begin() + std::ptrdiff_t((v + 1) * n));
        std::vector<double>& noise = out.noise.emplace_back(n);
        for (std::size_t i = 0; i < n; ++i) {
            noise[i] = std::sqrt(squares[v * n + i] / std::max(count[v * n + i] - 1, 1));
            if (2 * missing[i] > all || count[v * n + i] < 2) out.is_missing[i] = 1;
        }
    }
}

// The sum of the rows of a step, until its labels change.
class StepMaker {
public:
    StepMaker(const TaxelPlaces& places, Presses& out)
        : places_(places), out_(out), sum_(out.channels.size() * out.taxels), in_(out.taxels) {
        level_ = contact_level(sum_.size());
    }
    void add(const ArrayCsv& rows, std::size_t press) {
        if (step_.rows > 0 && (press != step_.press || !is_same(rows))) end();
        step_.line = rows.csv().line();
        step_.press = press;
        step_.force_N = rows.force;
        step_.place_m = rows.place_m;
        ++step_.rows;
        for (std::size_t k = 0; k < sum_.size(); ++k) sum_[k] += double(rows.raw()[k]);
    }
    void end() {
        if (step_.rows == 0) return;
        const std::size_t n = out_.taxels;
        std::fill(in_.begin(), in_.end(), std::uint8_t(0));
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t v = 0; v < out_.channels.size() && out_.is_missing[i] == 0; ++v)
                if (std::abs(value(v, i)) > level_ * out_.noise[v][i] * std::sqrt(1. / step_.rows + 1. / out_.rest_rows))
                    mark(i);
        for (std::size_t i = 0; i < n; ++i)
            if (in_[i] != 0 && out_.is_missing[i] == 0) step_.taxel.push_back(std::uint16_t(i));
        for (std::size_t v = 0; v < out_.channels.size(); ++v) {
            auto& row = step_.value.emplace_back();
            for (const std::size_t i : step_.taxel) row.push_back(float(value(v, i)));
        }
        out_.steps.push_back(std::move(step_));
        step_ = {};
        std::fill(sum_.begin(), sum_.end(), 0.);
    }

private:
    [[nodiscard]] double value(std::size_t v, std::size_t i) const {
        return sum_[v * out_.taxels + i] / step_.rows - out_.zero[v][i];
    }
    void mark(std::size_t i) {
        in_[i] = 1;
        for (std::size_t k = 0; k < places_.neighbours[i].n; ++k) in_[places_.neighbours[i].of[k]] = 1;
    }
    [[nodiscard]] bool is_same(const ArrayCsv& rows) const {
        const auto same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
        return std::equal(rows.force.begin(), rows.force.end(), step_.force_N.begin(), same) &&
               std::equal(rows.place_m.begin(), rows.place_m.end(), step_.place_m.begin(), same);
    }

    const TaxelPlaces& places_;
    Presses& out_;
    PressStep step_;
    std::vector<double> sum_;
    std::vector<std::uint8_t> in_;
    double level_;
};

bool has_all_values(const std::vector<float>& raw, const Presses& presses) {
    for (std::size_t k = 0; k < raw.size(); ++k)
        if (std::isnan(raw[k]) && presses.is_missing[k % presses.taxels] == 0) return false;
    return true;
}

void read_loads(const ArrayRequest& request, const TaxelPlaces& places, Presses& out) {
    ArrayCsv rows(request, places);
    StepMaker step(places, out);
    std::map<std::string, std::size_t> names;
    bool in_press = false;
    std::array<double, 2> place_m{};
    double sum_N = 0;
    while (rows.next()) {
        const bool was_in_press = std::exchange(in_press, rows.is_loaded);
        if (!rows.is_loaded) continue;
        if (rows.names_presses())
            names.try_emplace(rows.press(), names.size());
        else if (!was_in_press || (std::isfinite(rows.place_m[0]) && rows.place_m != place_m))
            ++out.presses;
        place_m = rows.place_m;
        if (!has_all_values(rows.raw(), out)) {
            ++out.left_out;
            continue;
        }
        sum_N += rows.force[2];
        ++out.loaded_rows;
        step.add(rows, rows.names_presses() ? names.at(rows.press()) : out.presses - 1);
    }
    step.end();
    if (rows.names_presses()) out.presses = names.size();
    if (out.loaded_rows == 0)
        rows.csv().refuse(
            fmt::format("no row of a press with the values of all taxels ({} lack one or more)", out.left_out));
    if (sum_N > 0)
        rows.csv().refuse(
            fmt::format("column fz_N is positive on average ({:.3g} N), and a press has fz < 0: change the sign",
                        sum_N / out.loaded_rows));
}

}  // namespace

std::vector<std::vector<std::size_t>> taxel_columns(const CsvReader& csv, std::size_t taxels,
                                                    std::vector<std::string>& channels) {
    std::map<std::pair<std::string, std::size_t>, std::size_t> at;
    const bool are_stated = !channels.empty();
    std::size_t found = 0;
    for (std::size_t k = 0; k < csv.columns().size(); ++k) {
        if (is_other(csv.columns()[k])) continue;
        const auto taxel = split(csv.columns()[k]);
        if (!taxel)
            csv.refuse(fmt::format(
                "column \"{}\": the columns of taxel 12 are Z12, or X12 Y12 Z12; forces are fx_N fy_N fz_N, in N "
                "(100 g are 0.981 N); others are x_mm y_mm press t_s session",
                csv.columns()[k]));
        const bool is_known = std::find(channels.begin(), channels.end(), taxel->first) != channels.end();
        if (!is_known && are_stated)
            csv.refuse(
                fmt::format("column \"{}\": the values of a taxel are {}", csv.columns()[k], fmt::join(channels, " ")));
        if (!is_known) channels.push_back(taxel->first);
        at[*taxel] = k;
        found = std::max(found, taxel->second + 1);
    }
    if (channels.empty() || channels.size() > kMaxTaxelValues)
        csv.refuse(fmt::format("{} values of a taxel; 1 to {} are possible: Z0 Z1 ..., or X0 Y0 Z0 X1 ...", channels.size(),
                               kMaxTaxelValues));
    if (found != taxels)
        csv.refuse(fmt::format("has the columns of {} taxels, {}0 .. {}{}, and the geometry has {} taxels", found,
                               channels[0], channels[0], found - 1, taxels));
    std::vector<std::vector<std::size_t>> columns;
    for (const std::string& channel : channels) {
        auto& row = columns.emplace_back();
        for (std::size_t i = 0; i < taxels; ++i) {
            const auto column = at.find({channel, i});
            if (column == at.end()) csv.refuse(fmt::format("lacks column {}{} of taxel {}", channel, i, i));
            row.push_back(column->second);
        }
    }
    return columns;
}

Presses read_presses(const ArrayRequest& request, const TaxelPlaces& places) {
    Presses presses;
    read_rest(request, places, presses);
    read_loads(request, places, presses);
    return presses;
}

void for_each_unloaded(const ArrayRequest& request, const TaxelPlaces& places,
                       const std::function<void(const std::vector<float>&)>& f) {
    ArrayCsv rows(request, places);
    while (rows.next())
        if (!rows.is_loaded) f(rows.raw());
}

double contact_level(std::size_t n) { return std::sqrt(2 * std::log(double(n) / 0.01)); }

}  // namespace tactiled
