#include "config/calibration.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <chrono>

#include "config/calibration_domain.hpp"
#include "config/names.hpp"
#include "config/seal.hpp"
#include "config/text_file.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{16} << 20;
constexpr std::size_t kMaxMethods = 16;
constexpr Range kFinite{-1e300, 1e300};  // room below overflow for products of a few numbers
constexpr Range kNotNegative{0, 1e300};

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
    const Count each = channels.empty() ? Count{} : Count{channels.size(), channels.size()};
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

void read_parity(Options& file, Calibration& calibration) {
    if (!file.has("parity")) return;
    Options table = file.table("parity");
    const std::size_t n = calibration.channels.size();
    const Count each = n == 0 ? Count{} : Count{n, n};
    Parity& parity = calibration.parity;
    parity.order = int(table.integer("order", {1, 2}));
    parity.centre = table.numbers("centre", kFinite, each);
    parity.scale = table.numbers("scale", {1e-300, 1e300}, each);
    parity.coefficients = table.rows("coefficients");
    parity.sd = table.numbers("sd", kNotNegative, each);
    parity.false_alarms = table.number("false_alarms", {0, 1}, 0);
    if (n != 0 && parity.coefficients.size() != n)
        table.problem("coefficients",
                      fmt::format("coefficients has {} rows for {} channels", parity.coefficients.size(), n));
}

void read_temperature(Options& file, Calibration& calibration) {
    if (!file.has("temperature")) return;
    Options table = file.table("temperature");
    const std::size_t n = calibration.channels.size();
    const Count each = n == 0 ? Count{} : Count{n, n};
    constexpr Range kCelsius{-273.15, 1000};
    Temperature& temperature = calibration.temperature;
    temperature.reference_C = table.number("reference_C", kCelsius);
    temperature.range_C = table.numbers("range_C", kCelsius, {2, 2});
    temperature.zero = table.numbers("zero", kFinite, each);
    temperature.zero_per_K = table.numbers("zero_per_K", kFinite, each);
    temperature.gain_per_K = table.numbers("gain_per_K", {-0.1, 0.1}, each);
    if (const auto& range = temperature.range_C; range.size() == 2 && range[0] > range[1])
        table.problem("range_C", "range_C should be [least, greatest]");
}

void read_repeats(Options& file, Calibration& calibration) {
    if (!file.has("repeats")) return;
    Options table = file.table("repeats");
    const std::size_t n = calibration.channels.size();
    for (const double readings : table.numbers("readings", {0, 1e6}, n == 0 ? Count{} : Count{n, n}))
        calibration.repeats.readings.push_back(int(readings));
    calibration.repeats.interval_s = table.number("interval_s", {0, 1e6}, 0);
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
    const Count each = components.empty() ? Count{} : Count{components.size(), components.size()};
    calibration.full_scale = file.numbers("full_scale", kNotNegative, each);
}

// Reads the fit of the file itself, or of one of its [[other]] tables.
void read_fit(Options& file, const Calibration& calibration, Fit& fit) {
    fit.method = file.text("method", "");
    if (!fit.method.empty() && !valid_name(fit.method))
        file.problem("method", fmt::format("method = {}; {}", in_quotes(fit.method), kValidName));
    const std::size_t n_rows = calibration.components.size(), n = calibration.channels.size();
    missing(file, "zero", "what each channel reads at no load");
    fit.zero = file.numbers("zero", kFinite, n == 0 ? Count{} : Count{n, n});
    const Count each = n_rows == 0 ? Count{} : Count{n_rows, n_rows};
    fit.sd = file.numbers("sd", kNotNegative, each);
    fit.sd_slope = file.numbers("sd_slope", kNotNegative, each);
    fit.sd_load = file.numbers("sd_load", kNotNegative, each);
    fit.sd_unloading = file.numbers("sd_unloading", kNotNegative, each);
    fit.held_out_rms = file.numbers("held_out_rms", kNotNegative, each);
    fit.parity_harmless = file.numbers("parity_harmless", kNotNegative, n == 0 ? Count{} : Count{n, n});
    fit.sd_without = file.rows("sd_without");
    if (!fit.sd_without.empty() && n != 0 && fit.sd_without.size() != n)
        file.problem("sd_without", fmt::format("sd_without has {} rows for {} channels", fit.sd_without.size(), n));
    for (std::size_t i = 0; i < fit.sd_without.size(); ++i)
        if (n_rows != 0 && fit.sd_without[i].size() != n_rows)
            file.problem("sd_without", fmt::format("sd_without[{}] has {} numbers for {} components", i,
                                                   fit.sd_without[i].size(), n_rows));
    fit.matrix = file.rows("matrix");
    if (!fit.matrix.empty() && n_rows != 0 && fit.matrix.size() != n_rows)
        file.problem("matrix", fmt::format("matrix has {} rows for {} components", fit.matrix.size(), n_rows));
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
    if (!file.has("matrix") && !file.has("parameters") && !file.has("tables"))
        file.problem("matrix",
                     "key \"matrix\" is missing: a row for each component, in it N or Nm a channel_unit for each channel "
                     "(or [parameters], for models that have some)");
    fit.condition = file.number("condition", kNotNegative, 0);
    fit.validation = file.text("validation", "");
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
    read_joint_domain(file, calibration);
    read_repeats(file, calibration);
    read_parity(file, calibration);
    read_temperature(file, calibration);
    read_components(file, calibration);
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

Calibration Calibration::with_method(const std::string& name) const {
    Calibration result = *this;
    for (const Fit& other : others)
        if (other.method == name && method != name) static_cast<Fit&>(result) = other;
    result.method = name;
    result.others.clear();
    return result;
}

Calibration load_calibration(const std::string& path, Problems& problems) {
    const auto text = read_text_file(path, kMaxBytes, problems);
    if (text) return parse_calibration(*text, path, problems);
    Calibration nothing;
    nothing.path = path;
    return nothing;
}

}  // namespace tactiled
