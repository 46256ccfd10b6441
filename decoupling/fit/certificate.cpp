// The rows of a certificate: published forces, holds, and the expanded uncertainty.
#include "decoupling/fit/certificate.hpp"

#include <algorithm>
#include <cmath>

#include "decoupling/fit/groups.hpp"
#include "decoupling/solve/domain.hpp"
#include "decoupling/solve/load_scale.hpp"
#include "decoupling/unloading.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kHeldRows = 3;  // a rest of a calibration has as many

bool is_nan(double value) { return std::isnan(value); }

// The published forces of a file, in its order, as `tactilectl decouple` computes them.
class Published {
public:
    Published(const Labelled& labelled, const Calibration& calibration, const FitRequest& request)
        : request_(request), decoupler_(make_decoupler(calibration)), channel_(calibration.channels.size()) {
        for (const std::string& name : calibration.channels)
            column_.push_back(std::size_t(std::find(labelled.channels.begin(), labelled.channels.end(), name) -
                                          labelled.channels.begin()));
    }
    Estimate next(const LabelledRow& row) {
        Reading reading{.channel = channel_, .t_ns = row.t_ns, .temperature_C = row.temperature_C};
        for (std::size_t k = 0; k < column_.size(); ++k) {
            const double value = channel_[k] = row.channel[column_[k]];
            if (std::isnan(value)) reading.missing |= 1u << k;
            if (value <= request_.saturates_below || value >= request_.saturates_above) reading.saturated |= 1u << k;
        }
        return decoupler_->decouple(reading);
    }

private:
    const FitRequest& request_;
    std::unique_ptr<Decoupler> decoupler_;
    std::vector<std::size_t> column_;
    std::vector<double> channel_;
};

LoadedRows loaded_rows(const Labelled& labelled, const Calibration& calibration, const FitRequest& request,
                       CertificateFigures& figures) {
    LoadedRows loaded;
    loaded.full_scale = kUnseen;
    for (std::size_t i = 0; i < calibration.components.size() && i < calibration.full_scale.size(); ++i)
        loaded.full_scale[component_index(calibration.components[i])] = calibration.full_scale[i];
    Published published(labelled, calibration, request);
    for (const LabelledRow& row : labelled.rows) {
        const Estimate estimate = published.next(row);  // a model may depend on the rows before
        if (std::all_of(row.wrench_S.begin(), row.wrench_S.end(), is_nan)) continue;
        const bool is_good = estimate.quality() == TACTILED_GOOD;
        loaded.rows.push_back(&row);
        Wrench& deviation = loaded.deviation.emplace_back(kUnseen);
        for (std::size_t c = 0; is_good && c < 6; ++c) deviation[c] = estimate.wrench_S[c] - row.wrench_S[c];
        figures.labelled += 1;
        figures.good += is_good ? 1 : 0;
        figures.lowest_C = std::fmin(figures.lowest_C, row.temperature_C);
        figures.highest_C = std::fmax(figures.highest_C, row.temperature_C);
    }
    return loaded;
}

// Sets the means of a hold. Returns false if too few of its rows are GOOD.
bool take_means(const LoadedRows& loaded, Hold& hold) {
    hold.load = hold.deviation = {};
    std::size_t good = 0;
    for (std::size_t i = hold.begin; i < hold.end; ++i) {
        const Wrench& deviation = loaded.deviation[i];
        if (std::all_of(deviation.begin(), deviation.end(), is_nan)) continue;
        ++good;
        for (std::size_t c = 0; c < 6; ++c) {
            hold.load[c] += loaded.rows[i]->wrench_S[c];
            hold.deviation[c] += deviation[c];
        }
    }
    for (std::size_t c = 0; c < 6; ++c) {
        hold.load[c] /= double(good);
        hold.deviation[c] /= double(good);
    }
    hold.is_rest = loaded.is_rest(hold.load);
    return good >= kHeldRows;
}

std::vector<Hold> holds_of(const LoadedRows& loaded) {
    std::vector<Hold> holds;
    const auto& rows = loaded.rows;
    std::size_t zero = Hold::kNone;
    for (std::size_t begin = 0, end; begin < rows.size(); begin = end) {
        for (end = begin + 1; end < rows.size() && rows[end]->session == rows[begin]->session &&
                              loaded.is_same_load(rows[end]->wrench_S, rows[begin]->wrench_S);)
            ++end;
        Hold hold{.begin = begin, .end = end, .session = rows[begin]->session};
        if (!take_means(loaded, hold)) continue;
        const bool is_first = holds.empty() || holds.back().session != hold.session;
        if (is_first) zero = Hold::kNone;
        hold.before = is_first ? Hold::kNone : holds.size() - 1;
        hold.zero = zero;
        if (hold.is_rest) zero = holds.size();
        holds.push_back(hold);
    }
    return holds;
}

// Returns the expanded uncertainty of component i at this load. The sensor may have had a larger load before: the part of
// unloading is that after full scale.
double expanded_at(const Calibration& calibration, std::size_t i, const Wrench& load, const Reference& reference) {
    const std::size_t c = component_index(calibration.components[i]);
    const double of_reference = reference.expanded(c, load[c]);
    if (i >= calibration.sd.size() || !(of_reference > 0)) return kNaN;
    const double unloaded = std::max(0.0, 1 - LoadScale(calibration).of(load));
    const double unloading = i < calibration.sd_unloading.size() ? calibration.sd_unloading[i] * unloaded : 0;
    return kCoverage * std::hypot(stated_sd(calibration, i, load), unloading, of_reference / kCoverage);
}

}  // namespace

double Reference::expanded(std::size_t c, double load) const noexcept {
    return relative * std::abs(load) + (c < 3 ? force_N : moment_Nm);
}

std::size_t LoadFigure::worst() const noexcept {
    const auto smaller = [](double a, double b) { return std::abs(a) < std::abs(b); };
    return std::size_t(std::max_element(value.begin(), value.end(), smaller) - value.begin());
}

bool LoadedRows::is_same_load(const Wrench& a, const Wrench& b) const noexcept {
    for (std::size_t c = 0; c < 6; ++c)
        if (std::isnan(a[c]) != std::isnan(b[c]) || std::abs(a[c] - b[c]) > kSameLoad * full_scale[c]) return false;
    return true;
}

bool LoadedRows::is_rest(const Wrench& load) const noexcept {
    for (std::size_t c = 0; c < 6; ++c)
        if (std::abs(load[c]) > LoadPeak::kRest * full_scale[c]) return false;
    return true;
}

int LoadedRows::direction(const Hold& hold, std::size_t c) const noexcept {
    if (hold.before == Hold::kNone) return 0;
    const Hold& before = holds[hold.before];
    const double sign = std::abs(hold.load[c]) > std::abs(before.load[c]) ? std::copysign(1.0, hold.load[c])
                                                                          : std::copysign(1.0, before.load[c]);
    const double from = sign * before.load[c], to = sign * hold.load[c], margin = kSameLoad * full_scale[c];
    const double least = std::min(from, to), most = std::max(from, to);
    if (!(most - least > margin) || least < -LoadPeak::kRest * full_scale[c]) return 0;
    for (std::size_t i = before.end; i < hold.begin; ++i) {
        const double between = sign * rows[i]->wrench_S[c];
        if (!(between >= least - margin && between <= most + margin)) return 0;
    }
    return to > from ? 1 : -1;
}

CertificateFigures certificate_figures(const Labelled& labelled, const Calibration& calibration, const FitRequest& request,
                                       const Reference& reference) {
    CertificateFigures figures{.reference = reference,
                               .recording = labelled.name.substr(labelled.name.find_last_of('/') + 1),
                               .sessions = labelled.sessions};
    LoadedRows loaded = loaded_rows(labelled, calibration, request, figures);
    loaded.holds = holds_of(loaded);
    for (std::size_t i = 0; i < calibration.components.size() && i < calibration.full_scale.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        AxisFigures axis{.name = calibration.components[i], .full_scale = calibration.full_scale[i]};
        std::vector<Wrench> loads;
        axis.figures = iso376_figures(loaded, c, loads);
        Wrench alone{};
        alone[c] = axis.full_scale;
        axis.expanded = expanded_at(calibration, i, alone, reference);
        for (const Wrench& load : loads) axis.expanded_at.push_back(expanded_at(calibration, i, load, reference));
        figures.axes.push_back(std::move(axis));
    }
    return figures;
}

}  // namespace tactiled
