#include <fmt/format.h>
#include <fmt/ranges.h>

#include "config/calibration.hpp"
#include "config/names.hpp"
#include "config/text_file.hpp"

namespace tactiled {
namespace {

// The shortest decimal that reads back as the same bits, with what TOML wants to see in a float.
std::string toml_number(double x) {
    std::string text = fmt::format("{}", x);
    if (text.find_first_of(".en") == text.npos) text += ".0";  // "n": inf and nan, which the reader refuses
    return text;
}

std::string toml_text(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\')
            out += fmt::format("\\{}", c);
        else if ((c >= 0 && c < ' ') || c == '\x7f')
            out += fmt::format("\\u{:04x}", unsigned(c));
        else
            out += c;
    }
    return out + "\"";
}

// Bare where that is possible, so that a name cannot bring lines of its own into the file.
std::string toml_key(const std::string& name) {
    return valid_name(name) && name.find('.') == name.npos ? name : toml_text(name);
}

std::string toml_numbers(const std::vector<double>& numbers) {
    std::vector<std::string> all;
    for (const double x : numbers) all.push_back(toml_number(x));
    return fmt::format("[{}]", fmt::join(all, ", "));
}

std::string toml_texts(const std::vector<std::string>& texts) {
    std::vector<std::string> all;
    for (const auto& text : texts) all.push_back(toml_text(text));
    return fmt::format("[{}]", fmt::join(all, ", "));
}

}  // namespace

std::string calibration_text(const Calibration& calibration) {
    std::string out =
        "# One calibrated sensor sample. Forces in N, moments in Nm, frame S. The last line guards all lines before it.\n";
    const auto line = [&](const char* key, const std::string& value) { out += fmt::format("{} = {}\n", key, value); };
    const auto text = [&](const char* key, const std::string& value) {
        if (!value.empty()) line(key, toml_text(value));
    };
    const auto numbers = [&](const char* key, const std::vector<double>& values) {
        if (!values.empty()) line(key, toml_numbers(values));
    };
    line("format", "1");
    text("model", calibration.model);
    text("method", calibration.method);
    text("contact_model", calibration.contact_model);
    text("serial", calibration.serial);
    text("date", calibration.date);
    line("channels", toml_texts(calibration.channels));
    text("channel_unit", calibration.channel_unit);
    numbers("zero", calibration.zero);
    numbers("channel_least", calibration.channel_least);
    numbers("channel_most", calibration.channel_most);
    line("components", toml_texts(calibration.components));
    if (!calibration.matrix.empty()) {
        out += "matrix = [\n";
        for (const auto& row : calibration.matrix) out += fmt::format("    {},\n", toml_numbers(row));
        out += "]\n";
    }
    numbers("sd", calibration.sd);
    numbers("full_scale", calibration.full_scale);
    line("condition", toml_number(calibration.condition));
    text("validation", calibration.validation);
    line("rows", fmt::format("{}", calibration.rows));
    // Not as a table [parameters]: the crc line after it would belong to that table.
    for (const auto& [name, value] : calibration.parameters)
        line(("parameters." + toml_key(name)).c_str(), toml_number(value));
    return out + fmt::format("crc = \"0x{:04X}\"\n", calibration_crc(out));
}

void save_calibration(const Calibration& calibration, const std::string& path) {
    const std::string text = calibration_text(calibration);
    Problems problems;
    parse_calibration(text, path, problems);  // what could not be read again shall not replace what can
    problems.throw_if_any();
    replace_file(path, text);
}

}  // namespace tactiled
