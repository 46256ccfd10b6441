#include "node/lab/certificate_options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <optional>

#include "config/text_file.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled::ctl {
namespace {

bool is_country(const std::string& text) {
    return text.size() == 2 && std::all_of(text.begin(), text.end(), [](char c) { return c >= 'A' && c <= 'Z'; });
}

bool is_date(const std::string& text) {
    if (text.size() != 10 || text[4] != '-' || text[7] != '-') return false;
    const auto number = [&](std::size_t at, std::size_t n) {
        unsigned value = 0;
        const char* const end = text.data() + at + n;
        return std::from_chars(text.data() + at, end, value).ptr == end ? value : 0;
    };
    return std::chrono::year_month_day(std::chrono::year(int(number(0, 4))), std::chrono::month(number(5, 2)),
                                       std::chrono::day(number(8, 2)))
        .ok();
}

bool is_any(const std::string& text) { return text.find_first_not_of(" \t\r\n") != text.npos; }

struct Stated {
    const char* key;
    std::string CertificateText::*member;
    bool (*is_right)(const std::string& text);
    const char* right;
};
constexpr Stated kStated[] = {
    {"number", &CertificateText::number, is_any, "the number of the certificate"},
    {"laboratory", &CertificateText::laboratory, is_any, "a name"},
    {"person", &CertificateText::person, is_any, "the name of the person who is responsible"},
    {"customer", &CertificateText::customer, is_any, "a name"},
    {"country", &CertificateText::country, is_country, "that of the laboratory as two capital letters: DE"},
    {"performed", &CertificateText::performed, is_date, "the date of the measurement: 2026-11-20"},
};

// The units of an uncertainty. The longer one comes before its beginning.
struct Unit {
    std::string_view text;
    double Reference::*member;
    double per_one;
};
constexpr Unit kUnits[] = {
    {"%", &Reference::relative, 0.01}, {"Nm", &Reference::moment_Nm, 1}, {"N", &Reference::force_N, 1}};

void add_uncertainty(const std::string& text, Reference& reference) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const std::string_view unit(end, std::size_t(text.data() + text.size() - end));
    const auto* const known =
        std::find_if(std::begin(kUnits), std::end(kUnits), [&](const Unit& one) { return one.text == unit; });
    if (error != std::errc() || known == std::end(kUnits) || !(value > 0) || !std::isfinite(value))
        throw SetupError(fmt::format(
            "--reference-uncertainty {}: write a number above 0 with its unit, as 0.1%, 0.02N or 0.001Nm", in_quotes(text)));
    if (reference.*(known->member) != 0)
        throw SetupError(fmt::format("--reference-uncertainty {}: there is another one in {}", in_quotes(text), unit));
    reference.*(known->member) = value * known->per_one;
}

}  // namespace

void add_certificate_options(Command verb, CertificateOptions& options) {
    std::vector<std::string> keys;
    for (const Stated& stated : kStated) keys.emplace_back(stated.key);
    verb.add_option("--certificate", options.file,
                    "also write figures as in ISO 376 and expanded uncertainties: one XML file in the shape of a Digital "
                    "Calibration Certificate; needs --reference and --reference-uncertainty");
    verb.add_option("--reference", options.reference, "certificate, report: what measured the labels, as a text");
    verb.add_option("--reference-uncertainty", options.uncertainty,
                    "certificate, report: expanded (k = 2), as its own certificate states it: 0.1% of the load, 0.02N, "
                    "0.001Nm; several are added")
        .delimiter(',')
        .take_all();
    verb.add_option("--stated", options.stated,
                    fmt::format("certificate: a text that it has, KEY=TEXT; keys: {}", fmt::join(keys, ", ")))
        .take_all();
}

Reference reference_of(const CertificateOptions& options) {
    Reference reference{.name = options.reference};
    for (const std::string& text : options.uncertainty) add_uncertainty(text, reference);
    const bool has_name = is_any(options.reference), has_uncertainty = !options.uncertainty.empty();
    if (!has_name && (has_uncertainty || !options.file.empty()))
        throw SetupError(fmt::format("{} needs --reference \"what measured the labels\"",
                                     options.file.empty() ? "--reference-uncertainty" : "--certificate"));
    if (!has_uncertainty && (has_name || !options.file.empty()))
        throw SetupError(
            fmt::format("{} needs --reference-uncertainty: that of the reference, expanded (k = 2), as 0.1%, 0.02N or "
                        "0.001Nm; it is never taken as 0",
                        options.file.empty() ? "--reference" : "--certificate"));
    return reference;
}

CertificateText certificate_text(const CertificateOptions& options) {
    if (!options.stated.empty() && options.file.empty()) throw SetupError("--stated: is for --certificate FILE");
    CertificateText text;
    for (const std::string& stated : options.stated) {
        const std::size_t at = std::min(stated.find('='), stated.size());
        const auto* const known = std::find_if(std::begin(kStated), std::end(kStated),
                                               [&](const Stated& one) { return one.key == stated.substr(0, at); });
        if (known == std::end(kStated)) {
            std::vector<std::string> keys;
            for (const Stated& one : kStated) keys.emplace_back(one.key);
            throw SetupError(fmt::format("--stated {}: write KEY=TEXT with one of the keys {}", in_quotes(stated),
                                         fmt::join(keys, ", ")));
        }
        std::string& value = text.*(known->member) = at < stated.size() ? stated.substr(at + 1) : "";
        if (!known->is_right(value))
            throw SetupError(fmt::format("--stated {}: {} is {}", in_quotes(stated), known->key, known->right));
    }
    return text;
}

void check_reference(const Reference& reference, const Labelled& labelled) {
    if (reference.name.empty()) return;
    for (std::size_t c = 0; c < kComponentNames.size(); ++c)
        if (!(reference.expanded(c, 1) > 0) &&
            std::any_of(labelled.rows.begin(), labelled.rows.end(),
                        [&](const LabelledRow& row) { return std::isfinite(row.wrench_S[c]); }))
            throw SetupError(fmt::format("--reference-uncertainty: {} needs one too, in % or {}", kComponentNames[c],
                                         c < 3 ? "N" : "Nm"));
}

void put_reference(const Reference& reference, Calibration& calibration) {
    if (reference.name.empty()) return;
    const auto put = [&](Fit& fit) {
        fit.reference_gain_sd = reference.relative / kCoverage;
        fit.reference_sd.clear();
        for (const std::string& name : calibration.components)
            fit.reference_sd.push_back((component_index(name) < 3 ? reference.force_N : reference.moment_Nm) / kCoverage);
    };
    put(calibration);
    for (Fit& other : calibration.others) put(other);
}

void save_certificate(const std::string& file, const CertificateFigures& figures, const Calibration& calibration,
                      CertificateText text) {
    for (const AxisFigures& axis : figures.axes)
        if (!std::isfinite(axis.expanded))
            throw SaveError(fmt::format(
                "{}: not saved: the calibration states no standard deviation of {}; record more loads or sessions", file,
                axis.name));
    if (text.number.empty()) {
        Problems problems;
        const Calibration saved = parse_calibration(calibration_text(calibration), "", problems);
        text.number = fmt::format("{}-{}-{:04x}", calibration.serial.empty() ? "tactiled" : calibration.serial,
                                  calibration.date, saved.crc);
    }
    replace_file(file, certificate_xml(figures, calibration, text));
}

}  // namespace tactiled::ctl
