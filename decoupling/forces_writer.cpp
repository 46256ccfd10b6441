#include <fmt/format.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <iterator>
#include <span>
#include <stdexcept>

#include "decoupling/csv.hpp"

namespace tactiled {
namespace {

std::string why_not_opened(const std::string& path) { return fmt::format("{}: {}", path, std::strerror(errno)); }

// The columns of struct tactiled_budget.
std::string budget_columns() {
    constexpr std::string_view kWords[] = {TACTILED_PART_TABLE(TACTILED_WORD_OF_PART_)};
    std::string columns;
    for (const std::string_view word : kWords)
        for (const auto& component : kComponentNames) columns += fmt::format(",{}_{}", word, component);
    for (std::size_t c = 0; c < 6; ++c)
        for (std::size_t d = c + 1; d < 6; ++d) columns += fmt::format(",r_{}_{}", kComponentNames[c], kComponentNames[d]);
    for (const auto& component : kComponentNames) columns += fmt::format(",load_{}", component);
    return columns + ",alike,alike_within,model";
}

}  // namespace

ForcesWriter::ForcesWriter(const std::string& path, bool has_budget)
    : name_(path == "-" ? "standard output" : path), has_budget_(has_budget) {
    file_.reset(path == "-" ? stdout : std::fopen(path.c_str(), "we"));
    if (file_ == nullptr) throw SetupError(why_not_opened(path));
    // A consumer at the other end of a pipe receives each row immediately and not after 4 kB.
    if (path == "-") std::setvbuf(stdout, nullptr, _IOLBF, 1u << 16);
    put("t_s,fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm,sd_fx_N,sd_fy_N,sd_fz_N,quality,cop_x_m,cop_y_m,direction,residual,"
        "sd_mx_Nm,sd_my_Nm,sd_mz_Nm,sd_cop_x_m,sd_cop_y_m" +
        (has_budget ? budget_columns() : "") + "\n");
}

void ForcesWriter::write(double t_s, const Estimate& estimate, std::string_view quality, const tactiled_budget& budget) {
    row_.clear();
    const auto add = [&](double number) {
        if (std::isfinite(number)) fmt::format_to(std::back_inserter(row_), "{}", number);
        row_ += ',';
    };
    add(t_s);
    for (const double component : estimate.wrench_S) add(component);
    for (std::size_t c = 0; c < 3; ++c) add(estimate.sd[c]);
    // Several reasons are separated by commas and need quotes.
    const bool quoted = quality.find(',') != std::string_view::npos;
    if (quoted) row_ += '"';
    row_ += quality;
    if (quoted) row_ += '"';
    row_ += ',';
    for (const double coordinate : estimate.cop_S_m) add(coordinate);
    add(estimate.direction == 0 ? kNaN : double(estimate.direction));
    add(estimate.residual);
    for (std::size_t c = 3; c < 6; ++c) add(estimate.sd[c]);
    for (const double sd : estimate.cop_sd_m) add(sd);
    if (has_budget_) {
        const auto add_all = [&](std::span<const float> numbers) {
            for (const float number : numbers) add(double(number));
        };
        for (const auto& part : budget.sd_part) add_all(part);
        add_all(budget.correlation);
        add_all(budget.load);
        add_all({&budget.alike, 1});
        add_all({&budget.alike_within, 1});
        fmt::format_to(std::back_inserter(row_), "{},", budget.model);
    }
    row_.back() = '\n';
    put(row_);
}

void ForcesWriter::close() {
    std::FILE* file = file_.release();
    const bool shared = file == stdout;
    if ((shared ? std::fflush(file) : std::fclose(file)) != 0) throw std::runtime_error(why_not_opened(name_));
}

void ForcesWriter::put(const std::string& row) {
    if (std::fwrite(row.data(), 1, row.size(), file_.get()) != row.size()) throw std::runtime_error(why_not_opened(name_));
}

}  // namespace tactiled
