#include "config/calibration.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <chrono>

#include "config/names.hpp"
#include "config/seal.hpp"
#include "config/text_file.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{16} << 20;
constexpr std::size_t kMaxMethods = 16;
constexpr std::size_t kMaxTaxelFiles = 4096;
constexpr Range kFinite{-1e300, 1e300};  // room below overflow for products of a few numbers
constexpr Range kNotNegative{0, 1e300};
constexpr Range kLimit{1e-9, 1e9};

// Returns the number of channels or components as the count of numbers; any number if these are wrong.
Count as_many_as(const std::vector<std::string>& names) {
    return names.empty() ? Count{} : Count{names.size(), names.size()};
}

// Reports rows whose number is not that of `of`, "channels" or "components", which is 0 if these are wrong.
void check_number_of_rows(Options& table, const char* key, std::size_t rows, std::size_t needed, const char* of) {
    if (needed != 0 && rows != needed) table.problem(key, fmt::format("{} has {} rows for {} {}", key, rows, needed, of));
}

bool is_date(const std::string& text) {
    int year = 0;
    unsigned month = 0, day = 0;
    const auto number = [&](std::size_t at, std::size_t n, auto& value) {
        const char* end = text.data() + at + n;
        const auto [stop, error] = std::from_chars(text.data() + at, end, value);
        return error == std::errc{} && stop == end;
    };
    return text.size() == 10 && text[4] == '-' && text[7] == '-' && number(0, 4, year) && number(5, 2, month) &&
           number(8, 2, day) &&
           std::chrono::year_month_day(std::chrono::year(year), std::chrono::month(month), std::chrono::day(day)).ok();
}

void read_names(Options& file, Calibration& calibration) {
    const auto short_text = [&](const char* key, std::string& value) {
        if (!value.empty() && !valid_name(value))
            file.problem(key, fmt::format("{} = {}; {}", key, in_quotes(value), kValidName));
    };
    calibration.model = file.text("model");
    calibration.contact_model = file.text("contact_model", "unknown");
    calibration.serial = file.text("serial", "");
    short_text("model", calibration.model);
    if (calibration.serial.size() > kLongestNameBytes)
        file.problem("serial", fmt::format("serial has {} bytes; at most {} are published", calibration.serial.size(),
                                           kLongestNameBytes));
    calibration.date = file.text("date", "");
    calibration.nominal = file.flag("nominal", false);
    if (!calibration.date.empty() && !is_date(calibration.date))
        file.problem("date", fmt::format("date = {} should be a day as YYYY-MM-DD", in_quotes(calibration.date)));
}

void missing(Options& file, const char* key, const std::string& what) {
    if (!file.has(key)) file.problem(key, fmt::format("key \"{}\" is missing: {}", key, what));
}

void read_channels(Options& file, Calibration& calibration) {
    missing(file, "channels", "the names of the channels, in the order of all numbers below");
    const auto& channels = calibration.channels = file.texts("channels", {1, kMaxChannels});
    calibration.channel_unit = file.text("channel_unit", "");
    for (auto at = channels.begin(); at != channels.end(); ++at) {
        if (!valid_channel(*at) || *at == "-")
            file.problem("channels", fmt::format("channels has {}; {}", in_quotes(*at), kValidChannel));
        if (std::find(channels.begin(), at, *at) != at)
            file.problem("channels", fmt::format("channels has {} twice", in_quotes(*at)));
    }
    const Count each = as_many_as(channels);
    calibration.channel_least = file.numbers("channel_least", kFinite, each);
    calibration.channel_most = file.numbers("channel_most", kFinite, each);
    calibration.zero_drift = file.numbers("zero_drift", kNotNegative, each);
    const auto &min = calibration.channel_least, &max = calibration.channel_most;
    if (file.has("channel_least") != file.has("channel_most"))
        file.problem("channel_least", "channel_least and channel_most belong together: give both or none");
    for (std::size_t i = 0; i < std::min(min.size(), max.size()); ++i)
        if (min[i] > max[i])
            file.problem("channel_most",
                         fmt::format("channel_most[{0}] = {1} is below channel_least[{0}] = {2}", i, max[i], min[i]));
}

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

// Reads the parts that the monitor has in common with the joint domain of an older file.
void read_scores(Options& table, const char* scores, Calibration& calibration) {
    calibration.monitor.mean = table.numbers("mean", kFinite, as_many_as(calibration.channels));
    calibration.monitor.scores = table.rows(scores);
    calibration.monitor.limit = table.number("limit", kLimit);
    calibration.monitor.false_alarms = table.number("false_alarms", {0, 1}, 0);
}

void read_monitor(Options& file, Calibration& calibration) {
    if (!file.has("monitor")) return;
    Options table = file.table("monitor");
    Monitor& monitor = calibration.monitor;
    const std::size_t n = calibration.channels.size();
    read_scores(table, "scores", calibration);
    monitor.residual = table.rows("residual");
    if (!monitor.residual.empty()) monitor.residual_limit = table.number("residual_limit", kLimit);
    monitor.product_mean = table.numbers("product_mean", kFinite);
    monitor.coefficients = table.rows("coefficients");
    monitor.product_whitening = table.rows("product_whitening");
    const std::size_t m = monitor.scores.size(), r = monitor.residual.size(), products = monitor.product_mean.size();
    if (m < 1 || (n > 0 && m + r > n))
        table.problem("scores", fmt::format("monitor has {} scores and {} residuals of {} channels", m, r, n));
    if (products > 0 && (r == 0 || m > kMaxScores || products != products_of(m)))
        table.problem("product_mean", fmt::format("monitor has {} products of {} scores with {} residuals", products, m, r));
    check_number_of_rows(table, "coefficients", monitor.coefficients.size(), products > 0 ? r : 0, "residuals");
    check_rows(table, "coefficients", monitor.coefficients, products);
    check_number_of_rows(table, "product_whitening", monitor.product_whitening.size(), products, "products");
    check_triangle(table, "product_whitening", monitor.product_whitening);
    if (n == 0) return;
    check_rows(table, "scores", monitor.scores, n);
    check_rows(table, "residual", monitor.residual, n);
}

// Reads the checks of a file from before the monitor. The joint domain is a monitor with all channels as scores; its curved
// part and the parity of channels have no successor in the file.
void read_older_checks(Options& file, Calibration& calibration) {
    if (file.has("parity")) file.table("parity").accept_other_keys();
    if (!file.has("joint_domain")) return;
    Options table = file.table("joint_domain");
    Monitor& monitor = calibration.monitor;
    const std::size_t n = calibration.channels.size();
    read_scores(table, "whitening", calibration);
    monitor.is_older = true;
    if (table.has("curved")) table.table("curved").accept_other_keys();
    check_number_of_rows(table, "whitening", monitor.scores.size(), n, "channels");
    check_triangle(table, "whitening", monitor.scores);
    for (auto& row : monitor.scores) row.resize(n);
}

void read_dummy(Options& table, Calibration& calibration) {
    Temperature& temperature = calibration.temperature;
    temperature.dummy = table.text("dummy", "");
    if (temperature.dummy.empty()) return;
    const auto& channels = calibration.channels;
    if (!valid_channel(temperature.dummy) || temperature.dummy == "-")
        table.problem("dummy", fmt::format("dummy = {}; {}", in_quotes(temperature.dummy), kValidChannel));
    if (std::find(channels.begin(), channels.end(), temperature.dummy) != channels.end())
        table.problem("dummy", fmt::format("dummy = {} is one of channels; a dummy carries no load, so it is none of them",
                                           in_quotes(temperature.dummy)));
    temperature.dummy_zero = table.number("dummy_zero", kFinite);
    temperature.dummy_per_K = table.number("dummy_per_K", kFinite);
    if (temperature.dummy_per_K == 0)
        table.problem("dummy_per_K", "dummy_per_K = 0: a dummy that does not follow temperature shows none");
    temperature.dummy_per_K_sd = table.number("dummy_per_K_sd", kNotNegative, 0);
    temperature.dummy_difference_K = table.number("dummy_difference_K", {0, 100});
}

void read_temperature(Options& file, Calibration& calibration) {
    if (!file.has("temperature")) return;
    Options table = file.table("temperature");
    const Count each = as_many_as(calibration.channels);
    constexpr Range kCelsius{-273.15, 1000};
    Temperature& temperature = calibration.temperature;
    temperature.reference_C = table.number("reference_C", kCelsius);
    temperature.range_C = table.numbers("range_C", kCelsius, {2, 2});
    temperature.zero = table.numbers("zero", kFinite, each);
    temperature.zero_per_K = table.numbers("zero_per_K", kFinite, each);
    temperature.gain_per_K = table.numbers("gain_per_K", {-0.1, 0.1}, each);
    temperature.zero_per_K_sd = table.numbers("zero_per_K_sd", kNotNegative, each);
    temperature.gain_per_K_sd = table.numbers("gain_per_K_sd", {0, 0.1}, each);
    read_dummy(table, calibration);
    if (const auto& range = temperature.range_C; range.size() == 2 && range[0] > range[1])
        table.problem("range_C", "range_C should be [least, greatest]");
}

void read_repeats(Options& file, Calibration& calibration) {
    if (!file.has("repeats")) return;
    Options table = file.table("repeats");
    for (const double readings : table.numbers("readings", {0, 1e6}, as_many_as(calibration.channels)))
        calibration.repeats.readings.push_back(int(readings));
    calibration.repeats.interval_s = table.number("interval_s", {0, 1e6}, 0);
    calibration.repeats.noise = table.numbers("noise", kNotNegative, as_many_as(calibration.channels));
}

void read_components(Options& file, Calibration& calibration) {
    const auto possible = fmt::format("{}", fmt::join(kComponentNames, " "));
    missing(file, "components", "those of " + possible + " that the sensor sees");
    const auto& components = calibration.components = file.texts("components", {1, kComponentNames.size()});
    auto next = kComponentNames.begin();
    for (const auto& name : components) {
        const auto found = std::find(next, kComponentNames.end(), name);
        if (found == kComponentNames.end()) {
            file.problem("components", fmt::format("components has {} here; possible are {}, in this order, each once",
                                                   in_quotes(name), possible));
            break;
        }
        next = found + 1;
    }
    const Count each = as_many_as(components);
    calibration.full_scale = file.numbers("full_scale", kNotNegative, each);
    calibration.zero_rate_per_h = file.numbers("zero_rate_per_h", kNotNegative, each);
    calibration.zero_shift = file.numbers("zero_shift", kNotNegative, each);
}

void read_undetected_damage(Options& file, const std::vector<std::string>& channels, UndetectedDamage& damage) {
    if (!file.has("undetected_damage")) return;
    Options table = file.table("undetected_damage");
    for (std::size_t kind = 0; kind < kDamageKinds.size(); ++kind) {
        const char* const key = kDamageKinds[kind].key;
        missing(table, key, "the share of each channel, 0 to 1");
        damage.share[kind] = table.numbers(key, {0, 1}, as_many_as(channels));
    }
}

// Reads the fit of the file itself, or of one of its [[other]] tables.
void read_fit(Options& file, const Calibration& calibration, Fit& fit) {
    fit.method = file.text("method", "");
    if (!fit.method.empty() && !valid_name(fit.method))
        file.problem("method", fmt::format("method = {}; {}", in_quotes(fit.method), kValidName));
    const std::size_t n_rows = calibration.components.size(), n = calibration.channels.size();
    if (calibration.taxel_files.empty())
        missing(file, "zero", "what each channel reads at no load");
    else if (file.has("zero"))
        file.problem("zero", "the files of taxel_calibration have the zeros; tables.zero has those of each taxel");
    fit.zero = file.numbers("zero", kFinite, as_many_as(calibration.channels));
    const Count each = as_many_as(calibration.components);
    fit.sd = file.numbers("sd", kNotNegative, each);
    fit.sd_slope = file.numbers("sd_slope", kNotNegative, each);
    fit.sd_load = file.numbers("sd_load", kNotNegative, each);
    fit.sd_unloading = file.numbers("sd_unloading", kNotNegative, each);
    fit.sd_noise = file.numbers("sd_noise", kNotNegative, each);
    const std::size_t n_pairs = n_rows * (n_rows - std::min<std::size_t>(n_rows, 1)) / 2;
    fit.correlation = file.numbers("correlation", {-1, 1}, {n_pairs, n_pairs});
    fit.alike = file.numbers("alike", kNotNegative, {2, 2});
    if (fit.alike.size() == 2 && (fit.alike[0] > 1 || fit.alike[1] == 0))
        file.problem("alike", "alike needs a correlation of 0 .. 1, and a distance of loads above 0");
    fit.reference_sd = file.numbers("reference_sd", kNotNegative, each);
    fit.reference_gain_sd = file.number("reference_gain_sd", kNotNegative, 0);
    fit.held_out_rms = file.numbers("held_out_rms", kNotNegative, each);
    read_undetected_damage(file, calibration.channels, fit.undetected_damage);
    if (file.has("parity_harmless")) (void)file.numbers("parity_harmless", kFinite);  // older, see read_older_checks
    if (file.has("sd_without")) (void)file.rows("sd_without");
    fit.matrix = file.rows("matrix");
    if (!fit.matrix.empty()) check_number_of_rows(file, "matrix", fit.matrix.size(), n_rows, "components");
    for (std::size_t i = 0; i < fit.matrix.size(); ++i)
        if (n != 0 && fit.matrix[i].size() != n)
            file.problem("matrix", fmt::format("matrix[{}] has {} numbers for {} channels", i, fit.matrix[i].size(), n));
    const auto plain = [](Options& table, const char* kind, const std::string& name) {
        if (!valid_name(name) || name.find('.') != name.npos)
            table.problem(name, fmt::format("{} {}; {}, and no dot here", kind, in_quotes(name), kValidName));
    };
    Options parameters = file.table("parameters"), tables = file.table("tables");
    for (const auto& name : parameters.keys()) {
        plain(parameters, "parameter", name);
        fit.parameters[name] = parameters.number(name, kFinite);
    }
    for (const auto& name : tables.keys()) {
        plain(tables, "table", name);
        fit.tables[name] = tables.rows(name);
        for (const auto& row : fit.tables[name])
            if (row.size() != fit.tables[name].front().size())
                tables.problem(name, fmt::format("{}: its rows have {} and {} numbers; all need as many", name,
                                                 fit.tables[name].front().size(), row.size()));
    }
    // The taxels of an array have errors of their own, and perhaps none in common.
    const bool is_array = !calibration.taxel_files.empty() || fit.tables.contains("taxel");
    for (std::size_t i = 0; i < fit.sd.size() && !is_array; ++i)
        if (fit.sd[i] == 0)
            file.problem("sd",
                         fmt::format("sd[{}] = 0: no sensor is without an error; give one standard deviation in N or Nm "
                                     "above 0, or delete sd if it is not known (then UNCERTAIN)",
                                     i));
    if (!file.has("matrix") && !file.has("parameters") && !file.has("tables"))
        file.problem("matrix",
                     "key \"matrix\" is missing: a row for each component, in it N or Nm a channel_unit for each channel "
                     "(or [parameters], for models that have some)");
    fit.condition = file.number("condition", kNotNegative, 0);
    fit.validation = file.text("validation", "");
}

// Reads the calibrations of the taxels. One of them has no taxels of its own.
void read_taxels(Calibration& array, Problems& problems) {
    const std::string folder = array.path.substr(0, array.path.rfind('/') + 1);
    for (const auto& name : array.taxel_files) {
        const std::string path = name.front() == '/' ? name : folder + name;
        const auto text = read_text_file(path, kMaxBytes, problems);
        if (!text) return;
        Calibration taxel = parse_calibration(*text, path, problems);
        if (!taxel.taxel_files.empty()) problems.add(path, 0, "the calibration of a taxel has no taxel_calibration itself");
        array.crc = crc_of_lines(fmt::format("{:04x}{:04x}", array.crc, taxel.crc));
        array.taxels.push_back(std::move(taxel));
    }
}

}  // namespace

Calibration parse_calibration(std::string_view text, const std::string& name, Problems& problems) {
    Calibration calibration;
    calibration.path = name;
    const Seal seal = find_seal(text);
    const std::string_view body = text.substr(0, seal.start);
    calibration.crc = crc_of_lines(body);
    if (seal.crc && *seal.crc != calibration.crc) {
        const auto line = std::count(body.begin(), body.end(), '\n') + 1;
        problems.add(
            name, static_cast<std::uint32_t>(line),
            fmt::format(
                "crc = \"0x{:04X}\", but the lines above have 0x{:04X}: the file was changed or is damaged; calibrate "
                "again, or delete this line if the change is meant",
                *seal.crc, calibration.crc));
        return calibration;
    }
    Options file = Options::parse_text(body, name, problems);
    if (file.integer("format", {1, 1000}) > 1)
        file.problem("format", "a later version of tactiled wrote this file; this one reads format = 1");
    read_names(file, calibration);
    read_channels(file, calibration);
    read_monitor(file, calibration);
    read_older_checks(file, calibration);
    read_repeats(file, calibration);
    read_temperature(file, calibration);
    read_components(file, calibration);
    calibration.taxel_files = file.texts("taxel_calibration", {0, kMaxTaxelFiles});
    read_fit(file, calibration, calibration);
    for (Options& other : file.tables("other", kMaxMethods)) {
        read_fit(other, calibration, calibration.others.emplace_back());
        if (calibration.others.back().method.empty()) other.problem("method", "key \"method\" is missing");
    }
    calibration.rows = static_cast<int>(file.integer("rows", {0, 1e9}, 0));
    if (file.has("crc")) {
        (void)file.text("crc", "");
        file.problem("crc",
                     "crc has to be the last line of the file, as crc = \"0x1234\" with four digits; delete it if you wrote "
                     "it by hand");
    }
    file.finish();
    return calibration;
}

double UndetectedDamage::mean(std::size_t kind) const noexcept {
    double sum = 0;
    for (const double one : share[kind]) sum += one;
    return share[kind].empty() ? 0 : sum / double(share[kind].size());
}

std::size_t UndetectedDamage::worst_kind() const noexcept {
    std::size_t worst = 0;
    for (std::size_t kind = 1; kind < share.size(); ++kind)
        if (mean(kind) > mean(worst)) worst = kind;
    return worst;
}

std::size_t UndetectedDamage::worst_channel(std::size_t kind) const noexcept {
    return std::size_t(std::max_element(share[kind].begin(), share[kind].end()) - share[kind].begin());
}

const UndetectedDamage& Calibration::undetected_damage_of(const std::string& name) const noexcept {
    const UndetectedDamage* found = &undetected_damage;
    for (const Fit& other : others) {
        const UndetectedDamage& one = other.undetected_damage;
        if (other.method == name && method != name) return one;
        if (name != "auto" || !found->is_known()) continue;
        if (!one.is_known() || one.mean(one.worst_kind()) > found->mean(found->worst_kind())) found = &one;
    }
    return *found;
}

Calibration Calibration::with_method(const std::string& name) const {
    Calibration result = *this;
    for (const Fit& other : others)
        if (other.method == name && method != name) static_cast<Fit&>(result) = other;
    result.method = name;
    result.others.clear();
    return result;
}

Calibration load_calibration(const std::string& path, Problems& problems) {
    Calibration calibration;
    calibration.path = path;
    if (const auto text = read_text_file(path, kMaxBytes, problems)) calibration = parse_calibration(*text, path, problems);
    read_taxels(calibration, problems);
    return calibration;
}

}  // namespace tactiled
