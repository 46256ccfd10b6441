#include <fmt/format.h>
#include <fmt/ranges.h>

#include "config/calibration.hpp"
#include "config/names.hpp"
#include "config/seal.hpp"
#include "config/text_file.hpp"

namespace tactiled {
namespace {

// Returns the shortest decimal that reads back as the same bits, in the form of a TOML float.
std::string toml_number(double x) {
    std::string text = fmt::format("{}", x);
    if (text.find_first_of(".en") == text.npos) text += ".0";  // "n" detects inf and nan, which the reader rejects
    return text;
}

// Writes a bare key if possible, else a quoted one, so that a name cannot add lines to the file.
std::string toml_key(const std::string& name) {
    return valid_name(name) && name.find('.') == name.npos ? name : toml_text(name);
}

// Breaks the list into lines, because a table may have rows of a thousand numbers.
std::string toml_numbers(const std::vector<double>& numbers) {
    constexpr std::size_t kPerLine = 32;
    std::string out = "[";
    for (std::size_t i = 0; i < numbers.size(); ++i)
        out += (i == 0 ? "" : i % kPerLine == 0 ? ",\n        " : ", ") + toml_number(numbers[i]);
    return out + "]";
}

std::string toml_texts(const std::vector<std::string>& texts) {
    std::vector<std::string> all;
    for (const auto& text : texts) all.push_back(toml_text(text));
    return fmt::format("[{}]", fmt::join(all, ", "));
}

// Lines "key = value", without empty values.
class Lines {
public:
    void line(const std::string& key, const std::string& value) { text_ += fmt::format("{} = {}\n", key, value); }
    void text(const char* key, const std::string& value) {
        if (!value.empty()) line(key, toml_text(value));
    }
    void numbers(const char* key, const std::vector<double>& values) {
        if (!values.empty()) line(key, toml_numbers(values));
    }
    void rows(const std::string& key, const std::vector<std::vector<double>>& values) {
        text_ += key + " = [\n";
        for (const auto& row : values) text_ += fmt::format("    {},\n", toml_numbers(row));
        text_ += "]\n";
    }
    void fit(const Fit& fit) {
        text("method", fit.method);
        numbers("zero", fit.zero);
        if (!fit.matrix.empty()) rows("matrix", fit.matrix);
        numbers("sd", fit.sd);
        numbers("sd_slope", fit.sd_slope);
        numbers("sd_load", fit.sd_load);
        numbers("sd_unloading", fit.sd_unloading);
        numbers("sd_noise", fit.sd_noise);
        numbers("correlation", fit.correlation);
        numbers("alike", fit.alike);
        numbers("reference_sd", fit.reference_sd);
        if (fit.reference_gain_sd > 0) line("reference_gain_sd", toml_number(fit.reference_gain_sd));
        numbers("held_out_rms", fit.held_out_rms);
        if (fit.undetected_damage.is_known())
            for (std::size_t kind = 0; kind < kDamageKinds.size(); ++kind)
                line(fmt::format("undetected_damage.{}", kDamageKinds[kind].key),
                     toml_numbers(fit.undetected_damage.share[kind]));
        line("condition", toml_number(fit.condition));
        text("validation", fit.validation);
        for (const auto& [name, value] : fit.parameters) line("parameters." + toml_key(name), toml_number(value));
        for (const auto& [name, values] : fit.tables) rows("tables." + toml_key(name), values);
    }
    std::string text_;
};

}  // namespace

std::string calibration_text(const Calibration& calibration) {
    Lines out;
    out.text_ =
        "# One calibrated sensor sample. Forces in N, moments in Nm, frame S. The last line guards all lines before it.\n";
    out.line("format", "1");
    out.text("model", calibration.model);
    out.text("contact_model", calibration.contact_model);
    out.text("serial", calibration.serial);
    out.text("date", calibration.date);
    if (calibration.nominal) out.line("nominal", "true");
    out.line("channels", toml_texts(calibration.channels));
    out.text("channel_unit", calibration.channel_unit);
    out.numbers("channel_least", calibration.channel_least);
    out.numbers("channel_most", calibration.channel_most);
    if (const Monitor& monitor = calibration.monitor; monitor.limit > 0) {
        out.numbers("monitor.mean", monitor.mean);
        out.rows("monitor.scores", monitor.scores);
        out.line("monitor.limit", toml_number(monitor.limit));
        if (!monitor.residual.empty()) {
            out.rows("monitor.residual", monitor.residual);
            out.line("monitor.residual_limit", toml_number(monitor.residual_limit));
        }
        if (!monitor.product_mean.empty()) {
            out.numbers("monitor.product_mean", monitor.product_mean);
            out.rows("monitor.coefficients", monitor.coefficients);
            out.rows("monitor.product_whitening", monitor.product_whitening);
        }
        out.line("monitor.false_alarms", toml_number(monitor.false_alarms));
    }
    if (const Temperature& temperature = calibration.temperature; !temperature.zero_per_K.empty()) {
        out.line("temperature.reference_C", toml_number(temperature.reference_C));
        out.numbers("temperature.range_C", temperature.range_C);
        out.numbers("temperature.zero", temperature.zero);
        out.numbers("temperature.zero_per_K", temperature.zero_per_K);
        out.numbers("temperature.gain_per_K", temperature.gain_per_K);
        out.numbers("temperature.zero_per_K_sd", temperature.zero_per_K_sd);
        out.numbers("temperature.gain_per_K_sd", temperature.gain_per_K_sd);
        if (!temperature.dummy.empty()) {
            out.text("temperature.dummy", temperature.dummy);
            out.line("temperature.dummy_zero", toml_number(temperature.dummy_zero));
            out.line("temperature.dummy_per_K", toml_number(temperature.dummy_per_K));
            out.line("temperature.dummy_per_K_sd", toml_number(temperature.dummy_per_K_sd));
            out.line("temperature.dummy_difference_K", toml_number(temperature.dummy_difference_K));
        }
    }
    if (const Repeats& repeats = calibration.repeats; !repeats.readings.empty() || !repeats.noise.empty()) {
        if (!repeats.readings.empty()) out.line("repeats.readings", fmt::format("[{}]", fmt::join(repeats.readings, ", ")));
        out.line("repeats.interval_s", toml_number(repeats.interval_s));
        out.numbers("repeats.noise", repeats.noise);
    }
    out.numbers("zero_drift", calibration.zero_drift);
    out.line("components", toml_texts(calibration.components));
    out.numbers("full_scale", calibration.full_scale);
    out.numbers("zero_rate_per_h", calibration.zero_rate_per_h);
    out.numbers("zero_shift", calibration.zero_shift);
    if (!calibration.taxel_files.empty()) out.line("taxel_calibration", toml_texts(calibration.taxel_files));
    out.line("rows", fmt::format("{}", calibration.rows));
    out.fit(calibration);
    for (const Fit& other : calibration.others) {
        out.text_ += "[[other]]  # another method, for the same channels and components\n";
        out.fit(other);
    }
    return sealed(out.text_);
}

void save_calibration(const Calibration& calibration, const std::string& path) {
    const std::string text = calibration_text(calibration);
    Problems problems;
    parse_calibration(text, path, problems);  // an unreadable file must not replace a readable one
    problems.throw_if_any();
    replace_file(path, text);
}

}  // namespace tactiled
