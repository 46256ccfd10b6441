// tactilectl calibrate: makes a calibration file from labelled rows and reports its accuracy.
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "config/calibration.hpp"
#include "config/names.hpp"
#include "config/text_file.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/method.hpp"
#include "node/ctl/command_line.hpp"
#include "node/lab/calibrate_array.hpp"
#include "node/lab/certificate_options.hpp"
#include "node/lab/report/report.hpp"
#include "node/lab/warning_page.hpp"

namespace tactiled::ctl {
namespace {

struct Settings {
    std::string in, out, report;
    Selection selection;
    FitRequest request;
    ArraySettings array;
    CertificateOptions certificate;
    std::vector<std::string> set;              // "area_m2=3e-5"
    std::map<std::string, std::string> start;  // options of the fits
    std::optional<double> forget;
    DummyStated dummy;
    bool json = false, force = false, own_zeros = false, one_zero = false;
};

constexpr double kStaleMs = 100;       // default of stale_ms
constexpr double kPeriodsToStale = 3;  // one lost frame must not be an outage

// A [[sensor]] that uses the calibration, to be pasted into a configuration.
std::string sensor_text(const FitReport& report, const Settings& settings) {
    const std::filesystem::path file = std::filesystem::absolute(settings.out).lexically_normal();
    std::string name = file.stem().string();
    if (!valid_name(name)) name = "my_sensor";
    std::vector<std::string> channels;
    for (const auto& channel : report.calibration.channels) channels.push_back(toml_text(channel));
    if (const std::string& dummy = report.calibration.temperature.dummy; !dummy.empty())
        channels.push_back(toml_text(dummy));
    const double period_ms = 1e3 * report.calibration.repeats.interval_s;  // 0: not known
    const std::string slow = kPeriodsToStale * period_ms > kStaleMs
                                 ? fmt::format(
                                       "stale_ms = {:.0f}  # without a frame for longer there is no value; the rows "
                                       "are {:.0f} ms apart\n",
                                       std::min(10'000.0, std::ceil(kPeriodsToStale * period_ms / 100) * 100), period_ms)
                                 : "";
    return fmt::format(
        "[[sensor]]\nname = {}\nlink = \"usb0\"  # the name of its [[link]]\nmodel = {}\ncalibration = {}\n"
        "channels = [{}]  # of a frame, in order; \"-\" = not used\n{}",
        toml_text(name), toml_text(report.calibration.model), toml_text(file.string()), fmt::join(channels, ", "), slow);
}

// The times for which a claim is printed.
struct After {
    const char* name;
    double hours;
};
constexpr After kAfter[] = {{"known", 0}, {"1 min", 1 / 60.0}, {"10 min", 1 / 6.0}, {"1 h", 1}};

// Returns the median sd of a component so long after its zero was known (a tare, a free rest), as the daemon states it.
double claim_after(const FitReport& report, std::size_t i, double hours) {
    return std::hypot(component_errors(report, i).median_sd(), report.calibration.zero_growth_per_h()[i] * hours);
}

void print_claims(const FitReport& report) {
    if (report.calibration.sd.empty()) return;
    if (!report.drift_measured) {
        fmt::print(
            "the sd holds just after a tare; the drift of the zero is not known, because no session has times (t_s) over "
            "a minute\n");
        return;
    }
    fmt::print("median sd after the zero was known:\n{:>9}", "component");
    for (const After& after : kAfter) fmt::print(" {:>13}", after.name);
    for (std::size_t i = 0; i < report.components.size(); ++i) {
        fmt::print("\n{:>9}", report.components[i].name);
        for (const After& after : kAfter)
            fmt::print(" {:>10.3g} {:<2}", claim_after(report, i, after.hours), unit_of(report.components[i]));
    }
    fmt::print("\n");
    if (report.calibration.zero_rate_per_h.empty())
        fmt::print("no drift of the zero was seen: its growth is assumed, the sd in an hour\n");
}

// Prints the damage of one channel that no check of a sample finds.
void print_damage(const Calibration& calibration) {
    constexpr double kNone = 0.01;  // share of the readings
    const UndetectedDamage& damage = calibration.undetected_damage;
    if (!damage.is_known()) return;
    double worst = 0;
    for (const auto& shares : damage.share) worst = std::max(worst, *std::max_element(shares.begin(), shares.end()));
    if (worst <= kNone) {
        fmt::print("one damaged channel: at most {:.1f} % of readings are GOOD and off by more than 10 % of full scale\n",
                   100 * worst);
        return;
    }
    fmt::print("one damaged channel: readings that are GOOD and off by more than 10 % of full scale\n");
    for (std::size_t kind = 0; kind < kDamageKinds.size(); ++kind) {
        const std::size_t k = damage.worst_channel(kind);
        fmt::print("  {:<29} {:>5.1f} % as a mean over the channels, {:>5.1f} % {}\n", kDamageKinds[kind].text,
                   100 * damage.mean(kind), 100 * damage.share[kind][k], calibration.channels[k]);
    }
    fmt::print(
        "  The other channels do not contradict these readings. More channels, a second sensor (agrees_with) or a known "
        "weight (weigh known) would; undetected_damage_limit makes such a sensor UNCERTAIN.\n");
}

// Prints the parts of the standard deviation besides the error of the calibration.
void print_budget(const FitReport& report) {
    const Calibration& calibration = report.calibration;
    if (calibration.sd.empty()) return;
    if (calibration.sd_noise.empty()) {
        fmt::print("noise: not known (no three rows in a row of one load), so that a mean of samples is no better\n");
    } else {
        fmt::print("noise, all that a mean of samples reduces:");
        for (std::size_t i = 0; i < report.components.size(); ++i)
            fmt::print(" {} {:.2g} {}", report.components[i].name, calibration.sd_noise[i], unit_of(report.components[i]));
        fmt::print("\n");
    }
    if (calibration.reference_sd.empty())
        fmt::print("reference: not stated, so that no sd contains it (--reference and --reference-uncertainty)\n");
}

// Returns what the sample's dummy leaves: the sd of the largest coefficient beside its size.
std::string dummy_text(const Temperature& t) {
    if (t.dummy.empty()) return "";
    double most = 0;
    for (std::size_t k = 0; k < t.zero_per_K.size(); ++k)
        most = std::max(most, t.zero_per_K_sd[k] / std::abs(t.zero_per_K[k]));
    return fmt::format(" by the dummy {}, whose coefficient differs by {:.2g} % (sd{}), within {:g} K", t.dummy, 100 * most,
                       t.dummy_per_K_sd > 0 ? ", stated, not fitted" : "", t.dummy_difference_K);
}

void print_report(const FitReport& report, const Settings& settings) {
    const Calibration& calibration = report.calibration;
    fmt::print("{}: model {}, method {}, {} channels\n", settings.out, calibration.model, calibration.method,
               calibration.channels.size());
    fmt::print(
        "rows: {} used of {} ({} without a label, {} with a missing channel, {} saturated, {} with a label that looks "
        "wrong)\n",
        calibration.rows, report.rows_read, report.rows_without_label, report.rows_missing_channel, report.rows_saturated,
        std::count_if(report.suspects.begin(), report.suspects.end(), [](const auto& s) { return s.left_out; }));
    fmt::print("held out: {}\n", calibration.validation.empty() ? "not validated" : calibration.validation);
    for (const Way& way : report.ways)
        fmt::print(
            "  {}: {}\n", way.how,
            way.refused.empty() ? fmt::format("{:.2f} % of full scale", 100 * way.error) : "not possible: " + way.refused);
    fmt::print("{:>9} {:>10} {:>13} {:>15} {:>15} {:>8} {:>15} {:>8} {:>8} {:>8}  {}\n", "component", "rows", "full scale",
               "fitted rms", "held-out rms", "% of FS", "median sd", "in 1 sd", "in 3 sd", "over 5", "worst session");
    const auto percent = [](double share) {
        return std::isfinite(share) ? fmt::format("{:.2f}", 100 * share) : std::string("unknown");
    };
    for (std::size_t i = 0; i < report.components.size(); ++i) {
        const ComponentReport& c = report.components[i];
        const ComponentErrors errors = component_errors(report, i);
        const std::string unit = unit_of(c);
        fmt::print("{:>9} {:>10} {:>10.4g} {:<2} {:>12.3g} {:<2}", c.name, c.rows, c.full_scale, unit, c.fitted_rms, unit);
        if (!std::isfinite(c.held_out_rms)) {
            fmt::print(" {:>15} {:>8}\n", "unknown", "unknown");
            continue;
        }
        fmt::print(" {:>12.3g} {:<2} {:>8.2f}", c.held_out_rms, unit, 100 * c.held_out_rms / c.full_scale);
        if (errors.sd_known)
            fmt::print(" {:>12.3g} {:<2} {:>8} {:>8} {:>8}", errors.median_sd(), unit, percent(errors.within(1)),
                       percent(errors.within(3)), percent(1 - errors.within(5)));
        else
            fmt::print(" {:>15} {:>8} {:>8} {:>8}", "unknown", "unknown", "unknown", "unknown");
        if (const auto worst = errors.worst_session(); report.labelled->sessions.size() > 1 && std::isfinite(worst.rms))
            fmt::print("  {}: {:.3g} {}", report.labelled->sessions[worst.session], worst.rms, unit);
        fmt::print("\n");
    }
    print_claims(report);
    print_budget(report);
    if (report.methods.size() > 1)
        for (const auto& method : report.methods) {
            fmt::print("method {:10} {:6.1f} s", method.method, method.seconds);
            if (!method.refused.empty()) fmt::print(" refused: {}", method.refused);
            for (std::size_t i = 0; i < method.held_out_rms.size(); ++i) {
                const double of_full_scale = method.held_out_rms[i] / report.components[i].full_scale;
                fmt::print(" {} {}", report.components[i].name,
                           std::isfinite(of_full_scale) ? percent(of_full_scale) + " %" : "unknown");
            }
            fmt::print("\n");
        }
    for (const auto& [name, value] : calibration.parameters) fmt::print("{} = {:.5g}\n", name, value);
    fmt::print("condition number: {:.3g}\n", calibration.condition);
    if (const Temperature& t = calibration.temperature; !t.zero_per_K.empty())
        fmt::print("temperature: {:.1f} to {:.1f} degC{}\n", t.range_C[0], t.range_C[1], dummy_text(t));
    print_damage(calibration);
    for (const std::string& line : warning_page(report.warnings)) fmt::print(stderr, "warning: {}\n", line);
    fmt::print("To use it, paste into the configuration:\n\n{}", sensor_text(report, settings));
}

nlohmann::json damage_json(const Calibration& calibration) {
    const UndetectedDamage& damage = calibration.undetected_damage;
    if (!damage.is_known()) return nullptr;
    nlohmann::json json{{"worst_kind", kDamageKinds[damage.worst_kind()].key}};
    for (std::size_t kind = 0; kind < kDamageKinds.size(); ++kind) {
        nlohmann::json& one = json[kDamageKinds[kind].key] = {{"mean", damage.mean(kind)}};
        for (std::size_t k = 0; k < calibration.channels.size(); ++k)
            one["channels"][calibration.channels[k]] = damage.share[kind][k];
    }
    return json;
}

void print_json(const FitReport& report, const Settings& settings) {
    // A number that is unknown is written as null.
    nlohmann::json json{{"schema", 1},
                        {"calibration", settings.out},
                        {"model", report.calibration.model},
                        {"method", report.calibration.method},
                        {"channels", report.calibration.channels},
                        {"rows_read", report.rows_read},
                        {"rows_used", report.calibration.rows},
                        {"rows_without_label", report.rows_without_label},
                        {"rows_missing_channel", report.rows_missing_channel},
                        {"validation", report.calibration.validation},
                        {"rows_saturated", report.rows_saturated},
                        {"suspects", nlohmann::json::array()},
                        {"session_zeros", nlohmann::json::array()},
                        {"own_zero_per_session", report.zeros.own},
                        {"zero_drift", report.calibration.zero_drift},
                        {"methods", nlohmann::json::array()},
                        {"condition", report.calibration.condition},
                        {"sd_noise", report.calibration.sd_noise},
                        {"correlation", report.calibration.correlation},
                        {"alike", report.calibration.alike},
                        {"reference_sd", report.calibration.reference_sd},
                        {"reference_gain_sd", report.calibration.reference_gain_sd},
                        {"parameters", report.calibration.parameters},
                        {"sensor", sensor_text(report, settings)},
                        {"components", nlohmann::json::array()},
                        {"undetected_damage", damage_json(report.calibration)},
                        {"warnings", by_consequence(report.warnings)}};
    for (std::size_t i = 0; i < report.components.size(); ++i) {
        const ComponentReport& c = report.components[i];
        const ComponentErrors errors = component_errors(report, i);
        const auto worst = errors.worst_session();
        nlohmann::json component{{"name", c.name},
                                 {"unit", unit_of(c)},
                                 {"rows", c.rows},
                                 {"full_scale", c.full_scale},
                                 {"fitted_rms", c.fitted_rms},
                                 {"held_out_rms", c.held_out_rms},
                                 {"median_sd", errors.median_sd()},
                                 {"within_1_sd", errors.within(1)},
                                 {"within_3_sd", errors.within(3)},
                                 {"beyond_5_sd", 1 - errors.within(5)}};
        if (!report.calibration.sd.empty() && report.drift_measured)
            for (const After& after : kAfter) component["sd_after"][after.name] = claim_after(report, i, after.hours);
        if (report.labelled->sessions.size() > 1 && std::isfinite(worst.rms))
            component["worst_session"] = {{"name", report.labelled->sessions[worst.session]}, {"rms", worst.rms}};
        json["components"].push_back(std::move(component));
    }
    for (const Way& way : report.ways)
        json["held_out"].push_back({{"how", way.how}, {"error", way.error}, {"refused", way.refused}});
    for (const auto& method : report.methods) {
        json["methods"].push_back({{"method", method.method}, {"refused", method.refused}, {"seconds", method.seconds}});
        for (const double rms : method.held_out_rms) json["methods"].back()["held_out_rms"].push_back(rms);
    }
    for (const Suspect& suspect : report.suspects)
        json["suspects"].push_back({{"line", suspect.row->line},
                                    {"column", label_column(suspect.component)},
                                    {"label", suspect.label},
                                    {"expected", suspect.expected},
                                    {"left_out", suspect.left_out}});
    for (std::size_t s = 0; s < report.zeros.offset.size(); ++s)
        json["session_zeros"].push_back({{"session", report.labelled->sessions[s]}, {"offset", report.zeros.offset[s]}});
    fmt::print("{}\n", json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
}

// A wrong --out or --report must not cost the recording or the calibration.
void check_outputs(const Settings& settings) {
    namespace fs = std::filesystem;
    const auto check = [](const char* option, const std::string& path, const std::string& other) {
        std::error_code ignored;
        if (fs::path(path).lexically_normal() == fs::path(other).lexically_normal() || fs::equivalent(path, other, ignored))
            throw SetupError(fmt::format("{} {}: would replace this file; name another", option, in_quotes(path)));
        // Before the fit, which may take minutes.
        if (fs::is_directory(path, ignored)) throw SetupError(fmt::format("{} {}: is a folder", option, in_quotes(path)));
        if (const fs::path folder = fs::path(path).parent_path(); !folder.empty() && !fs::is_directory(folder, ignored))
            throw SetupError(
                fmt::format("{} {}: there is no folder {}", option, in_quotes(path), in_quotes(folder.string())));
    };
    check("--out", settings.out, settings.in);
    if (std::error_code ignored; !settings.force && fs::is_regular_file(settings.out, ignored))
        throw SetupError(fmt::format("--out {}: exists already; --force replaces it", in_quotes(settings.out)));
    for (const auto& [option, path] : {std::pair{"--report", settings.report}, std::pair{"--map", settings.array.map},
                                       std::pair{"--certificate", settings.certificate.file}}) {
        if (path.empty()) continue;
        check(option, path, settings.in);
        check(option, path, settings.out);
    }
    if (!settings.certificate.file.empty() && !settings.report.empty())
        check("--certificate", settings.certificate.file, settings.report);
}

void save_pages(const Settings& settings, const Labelled& labelled, const FitReport& report, const Reference& reference,
                const CertificateText& text) {
    if (settings.report.empty() && settings.certificate.file.empty()) return;
    const CertificateFigures figures = certificate_figures(labelled, report.calibration, settings.request, reference);
    if (!settings.report.empty())
        replace_file(
            settings.report,
            html_report(report, "Calibration " + std::filesystem::path(settings.out).filename().string(), &figures));
    if (!settings.certificate.file.empty()) save_certificate(settings.certificate.file, figures, report.calibration, text);
}

int calibrate(Settings settings) {
    check_outputs(settings);
    const Reference reference = reference_of(settings.certificate);
    const CertificateText stated = certificate_text(settings.certificate);
    const FitEntry* const of_array = find_array_fit(settings.request.model);
    if (settings.request.channel_unit.empty() && of_array != nullptr)
        settings.request.channel_unit = of_array->channels.unit;
    if (settings.request.channel_unit.empty()) {
        const auto fits = fits_of(settings.request.model);
        settings.request.channel_unit = fits.empty() ? "unknown" : fits.front()->channels.unit;
    }
    settings.request.date = fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::time(nullptr)));
    FitRequest& request = settings.request;
    for (const auto& text : settings.set) {
        const auto at = text.find('=');
        char* end = nullptr;
        const double value = at == text.npos ? 0 : std::strtod(text.c_str() + at + 1, &end);
        if (end == nullptr || end == text.c_str() + at + 1 || *end != 0)
            throw SetupError(fmt::format("--set {}: write NAME=NUMBER", in_quotes(text)));
        request.parameters[text.substr(0, at)] = value;
    }
    if (settings.own_zeros) request.zeros = FitRequest::Zeros::per_session;
    if (settings.one_zero) request.zeros = FitRequest::Zeros::common;
    // The name under which a calibration file has this parameter.
    if (const auto drift = request.parameters.find("zero_drift"); drift != request.parameters.end()) {
        if (!(drift->second >= 0 && drift->second <= 1))
            throw SetupError("--set zero_drift: a part of each channel's width, 0 to 1");
        request.zero_drift = drift->second;
        request.parameters.erase(drift);
    }
    if (of_array != nullptr) {
        if (!settings.report.empty()) throw SetupError("--report: an array has --map FILE, a CSV with a row for each taxel");
        if (!reference.name.empty()) throw SetupError("--certificate and --reference: an array has no such certificate");
        calibrate_array(*of_array, request, settings.array, settings.in, settings.out, settings.json);
        return kGood;
    }
    if (!settings.array.geometry.empty() || !settings.array.map.empty())
        throw SetupError(fmt::format("--geometry and --map are for arrays; model \"{}\" is none", request.model));
    if (settings.forget) request.parameters["forget"] = *settings.forget;
    for (const auto& [name, value] : settings.start)
        if (!value.empty()) put_fit_option(name, value, request);
    if (const auto fits = fits_of(request.model); !fits.empty()) settings.selection.known = fits.front()->channels.includes;
    Labelled labelled = read_labelled(settings.in, settings.selection);
    fmt::print(stderr, "{}", labelled.columns);  // before the fit, which may take minutes
    request.dummy = take_dummy(labelled, request.model, request.channel_unit, settings.dummy);
    check_reference(reference, labelled);
    FitReport report = fit(labelled, settings.request);
    put_reference(reference, report.calibration);
    save_calibration(report.calibration, settings.out);
    save_pages(settings, labelled, report, reference, stated);
    if (settings.json)
        print_json(report, settings);
    else
        print_report(report, settings);
    return kGood;
}

}  // namespace

Run add_calibrate(Command verb) {
    auto settings = std::make_shared<Settings>();
    settings->request.channel_unit.clear();
    verb.add_option("--model", settings->request.model, fmt::format("{}", fmt::join(model_names(), ", "))).required();
    verb.add_option("--method", settings->request.method,
                    "of the model; its first if not given; auto: all that the rows determine");
    verb.add_option("--set", settings->set, "a parameter that is known: NAME=NUMBER, e.g. area_m2=3e-5").take_all();
    verb.add_option("--forget", settings->forget,
                    "method matrix of model generic: row i of N counts this to the power N - i; 0.999: the last 1000 rows")
        .number_in(0.5, 1.0);
    for (const FitEntry* entry : all_fits())
        if (entry->option.name != nullptr)
            verb.add_option(fmt::format("--{}", entry->option.name), settings->start[entry->option.name],
                            entry->option.help);
    verb.add_option("--in", settings->in,
                    "labelled.csv (also gzip, npy): time, channels, fx_N .. mz_Nm, session; array: Z0, Z1 ..., fz_N, press; "
                    "- is standard "
                    "input")
        .required();
    verb.add_option("--out", settings->out, "the calibration file to write").required();
    verb.add_flag("--force", settings->force, "replace the calibration file where there is one");
    verb.add_option("--zero-drift", settings->request.zero_drift,
                    "sd of each channel's zero in use, as a part of its width (0.01: 1 %); else that of the sessions")
        .number_in(0.0, 1.0);
    const Option own = verb.add_flag("--zero-per-session", settings->own_zeros,
                                     "each session has its own zero, as after mounting; else found from the recording");
    verb.add_flag("--one-zero", settings->one_zero, "all sessions have the same zero").excludes(own);
    verb.add_option("--dummy-difference-K", settings->dummy.difference_K,
                    "hair with a dummy H0: largest difference of temperature between it and another hair, e.g. 0.01")
        .number_in(0.0, 100.0);
    verb.add_option("--dummy-at-C", settings->dummy.at_C,
                    "temperature at which the dummy was recorded, if there is no column temperature_C")
        .number_in(-50.0, 150.0);
    verb.add_flag("--keep-outliers", settings->request.keep_outliers, "labels that look wrong are reported and used");
    verb.add_option("--saturates-below", settings->request.saturates_below,
                    "rows with a channel at or below this are left out (unit of the channels)");
    verb.add_option("--saturates-above", settings->request.saturates_above,
                    "rows with a channel at or above this are left out (unit of the channels)");
    verb.add_option("--report", settings->report, "also write a report with plots: one HTML file");
    add_certificate_options(verb, settings->certificate);
    verb.add_option("--geometry", settings->array.geometry,
                    "array: a calibration file with the places of its taxels, e.g. the maker's; or --set rows=16 ...");
    verb.add_option("--map", settings->array.map, "array: also write gain, sd, load and state of each taxel: one CSV file");
    verb.add_option("--session", settings->selection.sessions, "use only these sessions").take_all();
    verb.add_option("--channels", settings->selection.channels, "use only these columns, in this order: A,B,C")
        .delimiter(',');
    verb.add_option("--columns", settings->selection.columns, "names of all columns, of a file without a header: A,B,C")
        .delimiter(',');
    verb.add_option("--labels", settings->selection.labels,
                    "a file with the labels, recorded beside --in with another clock: aligned by time");
    verb.add_option("--serial", settings->request.serial, "of this sensor");
    verb.add_option("--contact-model", settings->request.contact_model, "what pressed on it: uniform, point ...")
        .show_default();
    verb.add_option("--channel-unit", settings->request.channel_unit, "unit of the channels: dR/R0, pF, uT, counts ...");
    verb.add_flag("--json", settings->json, "print the report as JSON");
    return [settings] { return calibrate(*settings); };
}

}  // namespace tactiled::ctl
